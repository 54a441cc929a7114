"""A damped step of a bounded linear least-squares problem, given by its normal equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]

LEAST_DAMPING = 1e-6


def bounded_step(
    information: Array,
    gradient: Array,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    bounds: Sequence[tuple[float, float] | None],
    damping: float,
) -> Array:
    """The damped step (P,) in units of the scales that stays within the bounds (Levenberg-Marquardt)."""
    diagonal = np.maximum(np.diag(information), 1e-12 * max(float(np.max(np.diag(information))), 1.0))
    root = np.linalg.cholesky(information + np.diag(damping * diagonal))
    target = -np.linalg.solve(root, gradient)
    low = np.array([(b[0] - values[k]) / scales[k] for k, b in zip(values, bounds, strict=True)])  # type: ignore[index]
    high = np.array([(b[1] - values[k]) / scales[k] for k, b in zip(values, bounds, strict=True)])  # type: ignore[index]
    tight = high - low < 1e-12
    high = np.where(tight, low + 1e-12, high)
    # The active-set method ends exactly at a bound, an interior-point one only near it.
    found = lsq_linear(root.T, target, bounds=(np.minimum(low, 0.0), np.maximum(high, 0.0)), method="bvls")
    return np.clip(found.x, low, high)


def ahead(
    information: Array,
    scores: Array,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    bounds: Sequence[tuple[float, float] | None],
) -> float:
    """The step that would come next, in standard errors of the parameter that it moves furthest.

    Of errors that take the ``scores`` (S, P) of whole pieces as independent (see `statistics`).
    """
    change = bounded_step(information, scores.sum(axis=0), values, scales, bounds, LEAST_DAMPING)
    inverse = np.linalg.pinv(information, rcond=1e-14, hermitian=True)
    centred = scores - scores.mean(axis=0)
    variance = np.diag(inverse @ (centred.T @ centred + information) @ inverse)
    return float(np.max(np.abs(change) / np.sqrt(np.maximum(variance, 1e-300))))
