"""A pressure transducer (CiA 404): process value in the unit and digits it is set to, status, field value."""

from __future__ import annotations

import math
from collections.abc import Mapping

from hydraulic_can_driver.bus import Node
from hydraulic_can_driver.virtual.device import Sensor
from hydraulic_can_driver.virtual.plant import Reading
from hydraulic_can_driver.virtual.wiring import Wiring

UNITS: Mapping[int, float] = {0x00220000: 1.0, 0x004E0000: 1e5}
"""What 0x6131 may say (unit code of CiA 303-2 in the third byte), and how many Pa that is."""

INVALID, OVERLOAD, UNDERLOAD = 0x1, 0x2, 0x4
"""Bits of the status 0x6150."""

_LEAST_CURRENT, _SPAN_CURRENT = 4000, 16000  # uA: 4 ... 20 mA


class Transducer(Sensor):
    """Measures the pressure that the bus file reads from it; `broken` is its cable."""

    profile = 404

    def __init__(self, spec: Node, wiring: Wiring) -> None:
        super().__init__(spec, wiring)
        names = [signal.name for pdo in spec.transmit for signal in pdo.signals]
        self.quantity = next(name for name in names if name in ("pressure_a", "pressure_b", "pressure_supply"))
        self._sign, self._offset = wiring.mounting(self.quantity)

    def sense(self, reading: Reading) -> None:
        """See `Device.sense`; a pressure that the plant does not have reads as a broken cable."""
        pressure = self._sign * (float(getattr(reading, self.quantity)) - self._offset)
        if self._broken or not math.isfinite(pressure):
            self.set(0x6150, 1, INVALID)
            self.set(0x7100, 1, 0)
            return
        shown = pressure / UNITS[self.get(0x6131, 1)]
        raw = round(shown * 10 ** self.get(0x6132, 1))
        low, high = self.get(0x6148, 1), self.get(0x6149, 1)  # in the unit of the maker's calibration: bar
        share = (pressure * 1e-5 - low) / (high - low)
        self.set(0x6150, 1, OVERLOAD if share > 1.0 else UNDERLOAD if share < 0.0 else 0)
        self.set(0x7100, 1, _LEAST_CURRENT + round(_SPAN_CURRENT * min(max(share, 0.0), 1.0)))
        self.set(0x6130, 1, shown)
        self.set(0x7130, 1, raw)
        self.set(0x9130, 1, raw)

    def refuse(self, index: int, sub: int, value: int) -> int:
        """Only the units that it knows."""
        return 0x06090030 if (index, sub) == (0x6131, 1) and value not in UNITS else 0
