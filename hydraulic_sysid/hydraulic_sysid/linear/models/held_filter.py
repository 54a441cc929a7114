"""Exact responses of 1/α(σ) and 1/α²(σ), with all their derivatives, to a held input, a step and an initial state.

Everything that a continuous-time fit needs is a sum of these: σᵏ/α·u and the initial states' modes are the columns
in which the model is linear, σᵏ/α²·u are those of its sensitivities to the denominator. Time is scaled,
σ = p/ω₀ with p = d/dt, which keeps coefficients and states of order one.

Exact for an input that is held over each sample (as the plant holds its drive), with a dead time of any length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.resampling import delayed

from .state_recursion import propagate


@dataclass(frozen=True)
class Derivatives:
    """``single`` (N, n+1): σᵏ/α·v, k = 0 … n. ``double`` (N, 2n): σᵏ/α²·v, k = 0 … 2n−1; empty where not squared."""

    single: Array
    double: Array


class Filter:
    """1/α(σ) for one monic denominator ``alpha`` (n,) = α₁ … α_n, sampled every ``step`` = ω₀·T."""

    def __init__(self, alpha: Array, step: float, squared: bool = False) -> None:
        n = alpha.size
        self.alpha, self.step, self.squared = alpha, step, squared
        companion = np.eye(n, k=1)
        companion[-1] = -alpha[::-1]
        if not squared:
            self.a, self.b = companion, np.eye(n)[:, -1]
            return
        # The second 1/α is driven by the first one's output: better scaled than the companion form of α².
        self.a = np.zeros((2 * n, 2 * n))
        self.a[:n, :n] = self.a[n:, n:] = companion
        self.a[2 * n - 1, 0] = 1.0
        self.b = np.eye(2 * n)[:, n - 1]

    def held(self, values: Array, delay: float = 0.0) -> Derivatives:
        """Response from rest to ``values`` (N,), each held over its sample, ``delay`` ≥ 0 samples later.

        What a dead time brings from before the record is not known: the first value stands for it.
        """
        whole = int(np.floor(delay + 1e-9))
        part = max(delay - whole, 0.0)
        early, late = delayed(values, whole), delayed(values, whole + 1)
        first, second = self._integral(1.0 - part), self._integral(part)
        # The older value acts over the first ``part`` of the sample and has then the rest of it to decay.
        aged = expm(self.a * self.step * (1.0 - part)) @ second
        forcing = np.outer(early, first)
        if part > 0.0:
            forcing += np.outer(late, aged)
        return self._complete(propagate(self._transition, forcing, np.zeros(self.b.size)), early)

    def ramped(self, values: Array) -> Derivatives:
        """Response from rest to ``values`` (N,) joined by straight lines (a measured output between its samples)."""
        size = self.b.size
        block = np.zeros((size + 2, size + 2))
        block[:size, :size] = self.a * self.step
        block[:size, size] = self.b * self.step
        block[size, size + 1] = 1.0
        power = expm(block)
        constant, slope = power[:size, size], power[:size, size + 1]
        following = np.append(values[1:], values[-1])
        forcing = np.outer(values, constant) + np.outer(following - values, slope)
        return self._complete(propagate(power[:size, :size].copy(), forcing, np.zeros(size)), values)

    def impulse(self, count: int) -> Derivatives:
        """Free response (N,) of 1/α: that of the initial state in which only the highest derivative is 1."""
        nothing = np.zeros(count)
        return self._complete(propagate(self._transition, np.zeros((count, self.b.size)), self.b.copy()), nothing)

    @property
    def _transition(self) -> Array:
        return np.ascontiguousarray(expm(self.a * self.step))

    def _integral(self, share: float) -> Array:
        """∫₀^{share·step} e^{Aτ}·b dτ."""
        size = self.b.size
        block = np.zeros((size + 1, size + 1))
        block[:size, :size] = self.a
        block[:size, size] = self.b
        return expm(block * self.step * share)[:size, size]

    def _complete(self, states: Array, source: Array) -> Derivatives:
        """Add the derivatives that are not states, from α·(1/α·v) = v."""
        n = self.alpha.size
        lower = self.alpha[::-1]
        single = np.column_stack((states[:, :n], source - states[:, :n] @ lower))
        if not self.squared:
            return Derivatives(single, np.empty((len(states), 0)))
        double = np.empty((len(states), 2 * n))
        double[:, :n] = states[:, n:]
        for k in range(n):
            double[:, n + k] = single[:, k] - double[:, k : n + k] @ lower
        return Derivatives(single, double)
