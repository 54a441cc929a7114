"""How much of what the balances lack each subsystem can explain.

Least squares of the whitened balances on directions (`directions`), always beside those of the model's free parameters,
so that a wrong parameter is not called a fault of a subsystem. A share counts only as far as it holds on data that did
not make it: half-second blocks are left out in turn (cross-validation, four folds), which also charges a subsystem for
its number of directions. Subsystems are taken in one after the other, each time the one that explains most beside those
taken before: two faults in different places are both found, and what was only a stand-in gets no share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]

PARAMETERS = "parameters"
Bounds = tuple[float, float]
FOLDS = 4
BLOCK_SECONDS = 0.5
_RIDGES = (1e-6, 1e-4, 1e-2, 1e-1, 1.0)
_SEEN = 0.1  # part of a direction's power outside the fold left out, from which it is fitted
_LEAST = 10.0  # gain over ln N from which a subsystem gets a share
_SMALL = 0.1  # and least part of what those before have left
_TOLD = 0.05  # share from which it is said over what it goes
_MOST = 3  # subsystems that get a share


@dataclass(frozen=True)
class Moments:
    """Sums of products of the directions (K) and the balances, per fold.

    ``gram`` (FOLDS, K, K), ``cross`` (FOLDS, K), ``square`` (FOLDS,), ``count`` (FOLDS,) samples of all balances.
    """

    gram: Array
    cross: Array
    square: Array
    count: Array

    @classmethod
    def of(cls, directions: Array, balances: Array, rate: float) -> Moments:
        """From whitened directions ``(K, B, m)`` and balances ``(B, m)`` at ``rate`` samples per second."""
        size, _, length = directions.shape
        fold = (np.arange(length) // max(1, int(round(BLOCK_SECONDS * rate)))) % FOLDS
        gram, cross = np.empty((FOLDS, size, size)), np.empty((FOLDS, size))
        square, count = np.empty(FOLDS), np.empty(FOLDS)
        for k in range(FOLDS):
            part = np.ascontiguousarray(directions[:, :, fold == k]).reshape(size, -1)
            own = balances[:, fold == k].reshape(-1)
            gram[k], cross[k], square[k], count[k] = part @ part.T, part @ own, own @ own, own.size
        return cls(gram, cross, square, count)

    def __add__(self, other: Moments) -> Moments:
        return Moments(
            self.gram + other.gram, self.cross + other.cross, self.square + other.square, self.count + other.count
        )

    def left(self, chosen: NDArray[np.int64], bounded: int, low: Array, high: Array) -> float:
        """Sum of squares that directions ``chosen`` leave on the folds that they were not fitted to.

        The coefficients of the first ``bounded`` directions of all stay within ``low`` … ``high``; ``chosen`` are
        others. These are eliminated first (Schur complement), which leaves a small box-constrained problem.
        """
        own = np.concatenate((np.arange(bounded), chosen))
        if own.size == 0:
            return float(self.square.sum())
        grams, crosses = self.gram[:, own][:, :, own], self.cross[:, own]
        whole, all_cross = grams.sum(axis=0), crosses.sum(axis=0)
        totals = np.full(len(_RIDGES), float(self.square.sum()))
        for k in range(FOLDS):
            train = whole - grams[k]
            # A direction that hardly any but the fold left out has seen cannot be judged: it gets no weight.
            seen = np.diag(train) > _SEEN * np.diag(whole)
            scale = np.sqrt(np.where(seen, np.diag(whole), np.inf))
            train /= np.outer(scale, scale)
            target = (all_cross - crosses[k]) / scale
            limits = _times(low, scale[:bounded]), _times(high, scale[:bounded])
            for i, ridge in enumerate(_RIDGES):
                fitted = _bounded_fit(train + ridge * np.eye(len(train)), target, bounded, *limits) / scale
                totals[i] += fitted @ (grams[k] @ fitted) - 2.0 * fitted @ crosses[k]
        return float(totals.min())


def _times(bound: Array, scale: Array) -> Array:
    """Bounds in units of the scaled directions; one without any power may do what it likes."""
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
    """The same with every coefficient bounded; bounds that do not bind cost nothing."""
    free: Array = np.linalg.solve(gram, cross).astype(np.float64)
    if np.all((free >= low) & (free <= high)):
        return free
    root = np.linalg.cholesky(0.5 * (gram + gram.T))
    return lsq_linear(root.T, np.linalg.solve(root, cross), bounds=(low, high), method="bvls").x


@dataclass(frozen=True)
class Blame:
    """One subsystem: share of the excess that it adds when it is taken in, and the share that it explains alone."""

    subsystem: str
    share: float
    alone: float
    gain: float
    """Fall of the sum of squares on data left out, in units of the noise's variance, beyond the twin's."""
    variables: dict[str, float]
    """Variable → part of this subsystem's gain (alone) that its directions over this variable reach by themselves."""


