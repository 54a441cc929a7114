"""Autoregression of a simulation error: what turns a free run into a one-step prediction.

D(q)·v(t) = e(t), D(q) = 1 + d₁·q⁻¹ + … + d_k·q⁻ᵏ, by least squares; the order is the one of least AIC.
L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999, sections 4.2 and 16.4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hydraulic_sim.arrays import Array

LONGEST = 12


def autoregression(errors: Sequence[Array], order: int) -> Array:
    """Coefficients ``(order,)`` d₁ … of the autoregression of the experiments' errors ``(N_i,)``."""
    d, *_ = np.linalg.lstsq(*_regression(errors, order), rcond=None)
    return np.asarray(d, dtype=float)


def fit_noise(errors: Sequence[Array], longest: int = LONGEST) -> tuple[Array, float]:
    """Coefficients ``(k,)`` d₁ … d_k, 0 ≤ k ≤ ``longest``, and the mean squared prediction error that they leave.

    ``errors`` are the simulation errors ``(N_i,)`` of the experiments. All orders are compared on the same samples.
    """
    longest = max(0, min(longest, (min(v.size for v in errors) - 1) // 10))
    past, target = _regression(errors, longest)
    best: Array = np.empty(0)
    least, loss = np.inf, float(np.mean(target**2))
    if loss == 0.0:
        return best, 0.0
    for order in range(longest + 1):
        d: Array = np.asarray(np.linalg.lstsq(past[:, :order], target, rcond=None)[0], dtype=float)
        left = float(np.mean((target - past[:, :order] @ d) ** 2))
        criterion = target.size * np.log(max(left, np.finfo(float).tiny)) + 2.0 * order
        if criterion < least:
            best, least, loss = d, criterion, left
    return best, loss


def _regression(errors: Sequence[Array], order: int) -> tuple[Array, Array]:
    """Past values with the sign of the equation (M, order), and the values themselves (M,)."""
    past = [
        np.stack([-v[order - k : v.size - k] for k in range(1, order + 1)], axis=1) if order else np.empty((v.size, 0))
        for v in errors
    ]
    return np.vstack(past), np.concatenate([v[order:] for v in errors])
