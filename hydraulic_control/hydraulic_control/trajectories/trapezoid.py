"""There and back with a trapezoidal profile of the velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ._base import Profile, ramped


@dataclass(frozen=True)
class Trapezoid(Profile):
    """From ``offset`` [m] by ``amplitude`` [m], ``dwell`` [s] of rest, and back.

    It goes at the limits of ``velocity`` [m/s] and ``acceleration`` [m/s²]; a way too short for full speed has a
    triangular profile.
    """

    velocity: float
    acceleration: float
    dwell: float

    @property
    def _way(self) -> tuple[float, float]:
        """Speed between the ramps [m/s] and time of the whole way [s]."""
        distance = abs(self.amplitude)
        ramp = min(self.velocity / self.acceleration, math.sqrt(distance / self.acceleration))
        speed = self.acceleration * ramp
        return speed, (distance / speed + ramp) if speed > 0.0 else 0.0

    @property
    def duration(self) -> float:
        return 2.0 * self._way[1] + self.dwell

    def at(self, t: float) -> tuple[float, float]:
        fastest, total = self._way
        turned = t > total + 0.5 * self.dwell
        now = min(max(self.duration - t if turned else t, 0.0), total)
        way, speed = ramped(now, total, abs(self.amplitude), fastest, self.acceleration)
        sign = math.copysign(1.0, self.amplitude)
        return self.offset + sign * way, sign * (-speed if turned else speed)
