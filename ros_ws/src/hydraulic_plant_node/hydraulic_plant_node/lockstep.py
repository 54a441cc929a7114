"""Lockstep: plant time stands still until the last sample has been answered and recorded.

A loaded machine then stretches a run and changes nothing in it: each sample meets the command that answers the sample
before, and a recorder that falls behind is waited for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from hydraulic_plant_node.command_gate import CommandGate

PATIENCE_S = 5.0
"""How long (wall time) an answer is waited for; beyond the 3 s after which a foreign node may repeat a lost packet."""
AHEAD_S = 0.25
"""How far (plant time) the plant may be ahead of a recorder: a small part of what publishers keep, and little enough at
once for the middleware to lose nothing of it."""
_POLL_S = 0.01  # a stop that comes while the plant waits is seen after this


class LockstepPorts(Protocol):
    """Where answers come from."""

    def take_commands(self, gate: CommandGate, now_ns: int) -> None:
        """Put every waiting command through the gate."""

    def wait_for_command(self, seconds: float) -> None:
        """Return when a command waits, or after that time."""

    def commanders(self) -> int:
        """How many may send commands."""

    def recorded_ns(self) -> int | None:
        """Stamp up to which every recorder has the plant's samples; None where nobody records."""


class Lockstep:
    """Waits for the source in command, once it has answered two samples in a row, if late, and for recorders.

    Sources that send at a rate of their own answer no samples and are not waited for.
    """

    def __init__(self, gate: CommandGate, ports: LockstepPorts, period_ns: int) -> None:
        self._gate, self._ports, self._period_ns = gate, ports, period_ns
        self.given_up = 0
        self._given_up_ns = 0
        self._heard = gate.answered_ns
        self._answering = False

    def hold(self, stamp_ns: int, leaving: Callable[[], bool]) -> bool:
        """Return when the sample of `stamp_ns` has been answered (True), nobody is to answer it, or when `leaving`."""
        give_up = time.monotonic() + PATIENCE_S
        self._take(stamp_ns)
        while not leaving() and not (self._answered(stamp_ns) and self._recorded(stamp_ns)):
            if time.monotonic() > give_up:
                self.given_up += 1
                self._given_up_ns, self._answering = stamp_ns, False
                break
            self._ports.wait_for_command(_POLL_S)
            self._take(stamp_ns)
        return self._heard[0] >= stamp_ns

    def _take(self, stamp_ns: int) -> None:
        self._ports.take_commands(self._gate, stamp_ns)
        self._gate.drive(stamp_ns)  # a gate that has been disabled or stopped lets go of its source

    def _answered(self, stamp_ns: int) -> bool:
        if self._heard != self._gate.answered_ns:
            self._heard = newest, before = self._gate.answered_ns
            self._answering = newest - before == self._period_ns
        self._answering = self._answering and self._gate.enabled and self._ports.commanders() > 0
        return not self._answering or self._heard[0] >= stamp_ns

    def _recorded(self, stamp_ns: int) -> bool:
        recorded_ns = self._ports.recorded_ns()
        return recorded_ns is None or (stamp_ns - max(recorded_ns, self._given_up_ns)) * 1e-9 < AHEAD_S
