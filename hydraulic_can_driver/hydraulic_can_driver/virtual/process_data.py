"""Sends and receives the process data of one device, with SYNC or on their own."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import can
import canopen

from hydraulic_can_driver.virtual.pdo import Mapping, configured

RECEIVED, SENT = (0x1400, 0x1600), (0x1800, 0x1A00)
_PLACES = 0x200
_TOO_SHORT, _TOO_LONG = 0x8210, 0x8220  # EMCY: a PDO of the wrong length
_COMMUNICATION = 0x10  # bit of the error register


@dataclass
class Upsets:
    """What faults do to a device; everything is off.

    `lost_frames` to come are not sent, `delay` [s] holds them up, `length` [bytes] is theirs whatever is mapped.
    """

    no_heartbeat: bool = False
    identity: dict[int, int] = field(default_factory=dict)
    aborts: dict[tuple[int, int], int] = field(default_factory=dict)
    lost_frames: float = 0.0
    delay: float = 0.0
    length: int | None = None


class Owner(Protocol):
    """The device that process data belong to."""

    upsets: Upsets

    @property
    def operational(self) -> bool:
        """Whether it exchanges process data."""

    def get(self, index: int, sub: int = 0) -> int:
        """Number in an object."""

    def object_bytes(self, index: int, sub: int) -> bytes:
        """Bytes of an object."""

    def take_bytes(self, index: int, sub: int, data: bytes) -> None:
        """Put bytes into an object."""

    def received(self, number: int) -> None:
        """A frame of that number has come."""

    def emergency(self, code: int, register: int, data: bytes = b"") -> None:
        """Send an EMCY."""


class ProcessData:
    """All process data objects of a device, as configured in its dictionary.

    ``done`` is told the number of each frame whose content was taken over. `deadline` [s] is the longest silence of a
    received one that is tolerated, 0 for any; it holds as well while the device is off the bus.
    """

    def __init__(
        self, owner: Owner, network: canopen.Network, lock: threading.RLock, done: Callable[[int], None]
    ) -> None:
        self._owner, self._network, self._lock, self._done = owner, network, lock, done
        self.deadline = 0.0
        self._sent: list[Mapping] = []
        self._heard: dict[int, Mapping] = {}
        self._waiting: dict[int, tuple[Mapping, bytes]] = {}
        self._due: dict[int, float] = {}
        self._syncs = 0

    def configure(self, indices: list[int]) -> None:
        """Read the parameters anew; ``indices`` are those of the dictionary."""
        self.close()
        for index in indices:
            if RECEIVED[0] <= index < RECEIVED[0] + _PLACES:
                heard = configured(self._owner.get, *RECEIVED, index - RECEIVED[0] + 1)
                if heard is not None:
                    self._heard[heard.cob_id] = heard
                    self._network.subscribe(heard.cob_id, self._on_frame)
            elif SENT[0] <= index < SENT[0] + _PLACES:
                sent = configured(self._owner.get, *SENT, index - SENT[0] + 1)
                if sent is not None:
                    self._sent.append(sent)
        self.deadline = max((mapping.timer for mapping in self._heard.values()), default=0.0)

    def close(self) -> None:
        """Hear and send nothing."""
        for cob_id in self._heard:
            self._network.unsubscribe(cob_id, self._on_frame)
        self._heard, self._sent, self._waiting = {}, [], {}

    def forget(self) -> None:
        """Drop what waits for a SYNC."""
        self._waiting.clear()

    def take_over(self) -> None:
        """A SYNC: what came since the last one is valid from now on."""
        waiting, self._waiting = self._waiting, {}
        for mapping, data in waiting.values():
            self._apply(mapping, data)

    def transmit_synchronous(self) -> None:
        """Send what goes with this SYNC."""
        self._syncs += 1
        for mapping in self._sent:
            if mapping.synchronous and self._syncs % max(mapping.transmission, 1) == 0:
                self._transmit(mapping)

    def transmit_due(self, now: float) -> None:
        """Send what goes by its event timer, at ``now`` [s]."""
        for mapping in self._sent:
            if not mapping.synchronous and mapping.timer > 0.0:
                due = self._due.setdefault(mapping.number, now)
                if now >= due:
                    self._due[mapping.number] = max(due + mapping.timer, now)
                    self._transmit(mapping)

    def _on_frame(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        with self._lock:
            mapping = self._heard.get(cob_id)
            if mapping is None or not self._owner.operational:
                return
            if len(data) != mapping.length:
                code = _TOO_SHORT if len(data) < mapping.length else _TOO_LONG
                self._owner.emergency(code, _COMMUNICATION, bytes([mapping.number, len(data), mapping.length]))
                if code == _TOO_SHORT:
                    return
            self._owner.received(mapping.number)
            if mapping.synchronous:
                self._waiting[mapping.number] = mapping, bytes(data)
            else:
                self._apply(mapping, bytes(data))

    def _apply(self, mapping: Mapping, data: bytes) -> None:
        at = 0
        for index, sub, size in mapping.objects:
            self._owner.take_bytes(index, sub, data[at : at + size])
            at += size
        self._done(mapping.number)

    def _transmit(self, mapping: Mapping) -> None:
        upsets = self._owner.upsets
        if upsets.lost_frames > 0:
            upsets.lost_frames -= 1
            return
        data = b"".join(self._owner.object_bytes(index, sub) for index, sub, _ in mapping.objects)
        if upsets.length is not None:
            data = data.ljust(upsets.length, b"\0")[: upsets.length]
        if upsets.delay > 0.0:
            late = threading.Timer(upsets.delay, self._send, (mapping.cob_id, data))
            late.daemon = True
            late.start()
        else:
            self._send(mapping.cob_id, data)

    def _send(self, cob_id: int, data: bytes) -> None:
        if self._owner.operational:
            with contextlib.suppress(can.CanError):  # a bus that takes nothing loses the frame
                self._network.send_message(cob_id, data)
