"""Output-error fit of a continuous-time model: everything but the denominator is linear, and is solved for.

    minimise over α:  ‖y − Φ(α)·θ̂(α)‖²,   θ̂(α) = Φ(α)⁺·y,   Φ = [σᵏ/α·u, 1/α·1, free responses]

by variable projection (`estimation.projection`) and Levenberg–Marquardt steps. The initial state of every experiment is
among the linear unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.levenberg_marquardt import Exact, NormalEquations
from hydraulic_sysid.estimation.parameters import Parameters
from hydraulic_sysid.estimation.projection import project_out
from hydraulic_sysid.linear.errors import IdentificationError

from .held_filter import Derivatives, Filter

_GROWTH = 3.0  # an unstable mode may grow by e³ over a record: an integrator's estimate, no more


@dataclass(frozen=True)
class Problem:
    """Experiments in scaled time: inputs and outputs ``(N_i,)``, ``step`` = ω₀·T, ``delay`` in samples."""

    inputs: Sequence[Array]
    outputs: Sequence[Array]
    step: float
    poles: int
    zeros: int
    integrator: bool
    constant: bool
    delay: float

    @property
    def target(self) -> Array:
        """All outputs in one."""
        return np.concatenate(self.outputs)

    @property
    def shared(self) -> int:
        """How many of the linear unknowns belong to the model: the others are initial states."""
        return self.zeros + 1 + int(self.constant)

    def full(self, alpha: Array) -> Array:
        """α₁ … α_n with the integrator's 0."""
        return np.append(alpha, 0.0) if self.integrator else alpha

    def allowed(self, alpha: Array) -> bool:
        """Whether no mode grows beyond bounds over the longest record."""
        if not np.isfinite(alpha).all():
            return False
        fastest = np.roots(np.concatenate(([1.0], self.full(alpha)))).real.max()
        return bool(fastest * self.step * max(y.size for y in self.outputs) < _GROWTH)


@dataclass(frozen=True)
class Point(Exact):
    """One denominator with the best of everything else: ``theta`` linear unknowns, ``residual`` y − Φθ."""

    problem: Problem
    alpha: Array
    theta: Array
    residual: Array
    jacobian: Array
    """∂ŷ/∂α with θ held, (N, free poles)."""
    columns: Array

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def parameters(self) -> Parameters:
        """α₁ … α_n, without bounds."""
        return Parameters.unbounded(self.alpha)

    @cached_property
    def normal(self) -> NormalEquations:
        """With the linear unknowns eliminated, residuals in units of their standard deviation."""
        basis, _ = np.linalg.qr(self.columns / np.linalg.norm(self.columns, axis=0))
        projected = -project_out(basis, self.jacobian)
        variance = max(self.cost / self.residual.size, float(np.finfo(float).tiny))
        return NormalEquations(projected.T @ projected / variance, ((projected.T @ self.residual / variance)[None],))

    def moved(self, change: Array) -> Point | None:
        """Another denominator; None where the model would grow beyond bounds."""
        alpha = self.alpha + change
        return evaluate(self.problem, alpha) if self.problem.allowed(alpha) else None


def evaluate(problem: Problem, alpha: Array) -> Point:
    """The best fit with this denominator.

    :raises IdentificationError: the columns are not independent: the input does not excite the order.
    """
    parts = [_experiment(problem, Filter(problem.full(alpha), problem.step, True), u) for u in problem.inputs]
    shared = np.vstack([p[0][:, : problem.shared] for p in parts])
    columns = np.hstack((shared, block_diag(*[p[0][:, problem.shared :] for p in parts])))
    lengths = np.linalg.norm(columns, axis=0)
    if not lengths.all():
        raise IdentificationError("the input is zero throughout: nothing can be identified")
    scaled, *_ = np.linalg.lstsq(columns / lengths, problem.target, rcond=1e-13)
    theta = scaled / lengths
    slopes = []
    for index, (_, sensitivities) in enumerate(parts):
        first = problem.shared + index * problem.poles
        own = np.concatenate((theta[: problem.shared], theta[first : first + problem.poles]))
        slopes.append(np.stack([s @ own for s in sensitivities], axis=1))
    residual = problem.target - columns @ theta
    return Point(problem, alpha, theta, residual, np.vstack(slopes), columns)


def _experiment(problem: Problem, filters: Filter, u: Array) -> tuple[Array, list[Array]]:
    """Columns (N, zeros + 1 [+ 1] + n) of one experiment, and their derivatives by each free α."""
    n, m = problem.poles, problem.zeros
    sources: list[tuple[Derivatives, list[int]]] = [(filters.held(u, problem.delay), list(range(m, -1, -1)))]
    if problem.constant:
        sources.append((filters.held(np.ones(u.size)), [0]))
    sources.append((filters.impulse(u.size), list(range(n - 1, -1, -1))))
    columns = np.hstack([d.single[:, powers] for d, powers in sources])
    free = n - int(problem.integrator)
    sensitivities = [
        np.hstack([-d.double[:, [k + n - j for k in powers]] for d, powers in sources]) for j in range(1, free + 1)
    ]
    return columns, sensitivities
