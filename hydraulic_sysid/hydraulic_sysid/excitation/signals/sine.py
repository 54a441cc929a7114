"""One sine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import number
from hydraulic_sysid.excitation.signals._base import Wave, amplitude


@dataclass(frozen=True)
class Sine(Wave):
    """u(t) = A·sin(2π·f·t + φ): a single frequency, so that all others in the response are distortion."""

    amplitude: float = amplitude("peak of the sine")
    frequency: float = number("Hz", "how often it repeats", above=0.0, maximum=1000.0)
    phase: float = number("rad", "phase at the start", 0.0, minimum=-2 * np.pi, maximum=2 * np.pi)

    def sample(self, t: Array) -> Array:
        return self.amplitude * np.sin(2 * np.pi * self.frequency * np.asarray(t) + self.phase)
