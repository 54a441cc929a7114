"""Fit a continuous-time transfer function to records: SRIVC for the start, output error for the result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.covariance import of_columns
from hydraulic_sysid.estimation.levenberg_marquardt import Minimum, minimise
from hydraulic_sysid.estimation.projection import project_out
from hydraulic_sysid.linear.errors import IdentificationError

from .experiments import experiments
from .noise_model import fit_noise
from .output_error import Point, Problem
from .srivc import refined_iv
from .tall_least_squares import check_condition
from .transfer_function import TransferFunctionModel, TransferFunctionOrder

METHODS = ("output error", "srivc")
_CUTOFFS = (0.3, 1.0, 3.0, 10.0, 30.0)
_MOST_STEPS, _LEAST_GAIN = 60, 1e-9


def fit_transfer_function(
    drives: Sequence[ArrayLike],
    outputs: Sequence[ArrayLike],
    dt: float,
    order: TransferFunctionOrder | None = None,
    *,
    delay: float = 0.0,
    offsets: str = "estimate",
    method: str = "output error",
) -> TransferFunctionModel:
    """Continuous-time model of one or several experiments, sampled alike every ``dt`` seconds, inputs held.

    Works for an integrating plant (drive to position), whose pole at 0 is estimated like the others, or fixed with
    ``order.integrator``. The initial state of every experiment is estimated. ``delay`` is the dead time in seconds.
    ``offsets``: ``estimate`` adds the constant c to the unknowns, ``remove`` subtracts the means, ``none`` neither.

    :raises IdentificationError: too few samples, unequal lengths, an input that does not excite the order.
    """
    order = order or TransferFunctionOrder()
    if method not in METHODS:
        raise IdentificationError(f"method: {method!r} is none of {', '.join(METHODS)}")
    if not (np.isfinite(dt) and dt > 0.0 and np.isfinite(delay) and delay >= 0.0):
        raise IdentificationError(f"sampling time {dt:g} s must be positive and delay {delay:g} s not negative")
    pairs, u0, y0 = experiments(drives, outputs, offsets)
    inputs, measured = [u for u, _ in pairs], [y for _, y in pairs]
    _check(inputs, measured, order)
    scale = _typical_frequency(inputs, dt)
    problem = Problem(
        inputs, measured, scale * dt, order.poles, order.zeros, order.integrator, offsets == "estimate", delay / dt
    )
    start = _start(problem)
    found = minimise(start, _MOST_STEPS, _LEAST_GAIN) if method == "output error" else Minimum(start, True, 0)
    return _model(problem, found.point, scale, dt, order, delay, (u0, y0), method, found.converged)


def _check(inputs: Sequence[Array], outputs: Sequence[Array], order: TransferFunctionOrder) -> None:
    unknowns = order.free_poles + order.zeros + 2 + order.poles * len(inputs)
    samples = sum(y.size for y in outputs)
    if samples <= 2 * unknowns:
        raise IdentificationError(f"{samples} samples are too few for {unknowns} unknowns, initial states included")
    for number, (u, y) in enumerate(zip(inputs, outputs, strict=True)):
        if not (np.ptp(u) > 0.0 and np.ptp(y) > 0.0):
            raise IdentificationError(f"experiment {number + 1}: input and output must move")


def _typical_frequency(inputs: Sequence[Array], dt: float) -> float:
    """The frequency [rad/s] below which half of the inputs' power lies."""
    longest = max(inputs, key=len)
    power = np.abs(np.fft.rfft(longest - longest.mean())) ** 2
    middle = int(np.searchsorted(np.cumsum(power), 0.5 * power.sum()))
    return float(2.0 * np.pi * max(middle, 1) / (longest.size * dt))


def _start(problem: Problem) -> Point:
    """The best that SRIVC finds from state-variable filters of several cut-off frequencies below Nyquist's."""
    highest = 0.8 * np.pi / problem.step
    found = [refined_iv(problem, cutoff) for cutoff in sorted({min(c, highest) for c in _CUTOFFS})]
    usable = [point for point in found if point is not None and np.isfinite(point.cost)]
    if not usable:
        raise IdentificationError("no model of this order can be simulated on these data: lower the order")
    return min(usable, key=lambda p: p.cost)


def _model(
    problem: Problem,
    point: Point,
    scale: float,
    dt: float,
    order: TransferFunctionOrder,
    delay: float,
    means: tuple[float, float],
    method: str,
    converged: bool,
) -> TransferFunctionModel:
    n, m = order.poles, order.zeros
    alpha = problem.full(point.alpha)
    size = scale ** np.concatenate(
        (np.arange(1, order.free_poles + 1), np.arange(n - m, n + 1), [n] if problem.constant else [])
    )
    joint = _without_states(np.hstack((point.jacobian, point.columns)), point.alpha.size + problem.shared)
    covariance, condition = of_columns(joint)
    check_condition(condition)
    samples = point.residual.size
    variance = point.cost / (samples - point.alpha.size - point.columns.shape[1])
    errors = np.sqrt(variance * np.diag(covariance))[: size.size]
    bounds = np.cumsum([y.size for y in problem.outputs])[:-1]
    noise, one_step = fit_noise(np.split(point.residual, bounds))
    return TransferFunctionModel(
        order=order,
        dt=dt,
        numerator=point.theta[: m + 1] * scale ** np.arange(n - m, n + 1),
        denominator=np.concatenate(([1.0], alpha * scale ** np.arange(1, n + 1))),
        delay=delay,
        constant=float(point.theta[m + 1] * scale**n) if problem.constant else 0.0,
        input_offset=means[0],
        output_offset=means[1],
        standard_errors=errors * size,
        loss=point.cost / samples,
        samples=samples,
        condition_number=condition,
        noise=noise,
        one_step_loss=one_step,
        method=method,
        converged=converged,
    )


def _without_states(joint: Array, own: int) -> Array:
    """The first ``own`` columns less what the others, the initial states', explain of them.

    States that die away within a sample have nearly equal columns: these say nothing about the model itself.
    """
    model, states = joint[:, :own], joint[:, own:]
    lengths = np.linalg.norm(states, axis=0)
    left, singular, _ = np.linalg.svd(states / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    basis = left[:, singular > 1e-10 * singular[0]]
    return project_out(basis, model)
