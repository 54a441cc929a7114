"""How well the data determine the parameters: standard errors, correlations, directions that they cannot identify."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array

from .covariance import FLOOR, inverse, sandwich
from .fit import Fit, FitPoint
from .parameters import Parameters

VAGUE = 0.5  # standard error, of a parameter's scale, from which it is not identifiable
_PART = 0.3  # weight from which a parameter is named as part of a direction


@dataclass(frozen=True)
class Direction:
    """A combination of parameters that is not identifiable: relative weights, and the error along it [of scale]."""

    weights: dict[str, float]
    error: float


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors [SI, inf where there is no influence], correlations (P, P) and what is not identifiable.

    The condition number is that of the scaled information.
    """

    standard_errors: dict[str, float]
    correlation: Array
    condition_number: float
    not_identifiable: list[Direction]


def uncertainty(fit: Fit) -> Uncertainty:
    """Statistics of a fit of one parameter or more at its end."""
    normal, spread = fit.point.normal, fit.spread
    bread = inverse(normal.information)
    clustered, plain = sandwich(bread, np.concatenate(normal.scores)), bread * spread**2
    covariance = np.where(np.diag(clustered)[:, None] >= np.diag(plain)[:, None], clustered, plain)
    return _described(fit.point.parameters, normal.information, covariance, spread)


def attainable(point: FitPoint, columns: Sequence[Array], share: float = 1.0) -> Uncertainty:
    """What the noise (and nuisance) of the segments alone would leave unknown if the model were exact.

    :param columns: derivatives (S, m, P) per record, as `FitPoint.columns`
    :param share: of all segments, that the point has
    """
    beyond = point.beyond(columns)
    information = np.sum([np.tensordot(b, b, axes=([0, 1], [0, 1])) for b in beyond], axis=0) / share
    return _described(point.parameters, information, inverse(information), 1.0)


def _described(parameters: Parameters, information: Array, covariance: Array, spread: float) -> Uncertainty:
    errors = np.sqrt(np.diag(covariance))
    sizes = np.maximum(errors, 1e-150)
    correlation = np.clip(covariance / np.outer(sizes, sizes), -1.0, 1.0)
    eigenvalues, vectors = np.linalg.eigh(information)
    eigenvalues = np.maximum(eigenvalues, FLOOR * max(float(eigenvalues[-1]), 1.0))
    vague = []
    for error, vector in zip((spread / np.sqrt(eigenvalues)).tolist(), vectors.T, strict=True):
        if error > VAGUE:
            named = {k: float(w) for k, w in zip(parameters.keys, vector, strict=True) if abs(w) >= _PART}
            vague.append(Direction(named, error))
    return Uncertainty(
        {k: float(np.inf) if e > 1e3 else float(e * s)
         for k, e, s in zip(parameters.keys, errors, parameters.scales, strict=True)},
        0.5 * (correlation + correlation.T),
        float(eigenvalues[-1] / eigenvalues[0]),
        vague,
    )  # fmt: skip
