"""The faults of the bench on the bus: what each is called, and a latch that keeps them until they are reset.

The reaction to every one of them is the same: drive 0 V, valve disabled, latched until `reset`. What is no fault is
counted in the diagnostics: single missed cycles, late frames, SYNCs that came late, frames that nobody expected.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from enum import Enum


class BusFault(Enum):
    """Name in the diagnostics, and what it stands for."""

    BUS = "bus-off, interface down, or a frame that could not be sent"
    HEARTBEAT = "a device has fallen silent"
    RESTART = "a device has restarted, or left the state OPERATIONAL"
    EMERGENCY = "a device has sent an emergency message (EMCY)"
    VALVE = "the valve reports a fault or did not follow the control word"
    FRAMES = "frames of a device were missing, or late, in several cycles in a row"
    LENGTH = "a frame does not have the length that was mapped"
    SYNC = "the control loop was held up: no SYNC for too long"
    POSITION = "the position is implausible: jump, out of stroke, frozen, no number"
    SENSOR = "a sensor reports that its value is not valid (cable break, overload)"
    SECOND_MASTER = "somebody else on the bus sends what only the driver may send"


NEEDS_CONFIGURE = (BusFault.RESTART, BusFault.LENGTH)
"""Faults after which the devices have to be configured anew; no reset releases them."""


class FaultLatch:
    """Keeps the faults that have come; may be used from several threads. Counts always, latches only while `armed`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._latched: dict[BusFault, str] = {}
        self.counts: Counter[BusFault] = Counter()
        self.log: deque[str] = deque(maxlen=20)
        self.armed = False

    def report(self, fault: BusFault, text: str) -> None:
        """Note that something is wrong; of each kind the first text is kept."""
        with self._lock:
            self.counts[fault] += 1
            if fault not in self._latched:
                self.log.append(f"{fault.name.lower()}: {text}")
            if self.armed:
                self._latched.setdefault(fault, text)

    @property
    def text(self) -> str:
        """What is wrong, the first fault first; empty while nothing is."""
        if not self._latched:
            return ""
        with self._lock:
            return "; ".join(self._latched.values())

    def __contains__(self, fault: BusFault) -> bool:
        return fault in self._latched

    def clear(self) -> None:
        """Forget what is latched; the counts stay."""
        with self._lock:
            self._latched.clear()
