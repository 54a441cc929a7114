"""The derivative of a measured position: a Savitzky-Golay filter whose length fits noise and motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from hydraulic_sim.arrays import Array

SPANS = (0.008, 0.012, 0.016, 0.02, 0.025, 0.03, 0.04, 0.05, 0.065, 0.08)
"""Lengths in seconds that the derivative filter may have."""
_CUBIC = 3


@dataclass(frozen=True)
class VelocityFilter:
    """Savitzky–Golay derivative (cubic) over ``window`` samples (odd) of ``dt`` seconds."""

    dt: float
    window: int

    @classmethod
    def for_signal(cls, position: Array, dt: float, sigma: float) -> VelocityFilter:
        """The window with the smallest expected squared error of the velocity.

        A long window suppresses noise, a short one follows fast motion. Against the shortest window r, which
        follows best, the error of another one w is estimated without bias as mean (v_w − v_r)² − σ²·|r|² +
        2·σ²·r·w with the filters' weights r, w and the position's noise ``sigma`` (as Mallows' C_p,
        Technometrics 15 (1973) 661–675).
        """
        windows = sorted({max(5, 2 * int(round(span / dt / 2.0)) + 1) for span in SPANS})
        windows = [w for w in windows if 3 * w <= position.size] or windows[:1]
        filters = [cls(dt, w) for w in windows]
        shortest = filters[0]
        reference, weights = shortest(position), shortest.weights
        risks = []
        for candidate in filters:
            inner = slice(candidate.window, -candidate.window)
            gap = float(np.mean((candidate(position) - reference)[inner] ** 2))
            margin = (candidate.window - shortest.window) // 2
            shared = float(weights @ candidate.weights[margin : margin + shortest.window])
            risks.append(gap + sigma**2 * (2.0 * shared - float(weights @ weights)))
        return filters[int(np.argmin(risks))]

    def __call__(self, position: Array) -> Array:
        """Velocity along the last axis; same shape."""
        return savgol_filter(position, self.window, _CUBIC, deriv=1, delta=self.dt, axis=-1)

    @property
    def weights(self) -> Array:
        """``(window,)`` weights of the filter in the middle of a signal."""
        return savgol_coeffs(self.window, _CUBIC, deriv=1, delta=self.dt)

    @property
    def noise_gain(self) -> float:
        """Standard deviation of the velocity over that of white noise on the position, in 1/s."""
        return float(np.linalg.norm(self.weights))

    @property
    def half(self) -> int:
        """Samples that the filter needs on either side."""
        return self.window // 2
