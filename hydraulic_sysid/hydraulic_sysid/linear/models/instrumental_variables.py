"""ARX models by instrumental variables: unbiased where noise on the output biases least squares.

The four steps of IV4, L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999, p. 486:
least squares; instruments from the simulated output of that model; an autoregression of order na + nb of what is
left; once more with data and instruments filtered by it, which makes the estimate the most accurate one that
instruments give when the noise has that colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from hydraulic_sim.arrays import Array
from hydraulic_sysid.linear.errors import IdentificationError

from .arx import ArxModel, ArxOrder, fit_arx, regressors
from .experiments import experiments
from .noise_model import autoregression


def fit_arx_instruments(
    drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], dt: float, order: ArxOrder, offsets: str = "estimate"
) -> ArxModel:
    """ARX model by IV4 over one or several experiments, arguments as of `arx.fit_arx`.

    :raises IdentificationError: as `arx.fit_arx`; or the instruments say too little about the outputs.
    """
    first = fit_arx(drives, outputs, dt, order, offsets)
    pairs, _, _ = experiments(drives, outputs, offsets)
    second = _step(first, pairs, np.ones(1))
    left = [y[order.memory :] - _predicted(second, u, y) for u, y in pairs]
    return _step(second, pairs, np.concatenate(([1.0], autoregression(left, order.na + order.nb))))


def _step(model: ArxModel, pairs: Sequence[tuple[Array, Array]], prefilter: Array) -> ArxModel:
    """The model with coefficients solved by instruments from its own simulation, all filtered by ``prefilter``."""
    order, constant = model.order, model.standard_errors.size > model.order.na + model.order.nb
    safe = replace(model, a=_stable(model.a), input_offset=0.0, output_offset=0.0)
    past, by, target = [], [], []
    for u, y in pairs:
        clean = safe.simulate(u, y)
        if not np.isfinite(clean).all():
            raise IdentificationError("the least-squares model cannot be run: no instruments; try other orders")
        past.append(lfilter(prefilter, [1.0], np.column_stack(regressors(u, y, order, constant)), axis=0))
        by.append(lfilter(prefilter, [1.0], np.column_stack(regressors(u, clean, order, constant)), axis=0))
        target.append(lfilter(prefilter, [1.0], y[order.memory :]))
    phi, z, y_all = np.vstack(past), np.vstack(by), np.concatenate(target)
    lengths = np.linalg.norm(z, axis=0)
    z, phi = z / lengths, phi / lengths
    cross = z.T @ phi
    if not np.linalg.cond(cross) < 1e12:
        raise IdentificationError("the instruments say too little about the outputs: lower the order")
    theta = np.linalg.solve(cross, z.T @ y_all)
    inverse = np.linalg.inv(cross)
    variance = float(np.sum((y_all - phi @ theta) ** 2)) / (y_all.size - theta.size)
    errors = np.sqrt(variance * np.diag(inverse @ (z.T @ z) @ inverse.T)) / lengths
    theta = theta / lengths
    found = replace(
        model,
        a=theta[: order.na],
        b=theta[order.na : order.na + order.nb],
        constant=float(theta[-1]) if constant else 0.0,
        standard_errors=errors,
        condition_number=float(np.linalg.cond(cross)),
        method="instrumental variables",
    )
    left = np.concatenate([y[order.memory :] - _predicted(found, u, y) for u, y in pairs])
    return replace(found, loss=float(np.mean(left**2)))


def _predicted(model: ArxModel, u: Array, y: Array) -> Array:
    """One-step prediction of data whose offsets have been subtracted already."""
    return replace(model, input_offset=0.0, output_offset=0.0).predict(u, y)[model.order.memory :]


def _stable(a: Array) -> Array:
    """Denominator coefficients with the poles outside the unit circle mirrored into it."""
    roots = np.roots(np.concatenate(([1.0], a)))
    outside = np.abs(roots) > 1.0
    if not outside.any():
        return a
    return np.real(np.poly(np.where(outside, 1.0 / np.conj(np.where(outside, roots, 1.0)), roots)))[1:]
