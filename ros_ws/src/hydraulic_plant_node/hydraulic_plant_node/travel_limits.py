"""How much of a commanded drive may be applied where the piston is: slew, and braking before the ends of the stroke.

At the distance d from the nearer end the piston may move at most as fast as it could still be stopped from:

    v(d) = max(c, √((a·t)² + 2·a·d) − a·t),    c = 0.4 · impact speed

a: deceleration, t: reaction time. The drive is limited to v(d) over the speed per volt, in both directions: leaving an
end as slowly as approaching it is what keeps oil and load from swinging back into it. The slew limit holds for a drive
that grows; towards 0 V a drive may always jump. Where braking limits it, a drive takes at least 60 ms to grow to that
limit: what alternates as fast as the load swings on the oil then hardly pumps it, even where nothing damps it.

What is applied lies between 0 V and what was commanded. Where a position is missing, the piston may have moved at full
speed ever since the last one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hydraulic_interfaces.contract import DRIVE_LIMIT_V

_CREEP = 0.4  # of the impact speed: the rest is for the swing of the load on the oil
_GROWTH_S = 0.06  # of a drive from 0 to what braking allows; the load swings at 20 to 80 Hz


@dataclass(frozen=True)
class EndsOfTravel:
    """What the limits go by.

    ``low``, ``high`` [m]: the stops. ``impact_speed`` [m/s]: at most, at a stop. ``full_speed`` [m/s]: of the piston
    at 10 V, the faster direction. ``deceleration`` [m/s²] and ``reaction`` [s]: how it can be stopped, and how long
    until it begins to; a reaction beyond the time after which a valve misses its driver covers the driver's death, too.
    ``slew`` [V/s]: fastest growth of the drive.
    """

    low: float
    high: float
    impact_speed: float
    full_speed: float
    deceleration: float = 5.0
    reaction: float = 0.12
    slew: float = 2000.0

    def __post_init__(self) -> None:
        for name in ("impact_speed", "full_speed", "deceleration", "reaction", "slew"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value:g}, must be positive and finite")
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(f"ends of travel are {self.low:g} and {self.high:g} m, must be finite and in this order")


class TravelLimits:
    """Limits one drive per ``period`` [s]; `observe` tells it each sample, `limited` gives the drive."""

    def __init__(self, ends: EndsOfTravel, period: float) -> None:
        self.ends = ends
        self.braked = self.slewed = 0
        self._period = period
        self._volts = DRIVE_LIMIT_V / ends.full_speed
        self._step = ends.slew * period
        self._at = ends.deceleration * ends.reaction
        self.forget()

    def forget(self) -> None:
        """Nothing is known of the piston: it may be at an end."""
        self._position = math.nan
        self._blind = 0  # drives since the last position
        self._last = 0.0

    def observe(self, position: float) -> None:
        """The position [m] of a sample; NaN is none."""
        if math.isfinite(position):
            self._position, self._blind = position, 0

    def allowed(self) -> float:
        """Largest drive [V] in either direction where the piston may be now."""
        ends, position = self.ends, self._position
        if position != position:
            distance = 0.0
        else:
            distance = min(ends.high - position, position - ends.low) - ends.full_speed * self._blind * self._period
        speed = _CREEP * ends.impact_speed
        if distance > 0.0:
            speed = max(speed, math.sqrt(self._at * self._at + 2.0 * ends.deceleration * distance) - self._at)
        return self._volts * speed

    def limited(self, drive: float) -> float:
        """What of a drive [V] is applied in this cycle, between 0 and ``drive``."""
        size = abs(drive)
        allowed = self.allowed()
        if size > allowed:
            size = allowed
            self.braked += 1
        step = self._step
        if allowed < DRIVE_LIMIT_V:
            step = min(step, allowed * self._period / _GROWTH_S)
        grown = step + (abs(self._last) if self._last * drive > 0.0 else 0.0)
        if size > grown:
            size = grown
            self.slewed += 1
        self._blind += 1
        self._last = math.copysign(size, drive) if size else 0.0
        return self._last
