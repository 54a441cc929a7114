"""Simplified refined instrumental variables for continuous-time models (SRIVC), with initial states.

The data are filtered by 1/α of the last iteration, so that their derivatives need not be measured; the instruments
are the filtered derivatives of the noise-free output of the last model, which noise on the output does not bias.
For white noise on the output it settles where the output-error fit has its minimum, [1] section 4, and it needs no
good start, which that fit does: here it provides it.

[1] P. Young, A. Jakeman, *Int. J. Control* 31 (1980) 741–764; H. Garnier, L. Wang (eds.), *Identification of
    Continuous-time Models from Sampled Data*, Springer 2008, ch. 4.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from hydraulic_sim.arrays import Array

from .held_filter import Filter
from .output_error import Point, Problem, evaluate


def refined_iv(problem: Problem, cutoff: float, iterations: int = 20, tolerance: float = 1e-4) -> Point | None:
    """The best denominator met on the way from state-variable filters of one ``cutoff`` (in scaled time).

    None where none was stable enough to be simulated.
    """
    n = problem.poles
    filters: Array = np.asarray(np.poly(np.full(n, -cutoff))[1:], dtype=float)
    best: Point | None = None
    instruments_from: Point | None = None
    for _ in range(iterations):
        try:
            alpha = _solve(problem, filters, instruments_from)
        except np.linalg.LinAlgError:
            break
        alpha = _stabilised(problem, alpha)
        point = evaluate(problem, alpha)
        if not np.isfinite(point.cost):
            break
        if best is None or point.cost < best.cost:
            best = point
        full = problem.full(alpha)
        if np.linalg.norm(full - filters) < tolerance * np.linalg.norm(full) and instruments_from is not None:
            break
        filters, instruments_from = full, point
    return best


def _solve(problem: Problem, filters: Array, model: Point | None) -> Array:
    """One step: free α from data filtered by 1/filters; least squares without a ``model``, instruments with one."""
    n, free = problem.poles, problem.poles - int(problem.integrator)
    prefilter = Filter(filters, problem.step)
    simulated = None if model is None else problem.target - model.residual
    lags, others, targets, instruments = [], [], [], []
    first = 0
    for u, y in zip(problem.inputs, problem.outputs, strict=True):
        output = prefilter.ramped(y).single
        targets.append(output[:, n])
        lags.append(-output[:, n - 1 : n - 1 - free : -1] if free < n else -output[:, n - 1 :: -1])
        if simulated is not None:
            noise_free = prefilter.ramped(simulated[first : first + y.size]).single
            instruments.append(-noise_free[:, n - 1 : n - 1 - free : -1] if free < n else -noise_free[:, n - 1 :: -1])
        first += y.size
        inputs = prefilter.held(u, problem.delay).single[:, : problem.zeros + 1]
        constant = [prefilter.held(np.ones(u.size)).single[:, :1]] if problem.constant else []
        others.append((np.hstack([inputs, *constant]), prefilter.impulse(u.size).single[:, :n]))
    rest = np.hstack((np.vstack([o[0] for o in others]), block_diag(*[o[1] for o in others])))
    regressors = np.hstack((np.vstack(lags), rest))
    scale = np.linalg.norm(regressors, axis=0)
    scale[scale == 0.0] = 1.0
    target = np.concatenate(targets)
    if simulated is None:
        solution, *_ = np.linalg.lstsq(regressors / scale, target, rcond=1e-13)
    else:
        by = np.hstack((np.vstack(instruments), rest)) / scale
        solution = np.linalg.solve(by.T @ (regressors / scale), by.T @ target)
    return (solution / scale)[:free]


def _stabilised(problem: Problem, alpha: Array) -> Array:
    """The denominator with poles that grow mirrored into the left half plane."""
    if problem.allowed(alpha):
        return alpha
    roots = np.roots(np.concatenate(([1.0], alpha)))
    return np.real(np.poly(np.where(roots.real > 0.0, -np.conj(roots), roots)))[1:]
