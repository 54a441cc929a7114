"""An actuator behind a valve, in whatever units the data have: the smallest model with the physics of an orifice.

    ṗ = q(u)·√(1 − sgn(q)·p/p_S) − b·v − l·p,    v̇ = p − d·v

p is the load pressure (the output), v the motion that takes oil, scaled so that pressure accelerates it by 1. The valve
curve q(u) is piecewise linear, so that asymmetry, saturation and dead zones need no names; the root is that of the
orifice equation with the supply pressure p_S (Merritt 1967, *Hydraulic Control Systems*, ch. 3 and 6). Data without
units or sampling time will do: everything is fitted, by output error, with the initial state of every experiment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.jit import jit
from hydraulic_sysid.linear.models import IdentificationError, TransferFunctionOrder, fit_transfer_function
from hydraulic_sysid.linear.models.experiments import experiments, lengths_agree
from hydraulic_sysid.linear.models.order_selection import information_criteria

KNOTS = (3, 5, 7, 9, 11)
_SUBSTEPS = 4
_FAR = 1e3  # residual, in standard deviations of the output, of a run that has left all bounds
_DYNAMICS = 4  # p_S, b, l, d


@jit
def _run(flow: Array, supply: float, b: float, leak: float, damping: float, start: Array, step: float) -> Array:
    """Pressure ``(N,)`` by Runge–Kutta's method of fourth order, ``_SUBSTEPS`` to a sample; NaN once it diverges."""
    out = np.full(flow.size, np.nan)
    p, v, h = start[0], start[1], step / _SUBSTEPS
    for k in range(flow.size):
        out[k] = p
        sign = 1.0 if flow[k] >= 0.0 else -1.0
        for _ in range(_SUBSTEPS):
            slope_p, slope_v, sum_p, sum_v = 0.0, 0.0, 0.0, 0.0
            for stage in range(4):
                ahead = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                at_p, at_v = p + h * ahead * slope_p, v + h * ahead * slope_v
                drop = 1.0 - sign * at_p / supply
                root = np.sqrt(drop) if drop > 0.0 else -np.sqrt(-drop)
                slope_p, slope_v = flow[k] * root - b * at_v - leak * at_p, at_p - damping * at_v
                weight = 1.0 if stage == 0 or stage == 3 else 2.0
                sum_p, sum_v = sum_p + weight * slope_p, sum_v + weight * slope_v
            p, v = p + h / 6.0 * sum_p, v + h / 6.0 * sum_v
        if not (abs(p) < 1e6 * supply and abs(v) < 1e12):
            break
    return out


@dataclass(frozen=True)
class ValveActuator:
    """A fitted model; time constants are in samples of ``dt`` seconds."""

    dt: float
    knots: Array
    """``(k,)`` drives at which the valve curve bends."""
    curve: Array
    """``(k,)`` flow there."""
    supply: float
    coupling: float
    leakage: float
    damping: float
    loss: float
    """Mean squared simulation error over the estimation data."""
    samples: int

    @property
    def parameters(self) -> int:
        """How many values of the model were estimated."""
        return self.curve.size + _DYNAMICS

    @property
    def bic(self) -> float:
        """N·ln V + d·ln N."""
        return information_criteria(self.loss, self.parameters, self.samples)[1]

    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None) -> Array:
        """Free run ``(N,)`` from the initial state that fits ``output`` best, or from zero; NaN if it diverges."""
        u = np.asarray(drive, dtype=float)
        if output is None:
            return self._from(u, np.zeros(2))
        _, y = lengths_agree(drive, output)
        spread = float(np.std(y)) or 1.0
        found = least_squares(lambda x: _bounded(self._from(u, x) - y, spread), [y[0], 0.0], x_scale=spread)
        return self._from(u, found.x)

    def _from(self, u: Array, start: Array) -> Array:
        flow = np.interp(u, self.knots, self.curve)
        return _run(flow, self.supply, self.coupling, self.leakage, self.damping, start, 1.0)


def fit_valve_actuator(
    drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], dt: float, knots: Sequence[int] = KNOTS
) -> ValveActuator:
    """The model of one or several experiments; the number of knots of the valve curve is chosen by BIC.

    The knots are spread evenly over the drives that occur. The start is the linear model of second order.

    :raises IdentificationError: too few samples, unequal lengths, drive or output that does not move.
    """
    pairs, _, _ = experiments(drives, outputs, "none")
    linear = fit_transfer_function(drives, outputs, 1.0, TransferFunctionOrder(2, 1))
    low, high = (float(f([f(u) for u, _ in pairs])) for f in (np.min, np.max))
    found = []
    for count in knots:
        spots: Array = np.linspace(low, high, count, dtype=np.float64)
        found.append(_fit(pairs, dt, spots, linear.denominator, linear.numerator))
    usable = [model for model in found if np.isfinite(model.loss)]
    if not usable:
        raise IdentificationError("no valve curve gives a model that can be run on these data")
    return min(usable, key=lambda model: model.bic)


def _fit(
    pairs: Sequence[tuple[Array, Array]], dt: float, knots: Array, denominator: Array, numerator: Array
) -> ValveActuator:
    """Least squares over curve, dynamics and initial states, from several starts that the linear model allows."""
    target = np.concatenate([y for _, y in pairs])
    largest, spread, count = float(np.abs(target).max()), float(np.std(target)), knots.size
    rows = [np.interp(u, knots, np.arange(count)) for u, _ in pairs]

    def model(values: Array) -> list[Array]:
        curve, dynamics = values[:count], values[count : count + _DYNAMICS]
        runs = []
        for index, row in enumerate(rows):
            start = values[count + _DYNAMICS + 2 * index :][:2]
            runs.append(_run(np.interp(row, np.arange(count), curve), *dynamics, start, 1.0))
        return runs

    best = None
    for start, supply in _starts(denominator, numerator, largest):
        first = [value for _, y in pairs for value in (y[0], 0.0)]
        x = np.concatenate((numerator[0] * knots, [supply], start, first))
        lowest = np.full(x.size, -np.inf)
        lowest[count : count + _DYNAMICS] = [0.5 * largest, 0.0, 0.0, 0.0]
        found = least_squares(
            lambda v: _bounded(np.concatenate(model(v)) - target, spread),
            x,
            bounds=(lowest, np.inf),
            x_scale=np.maximum(np.abs(x), 0.05),
            max_nfev=100,
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    loss = float(np.mean((np.concatenate(model(best.x)) - target) ** 2))
    supply, coupling, leakage, damping = best.x[count : count + _DYNAMICS].tolist()
    return ValveActuator(dt, knots, best.x[:count], supply, coupling, leakage, damping, loss, target.size)


def _starts(denominator: Array, numerator: Array, largest: float) -> list[tuple[list[float], float]]:
    """[b, l, d] that give the linear model's poles, for several dampings, each with a high and a low supply."""
    a1, a2 = float(denominator[1]), float(denominator[2])
    dampings = [max(float(numerator[1] / numerator[0]), 1e-3), 0.1 * abs(a1), 0.5 * abs(a1)]
    starts = []
    for damping in dampings:
        leakage = max(a1 - damping, 1e-3)
        starts.append([max(a2 - leakage * damping, 1e-4), leakage, damping])
    return [(start, factor * largest) for start in starts for factor in (2.0, 1.05)]


def _bounded(error: Array, spread: float) -> Array:
    return np.clip(np.nan_to_num(error, nan=_FAR * spread), -_FAR * spread, _FAR * spread)
