"""Levenberg–Marquardt within bounds, for whatever is fitted by least squares.

Every step is damped until the sum of squares falls (Moré, Lecture Notes in Mathematics 630 (1978) 105–116). A point of
a fit is a value: it knows its cost and its normal equations, and where a step leads; nothing is moved back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, Protocol, TypeVar, cast

import numpy as np
from scipy.optimize import lsq_linear

from hydraulic_sim.arrays import Array, Index

from .covariance import inverse, sandwich
from .parameters import Parameters

_FOLLOWED = (0.7, 1.4)  # gain of a step over the predicted one, within which derivatives are carried on to the next
LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-6, 1e-3, 1e4
_UPHILL = 1.0  # standard errors from the optimum at which it is no failure that no step gets any lower


@dataclass(frozen=True)
class NormalEquations:
    """``information`` (P, P) = Σ JᵀJ and ``scores``: Jᵀr of every segment (S, P), one array per record.

    J are the derivatives of the residuals r by the parameters over their scales.
    """

    information: Array
    scores: tuple[Array, ...]
    prior_gradient: Array | float = 0.0
    """(P,) of what is known beforehand; ``information`` has its part in it."""

    @cached_property
    def gradient(self) -> Array:
        """(P,) Σ Jᵀr, and that of the prior."""
        return np.concatenate(self.scores).sum(axis=0) + self.prior_gradient

    def subset(self, chosen: Index) -> NormalEquations:
        """Of the ``chosen`` parameters alone, the others being held."""
        prior = self.prior_gradient if isinstance(self.prior_gradient, float) else self.prior_gradient[chosen]
        scores = tuple(s[:, chosen] for s in self.scores)
        return NormalEquations(self.information[np.ix_(chosen, chosen)], scores, prior)

    def reduction(self, change: Array) -> float:
        """By how much a change (P,) of the parameters lowers the sum of squares, to first order of the residuals."""
        return float(-2.0 * self.gradient @ change - change @ self.information @ change)

    def marginal(self, first: int) -> NormalEquations:
        """Of the other parameters, the ``first`` ones being eliminated."""
        own, cross = self.information[:first, :first], self.information[:first, first:]
        solved = np.linalg.pinv(own, rcond=1e-12, hermitian=True) @ cross
        gradient = self.gradient[first:] - solved.T @ self.gradient[:first]
        return NormalEquations(self.information[first:, first:] - cross.T @ solved, (gradient[None],))


P = TypeVar("P", bound="Point")


class Point(Protocol):
    """Where a fit stands."""

    @property
    def parameters(self) -> Parameters:
        """Those that are fitted, at their values."""

    @property
    def cost(self) -> float:
        """Sum of squares."""

    @property
    def normal(self) -> NormalEquations | None:
        """None where the model cannot be differentiated."""

    @property
    def exact(self) -> bool:
        """Whether the normal equations are those of this point, not derived from those of the one before."""

    def moved(self, change: Array) -> Point | None:
        """The point a change (P,) of the parameters away, in units of their scales; None where it does not exist."""

    def made_exact(self) -> Point:
        """The same point with normal equations of its own."""


class Exact:
    """What points have whose normal equations are always their own."""

    exact = True

    def made_exact(self: P) -> P:
        """This point."""
        return self


@dataclass(frozen=True)
class Minimum(Generic[P]):
    """Where a fit ended, after how many steps, and whether it settled there."""

    point: P
    converged: bool
    iterations: int


def minimise(
    point: P,
    most_steps: int,
    least_gain: float,
    tolerance: float = 0.0,
    accepted: Callable[[int, P], P] = lambda number, point: point,
) -> Minimum[P]:
    """The minimum near ``point``.

    It is found when a step lowers the cost by less than ``least_gain`` of it, or when the next step would be shorter
    than ``tolerance`` standard errors. ``accepted`` sees every step and may hand back another point (whose residuals
    are weighed otherwise) to go on from. Where a step gained what was predicted the point may have derived its normal
    equations from those before; no fit ends by such alone, and steps from there are not counted.
    """
    damping, number = _FIRST_DAMPING, 0
    while number < most_steps or not point.exact:
        number += point.exact
        normal = point.normal
        if normal is None:
            return Minimum(point, False, number - 1)
        better: P | None = None
        change = normal.gradient
        while better is None and damping <= _MOST_DAMPING:
            change = bounded_step(normal, point.parameters, damping)
            tried = point.moved(change)
            if tried is not None and tried.cost < point.cost:
                better = _as(point, tried)
            elif not point.exact:
                break
            else:
                damping *= 8.0
        if better is None:
            if not point.exact:
                point = _as(point, point.made_exact())
                continue
            return Minimum(point, not tolerance or _ahead(normal, point.parameters) < _UPHILL, number)
        damping = max(damping / 5.0, LEAST_DAMPING)
        gained, known = point.cost - better.cost, point.exact
        done = gained < least_gain * point.cost
        if done or not _FOLLOWED[0] < gained / max(normal.reduction(change), 1e-300) < _FOLLOWED[1]:
            better = _as(better, better.made_exact())
        point = accepted(number, better)
        if point is not better:
            continue
        if done and known:
            return Minimum(point, True, number)
        if tolerance and _ahead(point.normal, point.parameters) < tolerance:
            if point.exact:
                return Minimum(point, True, number)
            point = _as(point, point.made_exact())
    return Minimum(point, False, number)


def _as(point: P, other: Point) -> P:
    """Another point of the same fit."""
    return cast(P, other)


def bounded_step(normal: NormalEquations, parameters: Parameters, damping: float = 1e-9) -> Array:
    """The damped step (P,), in units of the parameters' scales, that stays within their bounds."""
    if not len(parameters):
        return np.zeros(0)
    diagonal = np.diag(normal.information)
    diagonal = np.maximum(diagonal, 1e-12 * max(float(diagonal.max()), 1.0))
    root = np.linalg.cholesky(normal.information + np.diag(damping * diagonal))
    low, high = parameters.reach
    high = np.where(high - low < 1e-12, low + 1e-12, high)
    # The active-set method ends exactly at a bound, an interior-point one only near it.
    target = -np.linalg.solve(root, normal.gradient)
    found = lsq_linear(root.T, target, bounds=(np.minimum(low, 0.0), np.maximum(high, 0.0)), method="bvls")
    return np.clip(found.x, low, high)


def _ahead(normal: NormalEquations | None, parameters: Parameters) -> float:
    """The step that would come next, in standard errors of the parameter that it moves furthest."""
    if normal is None or not len(parameters):
        return 0.0
    change = bounded_step(normal, parameters, LEAST_DAMPING)
    bread = inverse(normal.information)
    variance = np.diag(sandwich(bread, np.concatenate(normal.scores))) + np.diag(bread)
    return float(np.max(np.abs(change) / np.sqrt(np.maximum(variance, 1e-300))))
