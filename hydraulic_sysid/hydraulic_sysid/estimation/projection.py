"""What linear unknowns explain is taken out of residuals and sensitivities (variable projection).

The initial states of segments, and all of a linear model but its denominator, are eliminated in this way at every step
of a fit: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432; Kaufman, BIT 15 (1975) 49–57.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array, Mask


def project_out(basis: Array, values: Array) -> Array:
    """``values`` (…, m, P) without what the orthonormal columns of ``basis`` (…, m, F) explain."""
    return values - basis @ (np.swapaxes(basis, -1, -2) @ values)


@dataclass(frozen=True)
class Explained:
    """What linear unknowns explain of each segment: the share ``taken`` (S, F) of orthonormal ``basis`` (S, m, F).

    That is all of it where nothing is known of an unknown, and less where a prior binds it: with N the columns of
    unknowns of unit variance the residual's covariance is I + NNᵀ, and what is left is (I − N(NᵀN + 1)⁻¹Nᵀ)^½ r.
    """

    basis: Array
    taken: Array

    @classmethod
    def by(cls, columns: Array) -> Explained:
        """By unknowns of unit variance with these whitened columns (S, m, K)."""
        if not columns.shape[-1]:
            return cls(columns, np.zeros((len(columns), 0)))
        return cls.spanned(_orthonormal(columns, np.ones(columns.shape[-1]))[0])

    @classmethod
    def spanned(cls, whole: Array) -> Explained:
        """By columns (S, m, F) W for which (I − WWᵀ)^½ r is left."""
        size, turn = np.linalg.eigh(np.swapaxes(whole, -1, -2) @ whole)
        size = np.clip(size, 1e-15, 1.0)
        return cls((whole @ turn) / np.sqrt(size)[:, None, :], 1.0 - np.sqrt(1.0 - size))

    def beyond(self, columns: Array) -> Array:
        """What of (S, m, P) they cannot explain."""
        return columns - self.basis @ (self.taken[..., None] * (np.swapaxes(self.basis, -1, -2) @ columns))

    def left(self, residual: Array) -> Array:
        """(S,) sum of squares of what of (S, m) they cannot explain; infinite where a run leaves all bounds."""
        with np.errstate(over="ignore", invalid="ignore"):
            found = np.sum(self.beyond(residual[..., None]) ** 2, axis=(1, 2))
        return np.where(np.isfinite(found), found, np.inf)

    def subset(self, chosen: Mask) -> Explained:
        """Of the ``chosen`` (S,) segments alone."""
        return Explained(self.basis[chosen], self.taken[chosen])

    def with_subset(self, chosen: Mask, other: Explained) -> Explained:
        """This with ``other`` in the place of the ``chosen`` (S,) segments."""
        return Explained(_put(self.basis, chosen, other.basis), _put(self.taken, chosen, other.taken))


def _orthonormal(columns: Array, ridge: Array) -> tuple[Array, Array]:
    """BL⁻ᵀ with LLᵀ = BᵀB + ``ridge`` (K,) of columns B (S, m, K), and L."""
    gram = np.swapaxes(columns, -1, -2) @ columns + np.diag(ridge + 1e-12)
    root = np.asarray(np.linalg.cholesky(gram))
    return np.asarray(np.swapaxes(np.linalg.solve(root, np.swapaxes(columns, -1, -2)), -1, -2)), root


def _put(values: Array, chosen: Mask, new: Array) -> Array:
    """``values`` with ``new`` where they are ``chosen`` (S,)."""
    found = values.copy()
    found[chosen] = new
    return found


@dataclass(frozen=True)
class Projection:
    """Residuals of one record's segments, the initial states and the nuisance eliminated.

    ``raw`` (S, m): measured − simulated, whitened, priors of the initial states appended; ``explained``: by initial
    states and nuisance; ``by_nuisance``: by that alone; ``correction`` (S, free, m): the change of the initial states
    that a residual asks for.
    """

    raw: Array
    explained: Explained
    by_nuisance: Explained
    correction: Array
    log_determinant: Array

    @classmethod
    def of(cls, raw: Array, jacobian: Array, nuisance: Array, alone: Explained | None = None) -> Projection:
        """From the residuals, their derivatives (S, m, free) by the initial states, and nuisance (S, m, K).

        Coefficients of the nuisance have unit variance: with B = (jacobian, nuisance) and the ridge Λ = diag(0, 1) the
        residual's covariance is I + BΛ⁻¹Bᵀ, and what is left of r is (I − B(BᵀB + Λ)⁻¹Bᵀ)^½ r. ``alone``: what the
        nuisance by itself explains, where that is known already.
        """
        columns, free = np.concatenate((jacobian, nuisance), axis=-1), jacobian.shape[-1]
        whole, root = _orthonormal(columns, np.where(np.arange(columns.shape[-1]) < free, 0.0, 1.0))
        correction = -np.asarray(np.linalg.solve(np.swapaxes(root, -1, -2), np.swapaxes(whole, -1, -2)))[:, :free]
        log_determinant = 2.0 * np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
        by_nuisance = Explained.by(nuisance) if alone is None else alone
        return cls(raw, Explained.spanned(whole), by_nuisance, correction, log_determinant)

    @cached_property
    def residual(self) -> Array:
        """(S, m) after the best (linear) change of every initial state."""
        return self.beyond(self.raw[..., None])[..., 0]

    @cached_property
    def costs(self) -> Array:
        """(S,) sum of squares of each segment from its initial state as it is, beyond what the nuisance explains.

        Infinite where a run leaves all bounds.
        """
        return self.by_nuisance.left(self.raw)

    def beyond(self, columns: Array) -> Array:
        """What of (S, m, P) the initial states and the nuisance cannot explain."""
        return self.explained.beyond(columns)

    def with_raw(self, raw: Array) -> Projection:
        """Other residuals (S, m), the same directions."""
        return replace(self, raw=raw)

    def subset(self, chosen: Mask) -> Projection:
        """Of the ``chosen`` (S,) segments alone."""
        return Projection(
            self.raw[chosen], self.explained.subset(chosen), self.by_nuisance.subset(chosen),
            self.correction[chosen], self.log_determinant[chosen],
        )  # fmt: skip

    def with_subset(self, chosen: Mask, other: Projection) -> Projection:
        """These with ``other`` in the place of the ``chosen`` (S,) segments; the nuisance is the same."""
        return Projection(
            _put(self.raw, chosen, other.raw), self.explained.with_subset(chosen, other.explained), self.by_nuisance,
            _put(self.correction, chosen, other.correction),
            _put(self.log_determinant, chosen, other.log_determinant),
        )  # fmt: skip
