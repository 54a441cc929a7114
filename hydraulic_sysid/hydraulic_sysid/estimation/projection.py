"""What linear unknowns explain is taken out of residuals and sensitivities (variable projection).

The initial states of segments, and all of a linear model but its denominator, are eliminated in this way at every step
of a fit: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432; Kaufman, BIT 15 (1975) 49–57.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array, Mask


def project_out(basis: Array, values: Array) -> Array:
    """``values`` (…, m, P) without what the orthonormal columns of ``basis`` (…, m, F) explain."""
    return values - basis @ (np.swapaxes(basis, -1, -2) @ values)


@dataclass(frozen=True)
class Projection:
    """Residuals of one record's segments, the initial states and the nuisance eliminated.

    ``raw`` (S, m): measured − simulated, whitened, priors of the initial states appended; ``basis`` (S, m, F)
    orthonormal columns, of which the share ``taken`` (S, F) is explained: all of what the initial states can, less of
    what is bound by a prior; ``correction`` (S, free, m) the change of the initial states that a residual asks for.
    """

    raw: Array
    basis: Array
    taken: Array
    correction: Array
    log_determinant: Array

    @classmethod
    def of(cls, raw: Array, jacobian: Array, nuisance: Array) -> Projection:
        """From the residuals, their derivatives (S, m, free) by the initial states, and nuisance (S, m, K).

        Coefficients of the nuisance have unit variance: with B = (jacobian, nuisance) and the ridge Λ = diag(0, 1) the
        residual's covariance is I + BΛ⁻¹Bᵀ, and what is left of r is (I − B(BᵀB + Λ)⁻¹Bᵀ)^½ r.
        """
        columns, free = np.concatenate((jacobian, nuisance), axis=-1), jacobian.shape[-1]
        ridge = np.where(np.arange(columns.shape[-1]) < free, 0.0, 1.0)
        gram = np.swapaxes(columns, -1, -2) @ columns + np.diag(ridge + 1e-12)
        root = np.linalg.cholesky(gram)
        whole = np.swapaxes(np.linalg.solve(root, np.swapaxes(columns, -1, -2)), -1, -2)
        size, turn = np.linalg.eigh(np.swapaxes(whole, -1, -2) @ whole)
        size = np.clip(size, 1e-15, 1.0)
        basis = (whole @ turn) / np.sqrt(size)[:, None, :]
        correction = -np.linalg.solve(np.swapaxes(root, -1, -2), np.swapaxes(whole, -1, -2))[:, :free]
        log_determinant = 2.0 * np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
        return cls(raw, basis, 1.0 - np.sqrt(1.0 - size), correction, log_determinant)

    @cached_property
    def residual(self) -> Array:
        """(S, m) after the best (linear) change of every initial state."""
        return self.beyond(self.raw[..., None])[..., 0]

    @cached_property
    def costs(self) -> Array:
        """(S,) sum of squares of each segment's residual; infinite where its run leaves all bounds."""
        with np.errstate(over="ignore", invalid="ignore"):
            found = np.sum(self.residual**2, axis=1)
        return np.where(np.isfinite(found), found, np.inf)

    def beyond(self, columns: Array) -> Array:
        """What of (S, m, P) the initial states and the nuisance cannot explain."""
        return columns - self.basis @ (self.taken[..., None] * (np.swapaxes(self.basis, -1, -2) @ columns))

    def with_raw(self, raw: Array) -> Projection:
        """Other residuals (S, m), the same directions."""
        return replace(self, raw=raw)

    def subset(self, chosen: Mask) -> Projection:
        """Of the ``chosen`` (S,) segments alone."""
        return Projection(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    def with_subset(self, chosen: Mask, other: Projection) -> Projection:
        """These with ``other`` in the place of the ``chosen`` (S,) segments."""
        values = {f.name: getattr(self, f.name).copy() for f in fields(self)}
        for name, own in values.items():
            own[chosen] = getattr(other, name)
        return Projection(**values)
