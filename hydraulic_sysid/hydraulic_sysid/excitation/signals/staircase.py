"""Staircase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import integer, number
from hydraulic_sysid.excitation.signals._base import Signal, amplitude


@dataclass(frozen=True)
class Staircase(Signal):
    """From 0 up to +A in `stairs` equal stairs, down to −A and back to 0, each level held for `hold`.

    The levels sum to zero, so that an integrating plant ends where it began.
    """

    amplitude: float = amplitude("height of the highest stair")
    hold: float = number("s", "how long each level stands", above=0.0, maximum=3600.0)
    stairs: int = integer("from zero to the highest one", 4, minimum=1, maximum=1000)

    def levels(self) -> Array:
        """The levels [V] in their order, (4·stairs,)."""
        up = np.arange(1, self.stairs + 1)
        down = np.arange(self.stairs - 1, -self.stairs - 1, -1)
        back = np.arange(-self.stairs + 1, 1)
        return self.amplitude * np.concatenate((up, down, back)) / self.stairs

    @property
    def length(self) -> float:
        return 4.0 * self.stairs * self.hold

    @property
    def highest_frequency(self) -> float:
        return 1.0 / self.hold  # a level must last for two samples at least

    def sample(self, t: Array) -> Array:
        slack = 1e-9  # a sample that falls on a stair belongs to the new level, whatever the rounding
        levels = self.levels()
        return levels[np.floor(np.asarray(t) / self.hold + slack).astype(int) % levels.size]
