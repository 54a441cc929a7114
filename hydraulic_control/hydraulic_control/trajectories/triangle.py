"""A triangle whose corners the acceleration limit rounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from hydraulic_control.errors import ControlError

from ._base import Limits


@dataclass(frozen=True)
class Triangle:
    """``amplitude`` [m] around ``offset`` [m] at ``frequency`` [Hz] for ``cycles``: constant speed between corners of
    constant ``acceleration`` [m/s²]. It begins and ends at rest, at ``offset − amplitude``."""

    offset: float
    amplitude: float
    frequency: float
    cycles: int
    acceleration: float
    jumps: ClassVar[bool] = False

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], limits: Limits) -> Triangle:
        """See `make`. Raises `ControlError` where the acceleration cannot turn it round in time."""
        made = cls(
            settings["offset"], settings["amplitude"], settings["frequency"], settings["cycles"], limits.acceleration
        )
        if 16.0 * abs(made.amplitude) * made.frequency**2 > limits.acceleration / 2.0:
            needed = 32.0 * abs(made.amplitude) * made.frequency**2
            raise ControlError(
                f"triangle: {made.amplitude:g} m at {made.frequency:g} Hz needs {needed:.4g} m/s²; allowed are "
                f"{limits.acceleration:.4g} m/s²"
            )
        return made

    @property
    def _corner(self) -> tuple[float, float]:
        """Speed [m/s] between the corners and the time [s] from a point of rest to it.

        Half a period T/2 covers 2A: v·(T/2 − v/a) = 2A, the smaller root.
        """
        half, a = 0.5 / self.frequency, self.acceleration
        speed = 0.5 * a * (half - math.sqrt(half**2 - 8.0 * abs(self.amplitude) / a))
        return speed, speed / a

    @property
    def duration(self) -> float:
        """Seconds until it rests for good."""
        return self.cycles / self.frequency

    def at(self, t: float) -> tuple[float, float]:
        """Position [m] and velocity [m/s]."""
        speed, corner = self._corner
        sign = math.copysign(1.0, self.amplitude)
        low = self.offset - self.amplitude
        if not 0.0 <= t < self.duration:
            return low, 0.0
        half = 0.5 / self.frequency
        phase = math.fmod(t, 2.0 * half)
        back = phase >= half
        now = 2.0 * half - phase if back else phase
        left = half - now
        if now < corner:
            way, rate = 0.5 * self.acceleration * now**2, self.acceleration * now
        elif left < corner:
            way, rate = 2.0 * abs(self.amplitude) - 0.5 * self.acceleration * left**2, self.acceleration * left
        else:
            way, rate = speed * (now - 0.5 * corner), speed
        return low + sign * way, sign * (-rate if back else rate)
