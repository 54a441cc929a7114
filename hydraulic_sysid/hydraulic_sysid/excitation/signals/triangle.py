"""Triangle wave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import number
from hydraulic_sysid.excitation.signals._base import Wave, amplitude


@dataclass(frozen=True)
class Triangle(Wave):
    """A triangle from 0 up to +A, down to −A and back: the same time at every drive, slowly through null.

    It shows what sits around null: deadband, stiction, underlap, bias.
    """

    amplitude: float = amplitude("peak of the triangle")
    frequency: float = number("Hz", "how often it repeats", above=0.0, maximum=1000.0)

    def sample(self, t: Array) -> Array:
        turn = np.mod(np.asarray(t) * self.frequency + 0.25, 1.0)  # a quarter on, so that it starts at zero, rising
        return self.amplitude * (1.0 - 4.0 * np.abs(turn - 0.5))
