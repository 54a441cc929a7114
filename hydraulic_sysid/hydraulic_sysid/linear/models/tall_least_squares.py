"""Least squares with many rows and few columns, by QR of blocks that fit into the processor's cache.

The R factors of the blocks are stacked and factored again until one is left (tall-skinny QR, [1]): as accurate as
Householder's QR of the whole matrix, about as fast as forming the normal equations, which square the condition
number, and without the whole matrix in memory.

[1] J. Demmel, L. Grigori, M. Hoemmen, J. Langou, *SIAM J. Sci. Comput.* 34 (2012) A206–A239.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.covariance import of_columns
from hydraulic_sysid.linear.errors import IdentificationError

_BLOCK = 1024
_CHUNK = 64 * _BLOCK
_WORST = 1e12


@dataclass(frozen=True)
class Solution:
    """``theta`` (k,), ``covariance`` (ΦᵀΦ)⁻¹, condition number of Φ with columns of unit length, Σe² and rows."""

    theta: Array
    covariance: Array
    condition: float
    squares: float
    rows: int


def triangle(chunks: Iterable[Sequence[Array]]) -> tuple[Array, int]:
    """R (k, k) with RᵀR = Σ MᵀM and the number of rows, for chunks M given as their k columns of equal length."""
    found: list[Array] = []
    rows = 0
    for columns in chunks:
        length = columns[0].size
        rows += length
        for first in range(0, length, _CHUNK):
            part = np.stack([c[first : first + _CHUNK] for c in columns])
            found.append(_reduced(part))
    stacked = np.vstack(found)
    while len(stacked) > _CHUNK:
        stacked = _reduced(np.ascontiguousarray(stacked.T))
    return np.asarray(np.linalg.qr(stacked, mode="r")), rows


def _reduced(part: Array) -> Array:
    """R factors, one under the other, of the blocks of a matrix given as its rows ``(k, n)`` of columns."""
    k, n = part.shape
    whole = n // _BLOCK * _BLOCK
    blocks = part[:, :whole].reshape(k, -1, _BLOCK).transpose(1, 2, 0)
    rest = part[:, whole:].T
    if not whole:
        return rest
    factors: Array = np.asarray(np.linalg.qr(blocks, mode="r"))
    return np.vstack((factors.reshape(-1, k), rest))


def solve(chunks: Iterable[Sequence[Array]]) -> Solution:
    """Least squares of the last column on the others.

    :raises IdentificationError: a column is zero throughout, or the columns are as good as dependent.
    """
    r, rows = triangle(chunks)
    k = r.shape[1] - 1
    if len(r) <= k:  # as many rows as unknowns: nothing is left over
        r = np.vstack((r, np.zeros((k + 1 - len(r), k + 1))))
    if not r[:, :k].any(axis=0).all():
        raise IdentificationError("the drive or the output is zero throughout: nothing can be identified")
    covariance, condition = of_columns(r[:k, :k])
    check_condition(condition)
    theta = solve_triangular(r[:k, :k], r[:k, k])
    return Solution(theta, covariance, condition, float(r[k, k] ** 2), rows)


def check_condition(condition: float) -> None:
    """Refuse columns that are as good as dependent.

    :raises IdentificationError: they are.
    """
    if condition > _WORST:
        raise IdentificationError(
            f"the record does not excite a model of this order (condition number {condition:.1e}): "
            "lower the order or use a richer drive"
        )
