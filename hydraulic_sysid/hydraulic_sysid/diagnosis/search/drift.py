"""Whether a parameter changes along the records: oil that warms up, a seal that runs in, an amplifier that drifts.

A fit gives one value for all of a record, and a law may be a little off in every segment, so that a slow change hides
in both. It is a line through the segments that shows it: how the residual changes with a parameter, times the time
since the middle of the record, is tested as one more parameter would be (score test; Nyblom, J. Amer. Statist. Assoc.
84 (1989) 223, asks the same of the scores' sums).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sysid.estimation.refinement import LAW

from .agreement import sure
from .linearisation import Linearisation

LEAST = LAW * 12.0**0.5  # of a parameter over a record: then its root mean square is what a law may be off anyway


@dataclass(frozen=True)
class Drift:
    """A parameter that is not the same at the end of a record as at its beginning.

    ``change`` [SI] over a whole record, to first order; ``share``: of the value's distance from where it does nothing.
    """

    key: str
    value: float
    change: float
    standard_error: float
    share: float


def drift(at: Linearisation, least: float) -> Drift | None:
    """The parameter whose change along the records explains most of what a model leaves, if that is more than chance.

    And more than laws may be off anyway, and if segments agree on it. ``least``: reduction of the sum of squares.
    """
    parameters, columns = at.parameters, at.columns
    laws = [j for j, key in enumerate(parameters.keys) if not at.model.parameter(key).nuisance]
    if not laws:
        return None
    late = [
        ((s.first + 0.5 * s.samples) / len(s.record) - 0.5)[:, None, None] * c[..., laws]
        for s, c in zip(at.split.segments, columns, strict=True)
    ]
    trends, size = at.point.beyond(late), len(parameters)
    information = at.bordered(late).information
    own = np.linalg.pinv(information[:size, :size], rcond=1e-12, hermitian=True) @ information[:size, size:]
    fitted = np.concatenate(at.split.fit)
    found = []
    for place, j in enumerate(laws):
        seen = [t[..., place] - b @ own[:, place] for t, b in zip(trends, at.beyond, strict=True)]
        along = np.concatenate([np.sum(r * x, axis=1) for r, x in zip(at.residual, seen, strict=True)])
        squares = np.concatenate([np.sum(x**2, axis=1) for x in seen])
        total = float(squares[fitted].sum())
        if total > 0.0:
            slope = -float(along[fitted].sum()) / total
            found.append((slope**2 * total, j, slope, total, sure(-slope * along, slope**2 * squares, fitted)))
    if not found:
        return None
    reduction, j, slope, total, agreed = max(found)
    key, value, scale = parameters.keys[j], float(parameters.values[j]), float(parameters.scales[j])
    share = slope * scale / max(abs(value - (at.model.parameter(key).null or 0.0)), LEAST * scale)
    if not agreed or reduction < least or abs(share) < LEAST:
        return None
    return Drift(key, value, slope * scale, scale / total**0.5, share)

