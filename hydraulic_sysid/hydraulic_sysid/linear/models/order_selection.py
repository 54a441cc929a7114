"""Which order the data ask for: Akaike's and Rissanen's criteria, final prediction error, cross-validation.

With d parameters, N samples and the mean squared error V of the fit, [1] section 16.4:

    FPE = V·(1 + d/N)/(1 − d/N),   AIC = N·ln V + 2·d,   BIC = N·ln V + d·ln N

Cross-validation cuts every experiment into consecutive parts, leaves out each in turn, and takes the mean squared
error in free run on what was left out. The first three ask for one-step accuracy and trust that the errors are white;
the last asks for what a simulation needs, and trusts nothing.

[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.errors import IdentificationError

from .structures import Structure, fit_on_equal_samples

CRITERIA = ("fpe", "aic", "bic", "cv")
_PARTS = 4


@dataclass(frozen=True)
class Candidate:
    """One order tried. ``cv`` [unit²] is infinite where a part could not be fitted or run free."""

    structure: Structure
    parameters: int
    loss: float
    fpe: float
    aic: float
    bic: float
    cv: float


def information_criteria(loss: float, parameters: int, samples: int) -> tuple[float, float]:
    """AIC and BIC of a fit with this mean squared error."""
    misfit = samples * float(np.log(max(loss, np.finfo(float).tiny)))
    return misfit + 2.0 * parameters, misfit + parameters * float(np.log(samples))


def try_orders(
    structures: Sequence[Structure], drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], dt: float, offsets: str
) -> list[Candidate]:
    """All structures that the data can give, compared on the same samples.

    :raises IdentificationError: none can be fitted; the text is that of the first.
    """
    memory = max(s.memory for s in structures)
    problem: IdentificationError | None = None
    found = []
    for structure in structures:
        try:
            model = fit_on_equal_samples(structure, drives, outputs, dt, offsets, memory)
        except IdentificationError as error:
            problem = problem or error
            continue
        aic, bic = information_criteria(model.loss, model.parameters, model.samples)
        fpe = metrics.fpe(model.loss, model.parameters, model.samples)
        cv = _cross_validated(structure, drives, outputs, dt, offsets)
        found.append(Candidate(structure, model.parameters, model.loss, fpe, aic, bic, cv))
    if not found:
        raise problem or IdentificationError("no order to try")
    return found


def best(candidates: Sequence[Candidate], criterion: str) -> Candidate:
    """The candidate of least ``criterion``, one of `CRITERIA`; of equals the one with fewer parameters.

    :raises IdentificationError: an unknown criterion, or it has no finite value.
    """
    if criterion not in CRITERIA:
        raise IdentificationError(f"criterion {criterion!r} is none of {', '.join(CRITERIA)}")
    usable = [c for c in candidates if np.isfinite(getattr(c, criterion))]
    if not usable:
        raise IdentificationError(f"no order has a finite {criterion}: take a longer record or another criterion")
    return min(usable, key=lambda c: (getattr(c, criterion), c.parameters))


def _cross_validated(
    structure: Structure, drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], dt: float, offsets: str
) -> float:
    us, ys = [np.asarray(u, dtype=float) for u in drives], [np.asarray(y, dtype=float) for y in outputs]
    squares, count = 0.0, 0
    for part in range(_PARTS):
        inside = [(round(u.size * part / _PARTS), round(u.size * (part + 1) / _PARTS)) for u in us]
        rest_u = [rest for u, (a, b) in zip(us, inside, strict=True) for rest in (u[:a], u[b:]) if rest.size]
        rest_y = [rest for y, (a, b) in zip(ys, inside, strict=True) for rest in (y[:a], y[b:]) if rest.size]
        try:
            model = structure.fit(rest_u, rest_y, dt, offsets)
        except IdentificationError:
            return float("inf")
        for u, y, (a, b) in zip(us, ys, inside, strict=True):
            left = y[a:b] - model.simulate(u[a:b], y[a:b])
            squares += float(np.sum(left**2)) if np.isfinite(left).all() else float("inf")
            count += b - a
    return squares / count