@dataclass(frozen=True)
class Verdict:
    """Mean square over noise of the model as it is, after its free parameters may move, and after all blame."""

    before: float
    refitted: float
    left: float
    exact: float
    """Of the twin, after the parameters may move: what an exact model shows."""
    ranked: list[Blame]
    count: float


def rank(
    measured: Moments, twin: Moments, subsystems: Sequence[str], variables: Sequence[str], bounds: Sequence[Bounds]
) -> Verdict:
    """Subsystems by what they explain. ``subsystems`` (K,) and ``variables`` (K,) name every direction.

    ``bounds``: how far each parameter (they come first) may still move. The twin is an exact model's record under the
    same noise: what a subsystem explains of it, for directions are made from noisy signals too, is taken off.
    """
    owner, over = np.array(subsystems), np.array(variables)
    index = {n: np.flatnonzero(owner == n) for n in dict.fromkeys(subsystems) if n != PARAMETERS}
    base: NDArray[np.int64] = np.flatnonzero(owner == "")  # none: the parameters always take part
    box = (len(bounds), *np.array(bounds, dtype=float).reshape(-1, 2).T)
    count = float(measured.count.sum())
    refitted, exact = measured.left(base, *box), twin.left(base, *box)
    excess = max(refitted - exact, 1e-9 * count)

    def gain(chosen: NDArray[np.int64], before: float, before_twin: float) -> tuple[float, float, float]:
        after, after_twin = measured.left(chosen, *box), twin.left(chosen, *box)
        return before - after - max(before_twin - after_twin, 0.0), after, after_twin

    alone = {n: gain(np.concatenate((base, i)), refitted, exact) for n, i in index.items()}
    ranked: list[Blame] = []
    taken, now, now_twin, tried = base, refitted, exact, alone
    rest = list(index)
    while rest:
        best = max(tried, key=lambda n: tried[n][0])
        won, after, after_twin = tried[best]
        if won <= max(_LEAST * np.log(count), _SMALL * (now - now_twin)):
            break
        by: dict[str, float] = {}
        for name in dict.fromkeys(over[index[best]].tolist()) if won > _TOLD * excess or not ranked else ():
            mine = np.flatnonzero((owner == best) & (over == name))
            by[name] = max(0.0, gain(np.concatenate((taken, mine)), now, now_twin)[0]) / won
        by = dict(sorted(by.items(), key=lambda item: -item[1]))
        share = min(won / excess, 1.0 - sum(b.share for b in ranked))
        ranked.append(Blame(best, share, alone[best][0] / excess, won, by))
        rest.remove(best)
        taken = np.concatenate((taken, index[best]))
        now, now_twin = after, after_twin
        tried = {n: gain(np.concatenate((taken, index[n])), now, now_twin) for n in rest} if len(ranked) < _MOST else {}
        if not tried:
            break
    for n in sorted(rest, key=lambda n: -alone[n][0]):
        ranked.append(Blame(n, 0.0, alone[n][0] / excess, 0.0, {}))
    left = now + (exact - now_twin)
    before = float(measured.square.sum())
    return Verdict(before / count, refitted / count, left / count, exact / count, ranked, count)
