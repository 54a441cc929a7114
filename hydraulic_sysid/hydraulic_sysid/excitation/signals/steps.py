"""Steps and staircases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import number, numbers
from hydraulic_sysid.excitation.signals._base import Signal


@dataclass(frozen=True)
class Steps(Signal):
    """The levels one after the other, each held for `hold`, then over again; rising levels make a staircase."""

    levels: tuple[float, ...] = numbers("V", "the levels in their order", minimum=-DRIVE_LIMIT_V, maximum=DRIVE_LIMIT_V)
    hold: float = number("s", "how long each level stands", above=0.0, maximum=3600.0)

    @property
    def length(self) -> float:
        return self.hold * len(self.levels)

    @property
    def highest_frequency(self) -> float:
        return 1.0 / self.hold  # a level must last for two samples at least

    def sample(self, t: Array) -> Array:
        slack = 1e-9  # a sample that falls on a step belongs to the new level, whatever the rounding
        step = np.floor(np.asarray(t) / self.hold + slack).astype(int)
        return np.array(self.levels)[step % len(self.levels)]
