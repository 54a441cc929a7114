"""There and back as smoothly as possible.

The path of least integrated squared jerk between two points of rest is 10τ³ − 15τ⁴ + 6τ⁵ (T. Flash, N. Hogan,
J. Neuroscience 5 (1985) 1688–1703); its velocity reaches 15/8 and its acceleration 10/√3 of the mean values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ._base import MotionLimits, Profile

PEAK_VELOCITY = 15.0 / 8.0
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)


def blend(tau: float) -> tuple[float, float]:
    """Position 0 … 1 and its derivative for τ = 0 … 1, constant outside."""
    tau = min(max(tau, 0.0), 1.0)
    return tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2), 30.0 * tau**2 * (1.0 - tau) ** 2


def shortest_time(distance: float, limits: MotionLimits) -> float:
    """Least time [s] for ``distance`` [m] within the limits of velocity and acceleration."""
    way = abs(distance)
    return max(PEAK_VELOCITY * way / limits.velocity, math.sqrt(PEAK_ACCELERATION * way / limits.acceleration))


@dataclass(frozen=True)
class MinimumJerk(Profile):
    """From ``offset`` [m] by ``amplitude`` [m] in ``time`` [s], ``dwell`` [s] of rest, and back (if ``back``)."""

    time: float
    dwell: float = 0.0
    back: bool = True

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], limits: MotionLimits) -> MinimumJerk:
        """See `make`; half a period of ``frequency`` [Hz] per way, or longer where the limits ask for it."""
        half = max(0.5 / settings["frequency"], shortest_time(settings["amplitude"], limits))
        return cls(settings["offset"], settings["amplitude"], half, settings["dwell"])

    @property
    def duration(self) -> float:
        return 2.0 * self.time + self.dwell if self.back else self.time

    def at(self, t: float) -> tuple[float, float]:
        if self.time <= 0.0:
            return self.offset + self.amplitude, 0.0
        if self.back and t > self.time + 0.5 * self.dwell:
            part, slope = blend((self.duration - t) / self.time)
            return self.offset + self.amplitude * part, -self.amplitude * slope / self.time
        part, slope = blend(t / self.time)
        return self.offset + self.amplitude * part, self.amplitude * slope / self.time
