"""A triangle whose corners the acceleration limit rounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hydraulic_control.errors import ControlError

from ._base import Profile, ramped


@dataclass(frozen=True)
class Triangle(Profile):
    """``amplitude`` [m] around ``offset`` [m] at ``frequency`` [Hz] for ``cycles``.

    Constant speed between corners of constant ``acceleration`` [m/s²]; it begins and ends at rest, at ``offset −
    amplitude``.

    :raises ControlError: the acceleration cannot turn it round in time.
    """

    frequency: float
    cycles: int
    acceleration: float

    def __post_init__(self) -> None:
        needed = 32.0 * abs(self.amplitude) * self.frequency**2
        if needed > self.acceleration:
            raise ControlError(
                f"triangle: {self.amplitude:g} m at {self.frequency:g} Hz needs {needed:.4g} m/s²; allowed are "
                f"{self.acceleration:.4g} m/s²"
            )

    @property
    def _speed(self) -> float:
        """Speed [m/s] between the corners.

        Half a period T/2 covers 2A: v·(T/2 − v/a) = 2A, the smaller root.
        """
        half, a = 0.5 / self.frequency, self.acceleration
        return 0.5 * a * (half - math.sqrt(half**2 - 8.0 * abs(self.amplitude) / a))

    @property
    def duration(self) -> float:
        return self.cycles / self.frequency

    def at(self, t: float) -> tuple[float, float]:
        sign = math.copysign(1.0, self.amplitude)
        low = self.offset - self.amplitude
        if not 0.0 <= t < self.duration:
            return low, 0.0
        half = 0.5 / self.frequency
        phase = math.fmod(t, 2.0 * half)
        back = phase >= half
        now = 2.0 * half - phase if back else phase
        way, rate = ramped(now, half, 2.0 * abs(self.amplitude), self._speed, self.acceleration)
        return low + sign * way, sign * (-rate if back else rate)
