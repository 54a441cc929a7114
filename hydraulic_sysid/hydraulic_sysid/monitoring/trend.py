"""How fast a parameter has changed since an onset, and when it reaches a limit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from hydraulic_sim.arrays import Array

_LEAST = 3


@dataclass(frozen=True)
class Trend:
    """A straight line, ``level`` at ``origin`` and ``slope`` per unit of time, with the covariance (2, 2) of both."""

    origin: float
    level: float
    slope: float
    covariance: np.ndarray
    freedom: int

    @property
    def slope_interval(self) -> tuple[float, float]:
        """95 % interval of the slope."""
        half = float(stats.t.ppf(0.975, self.freedom) * np.sqrt(self.covariance[1, 1]))
        return self.slope - half, self.slope + half

    def at(self, time: float) -> tuple[float, float]:
        """Value of the line at a time, and its standard error."""
        x = np.array([1.0, time - self.origin])
        return float(x @ [self.level, self.slope]), float(np.sqrt(x @ self.covariance @ x))


@dataclass(frozen=True)
class Crossing:
    """When a line reaches a limit: ``time``, and a 95 % interval whose end may be infinite."""

    time: float
    earliest: float
    latest: float


def line(times: Array, values: Array, errors: Array) -> Trend | None:
    """The weighted straight line through values with standard errors; None for fewer than three.

    The residual's scatter counts where it is larger than the errors say.
    """
    if len(times) < _LEAST or np.ptp(times) <= 0.0:
        return None
    weights = 1.0 / np.maximum(errors, 1e-12 * max(float(np.abs(values).max()), 1e-300)) ** 2
    origin = float(weights @ times / weights.sum())
    X = np.column_stack([np.ones(len(times)), times - origin])
    information = X.T @ (weights[:, None] * X)
    level, slope = np.linalg.solve(information, X.T @ (weights * values))
    freedom = len(times) - 2
    left = float(weights @ (values - X @ [level, slope]) ** 2) / freedom
    return Trend(origin, float(level), float(slope), np.linalg.inv(information) * max(left, 1.0), freedom)


def crossing(trend: Trend, limit: float, now: float) -> Crossing | None:
    """When the line reaches ``limit`` after ``now``; None where it does not go there.

    The interval is Fieller's (1954), Journal of the Royal Statistical Society B 16(2): times at which the limit lies
    within the line's 95 % band.
    """
    value, _ = trend.at(now)
    if trend.slope == 0.0 or (limit - value) / trend.slope < 0.0:
        return None
    t2 = float(stats.t.ppf(0.975, trend.freedom)) ** 2
    (a, b), (_, d) = trend.covariance
    off = trend.level - limit
    A, B, C = trend.slope**2 - t2 * d, 2.0 * (trend.slope * off - t2 * b), off**2 - t2 * a
    time = trend.origin - off / trend.slope
    roots = B * B - 4.0 * A * C
    if A <= 0.0 or roots < 0.0:  # the slope may be zero: it may never come
        early = [t for t in (np.roots([A, B, C]).real if roots >= 0.0 and A != 0.0 else []) if t + trend.origin > now]
        return Crossing(time, trend.origin + min(early) if early else now, float("inf"))
    low, high = sorted(((-B - np.sqrt(roots)) / (2.0 * A), (-B + np.sqrt(roots)) / (2.0 * A)))
    return Crossing(time, max(now, trend.origin + low), trend.origin + high)
