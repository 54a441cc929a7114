"""A sine that swells."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ._base import Profile
from .minimum_jerk import blend


@dataclass(frozen=True)
class Sine(Profile):
    """``amplitude`` [m] around ``offset`` [m] at ``frequency`` [Hz] for ``cycles``.

    It swells and fades over one more cycle each, so that it begins and ends at rest.
    """

    frequency: float
    cycles: int

    @property
    def duration(self) -> float:
        return (self.cycles + 2) / self.frequency

    def at(self, t: float) -> tuple[float, float]:
        t = min(max(t, 0.0), self.duration)
        rising, slope = blend(t * self.frequency)
        if t * self.frequency > self.cycles + 1:
            rising, slope = blend((self.duration - t) * self.frequency)
            slope = -slope
        omega = 2.0 * math.pi * self.frequency
        wave, turn = math.sin(omega * t), math.cos(omega * t)
        velocity = self.amplitude * (rising * omega * turn + slope * self.frequency * wave)
        return self.offset + self.amplitude * rising * wave, velocity
