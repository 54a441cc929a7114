"""How well the data tell the parameters: standard errors, correlations, directions that they do not tell.

Residuals are correlated in time, and a model is never exact; errors from the curvature alone are then far too small.
The scores of whole pieces are taken as independent instead (the "sandwich", White, Econometrica 50 (1982); Liang &
Zeger, Biometrika 73 (1986)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .estimate import Fit

Array = NDArray[np.float64]

BLIND = 0.5  # standard error, of a parameter's scale, from which the data do not tell a direction
AT_BOUND = 1e-6  # distance from a bound, of the scale
_PART = 0.3  # weight from which a parameter is named as part of a direction


@dataclass(frozen=True)
class Direction:
    """A combination of parameters that the data do not tell: relative weights, and the error along it [of scale]."""

    weights: dict[str, float]
    error: float


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors [SI, inf where blind], correlations (P, P), condition number of the scaled information."""

    standard_errors: dict[str, float]
    correlation: Array
    condition: float
    blind: list[Direction]


def uncertainty(fit: Fit) -> Uncertainty:
    """Statistics of a fit at its end. Parameters without any influence get an infinite standard error."""
    keys = list(fit.values)
    if not keys:
        return Uncertainty({}, np.zeros((0, 0)), 1.0, [])
    size, vectors = np.linalg.eigh(fit.information)
    floor = max(float(size.max()), 1.0) * 1e-14
    inverse = (vectors / np.maximum(size, floor)) @ vectors.T
    pieces = max(len(fit.scores), 2)
    centred = fit.scores - fit.scores.mean(axis=0)
    clustered = inverse @ (centred.T @ centred) @ inverse * (pieces / (pieces - 1.0))
    plain = inverse * fit.spread**2
    variance = np.maximum(np.diag(clustered), np.diag(plain))
    covariance = np.where(np.diag(clustered)[:, None] >= np.diag(plain)[:, None], clustered, plain)
    errors = np.sqrt(variance)
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = np.clip(covariance / np.outer(spread, spread), -1.0, 1.0)
    correlation = 0.5 * (correlation + correlation.T)
    blind = []
    for value, vector in zip(size, vectors.T, strict=True):
        error = fit.spread / np.sqrt(max(float(value), floor))
        if error > BLIND:
            named = {k: float(w) for k, w in zip(keys, vector, strict=True) if abs(w) >= _PART}
            blind.append(Direction(named, float(error)))
    found = {
        k: float("inf") if e > 1e3 else float(e * fit.scales[k]) for k, e in zip(keys, errors.tolist(), strict=True)
    }
    return Uncertainty(found, correlation, float(size.max() / max(float(size.min()), floor)), blind)


def at_bounds(fit: Fit, bounds: dict[str, tuple[float, float]]) -> dict[str, str]:
    """Which parameters ended at a bound: key → "lowest" or "highest"."""
    found = {}
    for key, value in fit.values.items():
        near = AT_BOUND * fit.scales[key]
        if value - bounds[key][0] <= near:
            found[key] = "lowest"
        elif bounds[key][1] - value <= near:
            found[key] = "highest"
    return found
