"""Cross-validated least squares of whitened balances on regressors, from normal equations summed per fold.

The coefficients of the first regressors, those of the model's free parameters, stay within bounds. Half-second blocks
are left out in turn, in four folds: a regressor counts as far as it holds on data that did not make it, which charges a
subsystem for its number of regressors, the more the larger and the slower the error is that it cannot explain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import lsq_linear

from hydraulic_sim.arrays import Array, Index

FOLDS = 4
BLOCK_SECONDS = 0.5
RIDGES = (1e-6, 1e-4, 1e-2, 1e-1, 1.0, 10.0)
"""Shrinkage of regressors that are tried, of their power; the best one counts."""
_FIRM = 1e-6  # of parameters and of regressors that were taken before
_SEEN = 0.1  # part of a regressor's power outside the fold left out, from which it is fitted


@dataclass(frozen=True)
class NormalEquations:
    """Sums of products of the regressors (K) and the balances, per fold.

    ``gram`` (FOLDS, K, K), ``cross`` (FOLDS, K), ``square`` (FOLDS,), ``count`` (FOLDS,) samples of all balances.
    """

    gram: Array
    cross: Array
    square: Array
    count: Array

    @classmethod
    def of(cls, regressors: Array, balances: Array, rate: float) -> NormalEquations:
        """From whitened regressors ``(K, B, m)`` and balances ``(B, m)`` at ``rate`` samples per second."""
        size, _, length = regressors.shape
        fold = (np.arange(length) // max(1, int(round(BLOCK_SECONDS * rate)))) % FOLDS
        gram, cross = np.empty((FOLDS, size, size)), np.empty((FOLDS, size))
        square, count = np.empty(FOLDS), np.empty(FOLDS)
        for k in range(FOLDS):
            part = np.ascontiguousarray(regressors[:, :, fold == k]).reshape(size, -1)
            own = balances[:, fold == k].reshape(-1)
            gram[k], cross[k], square[k], count[k] = part @ part.T, part @ own, own @ own, own.size
        return cls(gram, cross, square, count)

    def __add__(self, other: NormalEquations) -> NormalEquations:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return NormalEquations(*(mine + theirs for mine, theirs in pairs))

    def left(self, taken: Index, tried: Index, low: Array, high: Array) -> float:
        """Sum of squares that regressors leave on the folds that they were not fitted to.

        The first regressors of all, as many as there are bounds ``low`` … ``high``, always take part; ``taken`` and
        ``tried`` are others, of which those ``tried`` are shrunk as suits them best.
        """
        bounded = low.size
        own = np.concatenate((np.arange(bounded), taken, tried))
        if own.size == 0:
            return float(self.square.sum())
        grams, crosses = self.gram[:, own][:, :, own], self.cross[:, own]
        whole, all_cross = grams.sum(axis=0), crosses.sum(axis=0)
        firm = np.full(own.size, _FIRM)
        shrunk = np.concatenate((np.zeros(own.size - tried.size), np.ones(tried.size)))
        ridges = RIDGES if tried.size else RIDGES[:1]
        totals = np.full(len(ridges), float(self.square.sum()))
        for k in range(FOLDS):
            train = whole - grams[k]
            # A regressor that hardly any but the fold left out has seen cannot be judged: it gets no weight.
            seen = np.diag(train) > _SEEN * np.diag(whole)
            scale = np.sqrt(np.where(seen, np.diag(whole), np.inf))
            train /= np.outer(scale, scale)
            target = (all_cross - crosses[k]) / scale
            limits = _times(low, scale[:bounded]), _times(high, scale[:bounded])
            for i, ridge in enumerate(ridges):
                damped = train + np.diag(firm + ridge * shrunk)
                fitted = _bounded_fit(damped, target, bounded, *limits) / scale
                totals[i] += fitted @ (grams[k] @ fitted) - 2.0 * fitted @ crosses[k]
        return float(totals.min())


def _times(bound: Array, scale: Array) -> Array:
    """Bounds in units of the scaled regressors; one without any power may do what it likes."""
    return np.where(np.isfinite(scale), bound * np.where(np.isfinite(scale), scale, 1.0), np.sign(bound))


def _bounded_fit(gram: Array, cross: Array, bounded: int, low: Array, high: Array) -> Array:
    """Minimum of ½·cᵀ·G·c − cᵀ·b with the first ``bounded`` of c within ``low`` … ``high``."""
    if bounded == 0:
        return cho_solve(cho_factor(gram), cross)
    if bounded == len(gram):
        return _boxed(gram, cross, low, high)
    rest = cho_factor(gram[bounded:, bounded:])
    link = gram[bounded:, :bounded]
    back, alone = cho_solve(rest, link), cho_solve(rest, cross[bounded:])
    reduced = gram[:bounded, :bounded] - link.T @ back
    first = _boxed(reduced, cross[:bounded] - link.T @ alone, low, high)
    return np.concatenate((first, alone - back @ first))


def _boxed(gram: Array, cross: Array, low: Array, high: Array) -> Array:
    """The same with every coefficient bounded: those beyond are put to their bounds until none is.

    That is the solution if at every bound the sum of squares falls outwards; otherwise an active-set method finds it.
    """
    found, held = np.zeros(cross.size), np.zeros(cross.size, dtype=bool)
    while True:
        free = ~held
        if free.any():
            rest = cross[free] - gram[np.ix_(free, held)] @ found[held]
            found[free] = np.linalg.solve(gram[np.ix_(free, free)], rest)
        beyond = free & ((found < low) | (found > high))
        if not beyond.any():
            break
        held |= beyond
        found[held] = np.clip(found[held], low[held], high[held])
    slope = cross - gram @ found
    if np.all(slope[held] * np.where(found[held] >= high[held], 1.0, -1.0) >= 0.0):
        return found
    root = np.linalg.cholesky(0.5 * (gram + gram.T))
    return lsq_linear(root.T, np.linalg.solve(root, cross), bounds=(low, high), method="bvls").x
