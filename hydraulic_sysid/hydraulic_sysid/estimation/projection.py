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
class Nuisance:
    """What may be off in every segment, by about one of each of its columns: the share ``taken`` (S, K) of ``basis``.

    With N the columns the residual's covariance is I + NNᵀ, and what is left of r is (I − N(NᵀN + 1)⁻¹Nᵀ)^½ r.
    """

    basis: Array
    taken: Array

    @classmethod
    def of(cls, columns: Array) -> Nuisance:
        """From whitened columns (S, m, K)."""
        if not columns.shape[-1]:
            return cls(columns, np.zeros((len(columns), 0)))
        whole, _ = _orthonormal(columns, np.ones(columns.shape[-1]))
        basis, size = _turned(whole)
        return cls(basis, 1.0 - np.sqrt(1.0 - size))

    def beyond(self, columns: Array) -> Array:
        """What of (S, m, P) it cannot explain."""
        return columns - self.basis @ (self.taken[..., None] * (np.swapaxes(self.basis, -1, -2) @ columns))

    def subset(self, chosen: Mask) -> Nuisance:
        """Of the ``chosen`` (S,) segments alone."""
        return Nuisance(self.basis[chosen], self.taken[chosen])


def _orthonormal(columns: Array, ridge: Array) -> tuple[Array, Array]:
    """BL⁻ᵀ with LLᵀ = BᵀB + ``ridge`` (K,) of columns B (S, m, K), and L."""
    gram = np.swapaxes(columns, -1, -2) @ columns + np.diag(ridge + 1e-12)
    root = np.asarray(np.linalg.cholesky(gram))
    return np.asarray(np.swapaxes(np.linalg.solve(root, np.swapaxes(columns, -1, -2)), -1, -2)), root


def _turned(whole: Array) -> tuple[Array, Array]:
    """An orthonormal basis (S, m, K) of such columns, and by which share (S, K) each is in them."""
    size, turn = np.linalg.eigh(np.swapaxes(whole, -1, -2) @ whole)
    size = np.clip(size, 1e-15, 1.0)
    return (whole @ turn) / np.sqrt(size)[:, None, :], size


@dataclass(frozen=True)
class Projection:
    """Residuals of one record's segments, the initial states and the nuisance eliminated.

    ``raw`` (S, m): measured − simulated, whitened, priors of the initial states appended; ``basis`` (S, m, F)
    orthonormal columns, of which the share ``taken`` (S, F) is explained: all of what the initial states can, less of
    what is bound by a prior; ``correction`` (S, free, m) the change of the initial states that a residual asks for;
    ``nuisance``: that alone.
    """

    raw: Array
    basis: Array
    taken: Array
    correction: Array
    log_determinant: Array
    nuisance: Nuisance

    @classmethod
    def of(cls, raw: Array, jacobian: Array, nuisance: Array, alone: Nuisance | None = None) -> Projection:
        """From the residuals, their derivatives (S, m, free) by the initial states, and nuisance (S, m, K).

        Coefficients of the nuisance have unit variance: with B = (jacobian, nuisance) and the ridge Λ = diag(0, 1) the
        residual's covariance is I + BΛ⁻¹Bᵀ, and what is left of r is (I − B(BᵀB + Λ)⁻¹Bᵀ)^½ r. ``alone``: the nuisance
        by itself, where that is known already.
        """
        columns, free = np.concatenate((jacobian, nuisance), axis=-1), jacobian.shape[-1]
        whole, root = _orthonormal(columns, np.where(np.arange(columns.shape[-1]) < free, 0.0, 1.0))
        basis, size = _turned(whole)
        correction = -np.asarray(np.linalg.solve(np.swapaxes(root, -1, -2), np.swapaxes(whole, -1, -2)))[:, :free]
        log_determinant = 2.0 * np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
        own = Nuisance.of(nuisance) if alone is None else alone
        return cls(raw, basis, 1.0 - np.sqrt(1.0 - size), correction, log_determinant, own)

    @cached_property
    def residual(self) -> Array:
        """(S, m) after the best (linear) change of every initial state."""
        return self.beyond(self.raw[..., None])[..., 0]

    @cached_property
    def costs(self) -> Array:
        """(S,) sum of squares of each segment from its initial state as it is, beyond what the nuisance explains.

        Infinite where a run leaves all bounds.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            found = np.sum(self.nuisance.beyond(self.raw[..., None]) ** 2, axis=(1, 2))
        return np.where(np.isfinite(found), found, np.inf)

    def beyond(self, columns: Array) -> Array:
        """What of (S, m, P) the initial states and the nuisance cannot explain."""
        return columns - self.basis @ (self.taken[..., None] * (np.swapaxes(self.basis, -1, -2) @ columns))

    def with_raw(self, raw: Array) -> Projection:
        """Other residuals (S, m), the same directions."""
        return replace(self, raw=raw)

    def subset(self, chosen: Mask) -> Projection:
        """Of the ``chosen`` (S,) segments alone."""
        own = {name: getattr(self, name)[chosen] for name in _BY_SEGMENT}
        return Projection(**own, nuisance=self.nuisance.subset(chosen))

    def with_subset(self, chosen: Mask, other: Projection) -> Projection:
        """These with ``other`` in the place of the ``chosen`` (S,) segments; the nuisance is the same."""
        values = {name: getattr(self, name).copy() for name in _BY_SEGMENT}
        for name, own in values.items():
            own[chosen] = getattr(other, name)
        return Projection(**values, nuisance=self.nuisance)


_BY_SEGMENT = [f.name for f in fields(Projection) if f.name != "nuisance"]
