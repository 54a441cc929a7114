"""Laws of one variable that a proposed effect may have: a spline, or one of a few short laws.

Each is linear in its coefficients (parameters that are nothing at 0) and may have shape parameters besides. What a law
is worth follows from the normal equations of a curve on fine knots alone, without another simulation. The law of the
least Bayesian information criterion is taken (Schwarz, Ann. Statist. 6 (1978) 461-464), so that a short law stands
where it explains as much as the spline.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations

KNOTS = (3, 5, 9, 17)
"""How many a spline may have."""
_RIDGE = 1e-10  # of the information of a coefficient, …
_FIRMER = tuple(10.0**n for n in range(-9, -2))  # … and larger ones that are tried for a spline
_ROUGHNESS = 100.0  # weight of second differences in it, so that knots which nothing visits go on from their neighbours
_GIVEN_AWAY = 1e-3  # share of its reduction that a spline gives for being flat and smooth
FINE, PERIODIC = 33, 257
"""Knots of the curve from which laws are taken, and of one that may be periodic."""
_TRIED = 12  # values of a shape parameter, from which the best are refined
_REFINED = 2
_HARMONICS = (1, 2, 3)
_FEWEST_PERIODS = 2.0

Basis = Callable[[Array, Sequence[float] | Array], Array]


@dataclass(frozen=True)
class Law:
    """A kind of law. ``basis(z, shape)`` gives what its coefficients multiply, (M, Q) at places ``z`` (M,).

    ``equation`` and ``lines`` are its text: for a reader, and as statements that set ``law`` from the variable ``z``;
    ``coefficients`` and ``shapes`` name its parameters: the unit of a coefficient is that of the law over the
    variable's to the power in ``powers``, that of a shape the variable's. ``signed``: it is another law's twin where
    the variable has one sign.
    """

    name: str
    equation: str
    lines: tuple[str, ...]
    coefficients: tuple[str, ...]
    powers: tuple[int, ...]
    shapes: tuple[str, ...]
    basis: Basis
    signed: bool = False
    periodic: bool = False


@dataclass(frozen=True)
class FittedLaw:
    """A law with its ``coefficients`` (Q,) and ``shape``; ``reduction`` of the sum of squares, ``criterion`` BIC.

    ``knots`` (Q,) of a spline.
    """

    law: Law
    coefficients: Array
    shape: tuple[float, ...]
    reduction: float
    criterion: float
    knots: Array | None = None

    def values(self, z: Array) -> Array:
        """At places (M,)."""
        return np.asarray(
            self.law.basis(z, self.shape if self.knots is None else self.knots.tolist()) @ self.coefficients
        )


def _powers(*exponents: tuple[int, bool]) -> Basis:
    def basis(z: Array, _: Sequence[float] | Array) -> Array:
        return np.stack([np.abs(z) ** n * (np.sign(z) if odd else 1.0) for n, odd in exponents], axis=-1)

    return basis


def _hinge(z: Array, shape: Sequence[float] | Array) -> Array:
    return np.maximum(z - shape[0], 0.0)[:, None]


def _falling_hinge(z: Array, shape: Sequence[float] | Array) -> Array:
    return np.maximum(shape[0] - z, 0.0)[:, None]


def _dead_zone(z: Array, shape: Sequence[float] | Array) -> Array:
    return (np.sign(z) * np.maximum(np.abs(z) - shape[0], 0.0))[:, None]


def _bump(z: Array, shape: Sequence[float] | Array) -> Array:
    return np.exp(-(((z - shape[0]) / shape[1]) ** 2))[:, None]


def _approach(z: Array, shape: Sequence[float] | Array) -> Array:
    return (np.sign(z) * (1.0 - np.exp(-np.abs(z) / shape[0])))[:, None]


def _hump(z: Array, shape: Sequence[float] | Array) -> Array:
    return (z / shape[0] * np.exp(1.0 - np.abs(z) / shape[0]))[:, None]


def _waves(z: Array, shape: Sequence[float] | Array, harmonics: int) -> Array:
    turn = 2.0 * np.pi * z[:, None] / shape[0] * np.arange(1, harmonics + 1)
    return np.stack((np.sin(turn), np.cos(turn)), axis=-1).reshape(len(z), -1)


def _periodic(harmonics: int) -> Law:
    names = [f"{which}_{n}" for n in range(1, harmonics + 1) for which in ("sine", "cosine")]
    terms = [
        f"{which}_{n} * math.{which[:3]}({n if n > 1 else ''}{' * ' if n > 1 else ''}turn)"
        for n in range(1, harmonics + 1)
        for which in ("sine", "cosine")
    ]
    return Law(
        "periodic",
        "sum of sine_n*sin(2*pi*n*z/period) + cosine_n*cos(2*pi*n*z/period)",
        ("turn = 2.0 * math.pi * z / period", f"law = {' + '.join(terms)}"),
        tuple(names),
        (0,) * len(names),
        ("period",),
        lambda z, shape: _waves(z, shape, harmonics),
        periodic=True,
    )


SHORT: tuple[Law, ...] = (
    Law("proportional", "slope*z", ("law = slope * z",), ("slope",), (1,), (), _powers((1, True))),
    Law("linear", "slope*|z|", ("law = slope * abs(z)",), ("slope",), (1,), (), _powers((1, False)), signed=True),
    Law("quadratic", "curvature*z^2", ("law = curvature * z * z",), ("curvature",), (2,), (), _powers((2, False))),
    Law("square law", "gain*z*|z|", ("law = gain * z * abs(z)",), ("gain",), (2,), (), _powers((2, True)), signed=True),
    Law("cubic", "gain*z^3", ("law = gain * z * z * z",), ("gain",), (3,), (), _powers((3, True))),
    Law("straight line", "offset + slope*z", ("law = offset + slope * z",), ("offset", "slope"), (0, 1), (),
        _powers((0, False), (1, True))),
    Law("parabola", "offset + slope*z + curvature*z^2", ("law = offset + (slope + curvature * z) * z",),
        ("offset", "slope", "curvature"), (0, 1, 2), (), _powers((0, False), (1, True), (2, False))),
    Law("kink", "slope*max(z - corner, 0)", ("law = slope * max(z - corner, 0.0)",),
        ("slope",), (1,), ("corner",), _hinge),
    Law("kink", "slope*max(corner - z, 0)", ("law = slope * max(corner - z, 0.0)",),
        ("slope",), (1,), ("corner",), _falling_hinge),
    Law("dead zone", "slope*sign(z)*max(|z| - width, 0)",
        ("law = math.copysign(1.0, z) * slope * max(abs(z) - width, 0.0)",),
        ("slope",), (1,), ("width",), _dead_zone, signed=True),
    Law("bump", "height*exp(-((z - centre)/width)^2)",
        ("far = (z - centre) / width", "law = height * math.exp(-far * far)"),
        ("height",), (0,), ("centre", "width"), _bump),
    Law("approach", "height*sign(z)*(1 - exp(-|z|/scale))",
        ("law = math.copysign(1.0, z) * height * (1.0 - math.exp(-abs(z) / scale))",),
        ("height",), (0,), ("scale",), _approach),
    Law("hump", "height*z/peak*exp(1 - |z|/peak)", ("law = height * z / peak * math.exp(1.0 - abs(z) / peak)",),
        ("height",), (0,), ("peak",), _hump),
    *(_periodic(n) for n in _HARMONICS),
)  # fmt: skip


def spline(number: int) -> Law:
    """A linear spline between so many knots, constant beyond them; its shape are the knots."""
    names = tuple(f"height_{i + 1}" for i in range(number))
    return Law(
        "spline",
        "linear spline through the heights, constant beyond",
        (
            f"heights = ({', '.join(names)})",
            "place = (z - FIRST) / STEP",
            f"place = min(place, {number - 1.0!r}) if place > 0.0 else 0.0",
            f"i = min(int(place), {number - 2})",
            "law = heights[i] + (place - i) * (heights[i + 1] - heights[i])",
        ),
        names,
        (0,) * number,
        (),
        _hats,
    )


def _hats(z: Array, knots: Sequence[float] | Array) -> Array:
    return np.stack([np.interp(z, knots, row) for row in np.eye(len(knots))], axis=-1)


@dataclass(frozen=True)
class CurveEquations:
    """The ``normal`` equations of the heights of hat functions at fine ``knots`` (M,), from which laws are taken.

    ``usual``: between these the variable mostly is; a spline has its knots there and is constant beyond, as what is
    visited now and then would bend it. ``total``: sum of squares of so many ``values`` without a curve.
    """

    normal: NormalEquations
    knots: Array
    usual: tuple[float, float]
    total: float
    values: int


def best_law(curve: CurveEquations, short: bool = True) -> FittedLaw | None:
    """The law that explains most for its number of parameters; None where none explains more than they cost.

    :param short: take short laws as well as splines
    """
    tried = _splines(curve) + (_short(curve.normal, curve.knots) if short else [])
    most = max(f.reduction for f in tried)
    left = max(1.0, (curve.total - most) / curve.values)
    judged = [_judged(f, math.log(max(curve.values, 2)) * left) for f in tried]
    best = min(judged, key=lambda f: f.criterion)
    return best if best.criterion < 0.0 else None


def _judged(found: FittedLaw, cost: float) -> FittedLaw:
    number = len(found.coefficients) + len(found.shape)
    return replace(found, criterion=number * cost - found.reduction)


def _splines(curve: CurveEquations) -> list[FittedLaw]:
    found = []
    for number in KNOTS:
        knots: Array = np.linspace(*curve.usual, number, dtype=np.float64)
        values, gained = _smooth(curve.normal, _hats(curve.knots, knots))
        found.append(FittedLaw(spline(number), values, (), gained, 0.0, knots))
    return found


def _short(normal: NormalEquations, knots: Array) -> list[FittedLaw]:
    one_sided = bool(np.all(knots >= 0.0) or np.all(knots <= 0.0))
    found = []
    for law in SHORT:
        if (one_sided and law.signed) or (law.periodic and len(knots) < PERIODIC):
            continue
        grids = [_tried(name, knots) for name in law.shapes]
        starts = (
            np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, len(grids)) if grids else np.zeros((1, 0))
        )
        gains = [_solved(normal, law.basis(knots, s))[1] for s in starts]
        best = np.argsort(gains)[::-1][:_REFINED]
        tried = [_refined(normal, law, knots, starts[i]) for i in best] if grids else [np.zeros(0)]
        for shape in tried:
            values, gained = _solved(normal, law.basis(knots, shape))
            found.append(FittedLaw(law, values, tuple(float(s) for s in shape), gained, 0.0))
    return found


def _tried(name: str, knots: Array) -> np.ndarray:
    """Values of a shape parameter from which a law is fitted."""
    low, high, step = float(knots[0]), float(knots[-1]), float(knots[1] - knots[0])
    reach = high - low
    if name == "period":
        longest, shortest = reach / _FEWEST_PERIODS, 4.0 * step
        return 1.0 / np.arange(1.0 / longest, 1.0 / shortest, 0.2 / reach)
    if name in ("corner", "centre"):
        return np.linspace(low, high, 2 * _TRIED + 1)[1:-1]
    if name == "width" and low >= 0.0:
        return np.geomspace(step, reach, _TRIED)
    return np.geomspace(step, max(abs(low), abs(high)), _TRIED)


def _refined(normal: NormalEquations, law: Law, knots: Array, start: Array) -> Array:
    """Shape parameters near ``start`` that explain most; those that are sizes stay positive."""
    step, reach = float(knots[1] - knots[0]), float(knots[-1] - knots[0])
    scale = np.array([0.02 * s if n == "period" else 0.5 * step if n in ("corner", "centre") else 0.3 * s
                      for n, s in zip(law.shapes, start, strict=True)])  # fmt: skip
    low = np.array([knots[0] if n in ("corner", "centre") else 0.5 * step for n in law.shapes])
    high = np.array([knots[-1] if n in ("corner", "centre") else 2.0 * reach for n in law.shapes])

    def lost(moved: Array) -> float:
        shape = np.clip(start + moved * scale, low, high)
        return -_solved(normal, law.basis(knots, shape.tolist()))[1]

    done = minimize(
        lost, np.zeros(len(start)), method="Nelder-Mead", options={"maxiter": 80 * len(start), "xatol": 1e-3}
    )
    return np.clip(start + done.x * scale, low, high)


def _solved(normal: NormalEquations, basis: Array) -> tuple[Array, float]:
    """Coefficients (Q,) of the columns of ``basis`` (M, Q), and by how much they lower the sum of squares."""
    information, gradient = basis.T @ normal.information @ basis, basis.T @ normal.gradient
    size = float(np.diag(information).max())
    if not size > 0.0:
        return np.zeros(basis.shape[1]), 0.0
    # In units of what each column does, so that coefficients of any unit go together.
    own = np.sqrt(np.maximum(np.diag(information), 1e-12 * size))
    values = -np.linalg.solve(information / np.outer(own, own) + _RIDGE * np.eye(own.size), gradient / own) / own
    return values, _reduction(information, gradient, values)


def _smooth(normal: NormalEquations, basis: Array) -> tuple[Array, float]:
    """As `_solved`, the flattest, smoothest heights that explain as much: free parameters take up parts of a curve."""
    information, gradient = basis.T @ normal.information @ basis, basis.T @ normal.gradient
    size = float(np.diag(information).max())
    if not size > 0.0:
        return np.zeros(basis.shape[1]), 0.0
    bend = np.diff(np.eye(len(information)), 2, axis=0)
    penalty = size * (np.eye(len(information)) + _ROUGHNESS * bend.T @ bend)
    values = -np.linalg.solve(information + _RIDGE * penalty, gradient)
    gained = most = _reduction(information, gradient, values)
    for weight in _FIRMER:
        tried = -np.linalg.solve(information + weight * penalty, gradient)
        reached = _reduction(information, gradient, tried)
        if reached < (1.0 - _GIVEN_AWAY) * most:
            break
        values, gained = tried, reached
    return values, gained


def _reduction(information: Array, gradient: Array, values: Array) -> float:
    return max(float(-2.0 * gradient @ values - values @ information @ values), 0.0)
