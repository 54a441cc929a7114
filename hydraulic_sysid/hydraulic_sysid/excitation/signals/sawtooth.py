"""Sawtooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import number
from hydraulic_sysid.excitation.signals._base import Wave, amplitude


@dataclass(frozen=True)
class Sawtooth(Wave):
    """Rises evenly from 0 to +A, falls at once to −A and rises to 0 again: every harmonic, even and odd."""

    amplitude: float = amplitude("peak of the sawtooth")
    frequency: float = number("Hz", "how often it repeats", above=0.0, maximum=500.0)

    def sample(self, t: Array) -> Array:
        slack = 1e-9  # a sample that falls on the jump comes after it, whatever the rounding
        turn = np.mod(np.asarray(t) * self.frequency + 0.5 + slack, 1.0)
        return self.amplitude * (2.0 * turn - 1.0)
