"""A linear transducer (CiA 406): position and speed in its own steps, work area, alarms."""

from __future__ import annotations

import math

from hydraulic_can_driver.bus import Node
from hydraulic_can_driver.virtual.device import Sensor
from hydraulic_can_driver.virtual.plant import Reading
from hydraulic_can_driver.virtual.wiring import Wiring

ABOVE, BELOW = 0x2, 0x4
"""Bits of the work area state 0x6400."""

POSITION_ERROR = 0x1
"""Bit of the alarms 0x6503."""

_POSITION_STEP, _SPEED_STEP = 1e-9, 1e-5  # 0x6005 counts 0.001 um and 0.01 mm/s


class Lvdt(Sensor):
    """Measures the piston. `jump` [m], `frozen`, `stuck_at` [m], `broken` and `area` (bits of 0x6400) are faults."""

    profile = 406

    def __init__(self, spec: Node, wiring: Wiring) -> None:
        super().__init__(spec, wiring)
        self.jump = 0.0
        self.frozen = False
        self.stuck_at: float | None = None
        self.area = 0
        self._raw = 0
        self._flicker = 0  # the last count of a converter that measures nothing new
        self._sign, self._zero = wiring.mounting("position")

    def sense(self, reading: Reading) -> None:
        """See `Device.sense`."""
        if self.frozen or self.stuck_at is not None:
            self._flicker ^= 1
        if self.frozen:
            self.set(0x6004, 0, self._raw + self._flicker)
            self.set(0x6400, 1, self._work_area(self._raw) | self.area)
            return
        position = (reading.position if self.stuck_at is None else self.stuck_at) + self.jump
        raw = round(self._sign * (position - self._zero) / (_POSITION_STEP * self.get(0x6005, 1)))
        speed = reading.velocity if math.isfinite(reading.velocity) else 0.0
        self.set(0x6503, 0, POSITION_ERROR if self._broken else 0)
        if self._broken:
            return
        self._raw = raw
        self.set(0x6004, 0, raw + (self._flicker if self.stuck_at is not None else 0))
        self.set(0x6030, 1, round(self._sign * speed / (_SPEED_STEP * self.get(0x6005, 2))))
        self.set(0x6400, 1, self._work_area(raw) | self.area)

    def _work_area(self, raw: int) -> int:
        return ABOVE if raw > self.get(0x6402, 1) else BELOW if raw < self.get(0x6401, 1) else 0

    def refuse(self, index: int, sub: int, value: int) -> int:
        """A step of 0 measures nothing."""
        return 0x06090030 if index == 0x6005 and value == 0 else 0
