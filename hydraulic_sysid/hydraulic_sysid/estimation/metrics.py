"""Figures of merit for a predicted signal against a measured one.

All functions take arrays of equal shape ``(N,)`` in any one unit and return a float. They raise
:class:`ValueError` for unequal or empty shapes and for values that are not finite, because a silent NaN in a
table of errors is worse than a stop.

References ----------
[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_sim.arrays import Array


def _pair(measured: ArrayLike, predicted: ArrayLike) -> tuple[Array, Array]:
    y, p = np.asarray(measured, dtype=float), np.asarray(predicted, dtype=float)
    if y.shape != p.shape or y.ndim != 1 or y.size == 0:
        raise ValueError(f"measured {y.shape} and predicted {p.shape} must be equal, one-dimensional and not empty")
    if not (np.isfinite(y).all() and np.isfinite(p).all()):
        raise ValueError("measured and predicted values must be finite")
    return y, p


def mse(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Mean squared error Σ(y − ŷ)²/N, in the square of the signal's unit."""
    y, p = _pair(measured, predicted)
    return float(np.mean((y - p) ** 2))


def rmse(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Root mean squared error √(Σ(y − ŷ)²/N), in the signal's unit."""
    return float(np.sqrt(mse(measured, predicted)))


def nrmse(measured: ArrayLike, predicted: ArrayLike) -> float:
    """‖y − ŷ‖ / ‖y − ȳ‖: 0 is perfect, 1 is no better than the mean of the measurement.

    A measurement that does not move has no such figure: NaN.
    """
    y, p = _pair(measured, predicted)
    spread = float(np.linalg.norm(y - y.mean()))
    return float(np.linalg.norm(y - p)) / spread if spread > 0.0 else float("nan")


def best_fit(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Best fit 100·(1 − ‖y − ŷ‖/‖y − ȳ‖) in percent, the figure that MATLAB's ``compare`` prints.

    100 is perfect, 0 is no better than the mean of the measurement, and there is no lower bound.
    """
    return 100.0 * (1.0 - nrmse(measured, predicted))


def r_squared(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Coefficient of determination 1 − Σ(y − ŷ)²/Σ(y − ȳ)²."""
    return 1.0 - nrmse(measured, predicted) ** 2


def fpe(loss: float, parameters: int, samples: int) -> float:
    """Akaike's final prediction error V·(1 + d/N)/(1 − d/N), [1] eq. (16.25).

    ``loss`` V is the mean squared one-step prediction error over the ``samples`` N that estimated the
    ``parameters`` d. The figure is what the same model is expected to reach on fresh data, so it stands
    beside the mean squared error measured there.

    :raises ValueError: if there are not more samples than parameters.
    """
    if samples <= parameters:
        raise ValueError(f"final prediction error: {samples} samples must be more than {parameters} parameters")
    share = parameters / samples
    return loss * (1.0 + share) / (1.0 - share)


def autocorrelation(residual: ArrayLike, lags: int) -> Array:
    """Normalised autocorrelation of a residual, lags 0 … ``lags`` (1 at lag 0)."""
    e = np.asarray(residual, dtype=float)
    return cross_correlation(e, e, lags)[lags:]


def cross_correlation(signal: ArrayLike, residual: ArrayLike, lags: int) -> Array:
    """Normalised cross-correlation of ``signal(t − τ)`` and ``residual(t)``, lags τ = −``lags`` … ``lags``.

    Of two independent sequences, one of them white, 95 % of the values lie within ±1.96/√N, [1] section 16.6.
    """
    u, e = _pair(signal, residual)
    if not 0 <= lags < u.size:
        raise ValueError(f"lags must be 0 … {u.size - 1}, got {lags}")
    u, e = u - u.mean(), e - e.mean()
    scale = float(np.linalg.norm(u) * np.linalg.norm(e))
    if scale == 0.0:
        raise ValueError("a correlation of a constant signal is not defined")
    n = 1 << int(np.ceil(np.log2(2 * u.size)))
    product = np.fft.irfft(np.fft.rfft(e, n) * np.conj(np.fft.rfft(u, n)), n)
    return np.concatenate((product[n - lags :], product[: lags + 1])) / scale if lags else product[:1] / scale
