"""Noise of the balances: how it is decimated, and the filter that makes it white.

A balance at full rate is mostly noise, as it holds second differences of a position. It is smoothed by three running
means and decimated to some 200 samples per second: the cubic spline as a modulating function (Maletinsky 1979, IFAC
Symposium on Identification 5), which acts on every term of a balance alike. What noise is left is coloured, and shared
by the balances. A vector autoregression fitted to it, as a reference run shows it, turns the balances into rows of
independent samples of variance one, which is what least squares, χ² and bounds of correlations ask for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.slower import spline

RATE = 200.0  # per second, of what is kept
ORDER = 10  # of the autoregression: 50 ms, beyond the memory of a second difference at 200 per second
_RIDGE = 1e-9


def decimation_factor(dt: float) -> int:
    """Samples per sample that is kept."""
    return max(1, int(round(1.0 / (RATE * dt))))


def decimate(values: Array, factor: int) -> Array:
    """Smooth ``(…, n)`` by the cubic spline of width 3·factor samples and keep every factor-th: ``(…, m)``."""
    if factor == 1:
        return values
    kernel = spline(factor)
    return sliding_window_view(values, kernel.size, axis=-1)[..., ::factor, :] @ kernel


@dataclass(frozen=True)
class Whitener:
    """``weights`` (order + 1, B, B): e(t) = Σ weights[i]·r(t − i)."""

    weights: Array

    @classmethod
    def of(cls, noise: Array) -> Whitener:
        """From decimated noise ``(B, m)`` of all balances, by least squares."""
        size, count = noise.shape
        spread = noise.std(axis=1)
        scaled = noise / spread[:, None]
        order = min(ORDER, count // (4 * size) - 1)
        past = np.concatenate([scaled[:, order - i : count - i] for i in range(1, order + 1)])
        now = scaled[:, order:]
        moments = past @ past.T
        moments += _RIDGE * np.trace(moments) / len(moments) * np.eye(len(moments))
        forward = np.linalg.solve(moments, past @ now.T).T
        left = now - forward @ past
        inverse = np.linalg.inv(np.linalg.cholesky(left @ left.T / left.shape[1]))
        weights = np.empty((order + 1, size, size))
        weights[0] = inverse
        for i in range(order):
            weights[i + 1] = -inverse @ forward[:, i * size : (i + 1) * size]
        return cls(weights / spread)

    def __call__(self, values: Array, rows: tuple[int, ...] | None = None) -> Array:
        """Whiten decimated ``(…, b, m)`` into ``(…, B, m − order)``; ``rows``: which balances these b are."""
        chosen = self.weights if rows is None else self.weights[:, :, list(rows)]
        order, count = len(chosen) - 1, values.shape[-1]
        out = 0.0
        for i, weight in enumerate(chosen):
            out = out + np.matmul(weight, values[..., order - i : count - i])
        return np.asarray(out)
