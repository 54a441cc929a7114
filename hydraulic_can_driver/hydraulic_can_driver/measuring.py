"""From the quantities of a cycle to a sample, and to what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hydraulic_can_driver.bus import SWITCHES, Bus
from hydraulic_can_driver.faults import BusFault
from hydraulic_can_driver.plausibility import PositionCheck
from hydraulic_interfaces.samples import NAN, PlantSample

FULL_SCALE = 16384
"""Counts of ±100 % in CiA 408."""


class Measuring:
    """Follows the sensors from cycle to cycle; `simulated`: of a plant that lives in whole periods."""

    def __init__(self, bus: Bus, simulated: bool = False) -> None:
        self._bus = bus
        self._check = PositionCheck(bus.limits, 1.0 / bus.rate if simulated else 0.0)
        self._spool, self._switch = bus.signal("spool"), bus.signal("switches")
        self.closed: tuple[str, ...] = ()

    def forget(self) -> None:
        """Begin anew: the next position has nothing to be compared with."""
        self._check.forget()

    def allowed(self, drive: float) -> float:
        """What of a drive [V] is let through: nothing outwards at a closed limit switch."""
        limit = self._bus.limits.drive
        low = 0.0 if SWITCHES[0] in self.closed else -limit
        high = 0.0 if SWITCHES[1] in self.closed else limit
        return min(max(drive, low), high)

    def problems(self, stamp_ns: int, found: Mapping[str, float]) -> Iterator[tuple[BusFault, str]]:
        """What the sensors of this cycle show to be wrong."""
        if self._switch is not None:
            word = int(found["switches"])
            self.closed = tuple(name for name in SWITCHES if word >> self._switch.bits[name] & 1)
        for name, value in found.items():
            if name.endswith("_status") and value:
                what = name.removesuffix("_status")
                yield BusFault.SENSOR, f"{what} is not valid: status 0x{int(value):02X} (cable break, overload)"
        opening, supply = self._opening(found), found.get("pressure_supply", NAN)
        if problem := self._check.problem(stamp_ns, found["position"], opening, supply):
            yield BusFault.POSITION, problem

    def sample(self, stamp_ns: int, drive: float, found: Mapping[str, float]) -> PlantSample:
        """The sample of a cycle; `drive` [V] is what was sent with its SYNC. What nobody measures is NaN."""
        cylinder = self._bus.cylinder
        a, b = found.get("pressure_a", NAN), found.get("pressure_b", NAN)
        return PlantSample(
            stamp_ns,
            position=found["position"],
            velocity=found.get("velocity", NAN),
            force=a * cylinder.area_a - b * cylinder.area_b,
            drive=drive,
            spool=found.get("spool", NAN),
            pressure_a=a,
            pressure_b=b,
            pressure_supply=found.get("pressure_supply", NAN),
            limit_retracted=SWITCHES[0] in self.closed,
            limit_extended=SWITCHES[1] in self.closed,
        )

    def _opening(self, found: Mapping[str, float]) -> float:
        if self._spool is None:
            return NAN
        scale = self._spool.scale
        return (found["spool"] - scale.offset) / abs(scale.gain) / FULL_SCALE
