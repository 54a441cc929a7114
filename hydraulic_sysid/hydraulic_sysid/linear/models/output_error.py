"""Output-error fit of a continuous-time model: everything but the denominator is linear, and is solved for.

    minimise over α:  ‖y − Φ(α)·θ̂(α)‖²,   θ̂(α) = Φ(α)⁺·y,   Φ = [σᵏ/α·u, 1/α·1, free responses]

by damped Gauss–Newton steps with the projected Jacobian of [2] (variable projection [1]). The initial state of every
experiment is among the linear unknowns.

[1] G. Golub, V. Pereyra, *SIAM J. Numer. Anal.* 10 (1973) 413–432.
[2] L. Kaufman, *BIT* 15 (1975) 49–57.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from hydraulic_sim.arrays import Array
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
class Point:
    """One denominator with the best of everything else: ``theta`` linear unknowns, ``residual`` y − Φθ."""

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
    return Point(alpha, theta, residual, np.vstack(slopes), columns)


def refine(problem: Problem, start: Point, steps: int = 60, tolerance: float = 1e-9) -> tuple[Point, bool]:
    """Damped Gauss–Newton from ``start``; the best point found and whether it has settled."""
    best, damping = start, 1e-3
    for _ in range(steps):
        basis, _ = np.linalg.qr(best.columns / np.linalg.norm(best.columns, axis=0))
        projected = best.jacobian - basis @ (basis.T @ best.jacobian)
        normal, gradient = projected.T @ projected, projected.T @ best.residual
        better = None
        while better is None and damping < 1e9:
            move = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
            expected = float(gradient @ move)
            if expected <= tolerance * best.cost:
                return best, True
            candidate = best.alpha + move
            point = evaluate(problem, candidate) if problem.allowed(candidate) else None
            if point is not None and point.cost < best.cost:
                better, damping = point, max(0.1 * damping, 1e-12)
            else:
                damping *= 10.0
        if better is None:
            return best, True  # no step, however short, makes it better
        best = better
    return best, False


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
        np.hstack([-_doubled(d, [k + n - j for k in powers]) for d, powers in sources]) for j in range(1, free + 1)
    ]
    return columns, sensitivities


def _doubled(d: Derivatives, powers: list[int]) -> Array:
    """σᵏ/α²·v for each power."""
    assert d.double is not None
    return d.double[:, powers]
