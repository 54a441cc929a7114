"""What linear unknowns explain is taken out of residuals and sensitivities (variable projection).

The initial states of segments, and all of a linear model but its denominator, are eliminated in this way at every step
of a fit: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432; Kaufman, BIT 15 (1975) 49–57.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array, Mask


def project_out(basis: Array, values: Array) -> Array:
    """``values`` (…, m, P) without what the orthonormal columns of ``basis`` (…, m, F) explain."""
    return values - basis @ (np.swapaxes(basis, -1, -2) @ values)


@dataclass(frozen=True)
class Projection:
    """Residuals of one record's segments, the initial states eliminated.

    ``raw`` (S, m): measured − simulated in units of the noise, priors of the initial states appended; ``basis``
    (S, m, F) orthonormal columns of what the initial states can explain; ``correction`` (S, F, m) the change of the
    initial states that a residual asks for.
    """

    raw: Array
    basis: Array
    correction: Array

    @classmethod
    def of(cls, raw: Array, jacobian: Array) -> Projection:
        """From the residuals and their derivatives (S, m, F) by the initial states."""
        basis, triangle = np.linalg.qr(jacobian)
        return cls(raw, basis, -np.linalg.solve(triangle, np.swapaxes(basis, -1, -2)))

    @cached_property
    def residual(self) -> Array:
        """(S, m) after the best (linear) change of every initial state."""
        return self.beyond(self.raw[..., None])[..., 0]

    def beyond(self, columns: Array) -> Array:
        """What of (S, m, P) the initial states cannot explain."""
        return project_out(self.basis, columns)

    def subset(self, chosen: Mask) -> Projection:
        """Of the ``chosen`` (S,) segments alone."""
        return Projection(self.raw[chosen], self.basis[chosen], self.correction[chosen])
