"""What the virtual devices need from a plant, and when it is stepped."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Protocol

NAN = math.nan
JITTER = 0.98  # share of a period by which a SYNC may come late without a period being counted as missed
DRIFT = 1e-3  # share of a SYNC's lateness that is taken for a difference of the two clocks


@dataclass(frozen=True, slots=True)
class Reading:
    """What is true at one instant: position [m], velocity [m/s], pressures [Pa], spool as share of its travel (±1).

    What a plant does not have is NaN.
    """

    position: float
    velocity: float = NAN
    pressure_a: float = NAN
    pressure_b: float = NAN
    pressure_supply: float = NAN
    spool: float = NAN


class Plant(Protocol):
    """The hydraulics behind the devices."""

    def step(self, drive: float, dt: float) -> Reading:
        """What holds at this instant; then ``dt`` [s] pass with the spool's set-point at ``drive`` [V]."""


class SyncClock:
    """Counts one period of the plant per SYNC and knows no other time: for a master in lockstep."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._periods = 0

    def now(self) -> float:
        """Time since the start, s."""
        return self._periods * self._period

    def sync(self, now: float) -> int:
        """One."""
        self._periods += 1
        return 1

    def overdue(self, now: float, patience: float) -> int:
        """None: without a SYNC time stands still."""
        return 0


class SlotClock:
    """Counts the periods of the plant by the SYNCs that arrive, or by time where none do.

    A SYNC is sent on time and heard late: the plant lives in periods of exactly ``period`` [s], and the delay of a
    busy machine is not mistaken for time that passed on the bench.
    """

    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self.now = time.monotonic
        self._at = now  # when the newest period began, by the earliest SYNCs

    def sync(self, now: float) -> int:
        """Periods that have passed since the last call, 1 or more, as a SYNC is heard at ``now`` [s]."""
        periods = max(1, math.floor((now - self._at) / self.period + 1.0 - JITTER))
        self._at += periods * self.period
        late = now - self._at
        self._at = now if late < 0.0 else self._at + DRIFT * late
        return periods

    def overdue(self, now: float, patience: float) -> int:
        """Periods to be made up for where no SYNC has come for longer than ``patience`` [s]; else 0."""
        if now - self._at < patience:
            return 0
        periods = math.floor((now - self._at) / self.period)
        self._at += periods * self.period
        return periods
