"""What stands between a true quantity and the number a bench reports: white noise and a resolution."""

from __future__ import annotations

import math

import numpy as np

_BLOCK = 4096


class Sensor:
    """One channel: adds white noise of standard deviation `noise`, then rounds to multiples of `resolution`.

    Both in the unit of the quantity; 0 switches them off.
    """

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self.noise = 0.0
        self.resolution = 0.0
        self._generator = np.random.default_rng(seed)
        self._draws: list[float] = []

    def __call__(self, value: float) -> float:
        """The reading of `value`."""
        if self.noise > 0.0:
            # Drawing one number costs as much as the plant's step; a block costs next to nothing per number.
            if not self._draws:
                self._draws = self._generator.standard_normal(_BLOCK).tolist()
            value += self.noise * self._draws.pop()
        if self.resolution > 0.0 and math.isfinite(value):
            value = round(value / self.resolution) * self.resolution
        return value
