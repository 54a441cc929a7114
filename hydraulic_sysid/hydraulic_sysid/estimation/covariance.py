"""How far estimates may be off: from what the residuals say of parameters, segment by segment.

Residuals are correlated in time, and a model is never exact; errors from the curvature alone are then far too small.
The scores of whole segments (or records) are taken as independent instead (the "sandwich": White, Econometrica 50
(1982); Liang & Zeger, Biometrika 73 (1986)).
"""

from __future__ import annotations

import numpy as np

from hydraulic_sim.arrays import Array

FLOOR = 1e-14  # of the largest eigenvalue: what a direction without any information is given


def inverse(information: Array) -> Array:
    """The inverse (P, P), very large where there is no information."""
    size, vectors = np.linalg.eigh(information)
    return (vectors / np.maximum(size, FLOOR * max(float(size[-1]), 1.0))) @ vectors.T


def sandwich(bread: Array, scores: Array) -> Array:
    """Covariance (P, P) from the ``bread`` (`inverse` information) and the ``scores`` (S, P) of clusters."""
    count = max(len(scores), 2)
    centred = scores - scores.mean(axis=0)
    return bread @ (centred.T @ centred) @ bread * (count / (count - 1.0))


def of_columns(columns: Array) -> tuple[Array, float]:
    """(ΦᵀΦ)⁻¹ of the columns Φ (N, P), and the condition number of Φ with columns of unit length.

    By singular values: the normal equations would square the condition number. Infinite where a column is zero or
    depends on others.
    """
    lengths = np.linalg.norm(columns, axis=0)
    if not lengths.all():
        return np.full((lengths.size, lengths.size), np.inf), float("inf")
    _, singular, right = np.linalg.svd(columns / lengths, full_matrices=False)
    if not singular[-1] > 0.0:
        return np.full((lengths.size, lengths.size), np.inf), float("inf")
    root = (right.T / singular) / lengths[:, None]
    return root @ root.T, float(singular[0] / singular[-1])
