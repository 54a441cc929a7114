"""Residual tests: is what a model leaves over white, and does the input have no part in it?

Of a white residual 99 % of the autocorrelations lie within ±2.58/√N. The cross-correlation of an input with a residual
that it has no part in lies within ±2.58·√(P/N), P = Σ r_e(k)·r_u(k): a slow input and a coloured residual agree by
chance more often than white ones. L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall
1999, section 16.6.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import norm

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation import metrics

LEVEL = 0.99
LAGS = 25
SHORTEST = 100
"""Samples from which on a residual's correlations mean something."""


def residual_tests(residual: Array, drive: Array, lags: int = LAGS) -> dict[str, Any] | None:
    """Correlations of a residual ``(N,)`` with itself and with the input, and the bounds of `LEVEL`.

    ``autocorrelation`` of lags 0 … ``lags``, ``cross_correlation`` of lags −``lags`` … ``lags``, ``bound`` and
    ``cross_bound``, and of each the share of lags ``outside`` (0.01 is expected of a perfect model). Positive lags:
    the input came first. None for too few samples, or if residual or input stand still.
    """
    if residual.size < max(SHORTEST, 4 * lags) or not (np.ptp(residual) > 0.0 and np.ptp(drive) > 0.0):
        return None
    own = metrics.autocorrelation(residual, lags)
    cross = metrics.cross_correlation(drive, residual, lags)
    bound = float(norm.ppf(0.5 + 0.5 * LEVEL) / np.sqrt(residual.size))
    cross_bound = bound * float(np.sqrt(_inflation(residual, drive)))
    return {
        "lags": lags,
        "confidence": LEVEL,
        "bound": bound,
        "cross_bound": cross_bound,
        "autocorrelation": own,
        "cross_correlation": cross,
        "outside": {
            "autocorrelation": float(np.mean(np.abs(own[1:]) > bound)),
            "cross_correlation": float(np.mean(np.abs(cross) > cross_bound)),
        },
    }


def _inflation(residual: Array, drive: Array) -> float:
    """P = Σ r_e(k)·r_u(k) over all lags that have enough samples behind them; at least 1/N."""
    longest = residual.size // 4
    e, u = metrics.autocorrelation(residual, longest), metrics.autocorrelation(drive, longest)
    # Bartlett's window: far lags are estimated from few samples and would make the sum negative now and then.
    window = 1.0 - np.arange(longest + 1) / (longest + 1.0)
    return max(float(1.0 + 2.0 * np.sum((window * e * u)[1:])), 1.0 / residual.size)
