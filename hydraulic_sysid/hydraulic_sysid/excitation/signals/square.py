"""Square wave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import number
from hydraulic_sysid.excitation.signals._base import Wave, amplitude


@dataclass(frozen=True)
class Square(Wave):
    """+A for the first half of every period, −A for the second; `shift` begins later in the period.

    A shift of a quarter moves the piston of an integrating plant to both sides of its start.
    """

    amplitude: float = amplitude("height of the square")
    frequency: float = number("Hz", "how often it repeats", above=0.0, maximum=500.0)
    shift: float = number("", "part of a period that is left out at the start", 0.0, minimum=0.0, maximum=1.0)

    def sample(self, t: Array) -> Array:
        slack = 1e-9  # a sample that falls on an edge belongs to the new half, whatever the rounding
        turn = np.mod(np.asarray(t) * self.frequency + self.shift + slack, 1.0)
        return np.where(turn < 0.5, self.amplitude, -self.amplitude)
