"""Whether a parameter changes along the records: oil that warms up, a seal that runs in, an amplifier that drifts.

A fit gives one value for all of a record, and a law may be a little off in every segment, so that a slow change hides
in both. It is a line through the segments that shows it: how the residual changes with a parameter, times the time
since the middle of the record, is tested as one more parameter would be (score test; Nyblom, J. Amer. Statist. Assoc.
84 (1989) 223, asks the same of the scores' sums).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sysid.estimation.refinement import LAW

from .agreement import agreement, sure
from .criteria import CRITERIA
from .linearisation import Linearisation
from .misfit import but_the_worst

LEAST = LAW * 12.0**0.5  # of a parameter over a record: then its root mean square is what a law may be off anyway


@dataclass(frozen=True)
class Drift:
    """A parameter that is not the same at the end of a record as at its beginning.

    ``change`` [SI] over a whole record, to first order; ``share``: of the value's distance from where it does nothing;
    ``explained``: by how much it lowers the sum of squares over noise, to first order.
    """

    key: str
    value: float
    change: float
    standard_error: float
    share: float
    explained: float


def drift(at: Linearisation, least: float) -> Drift | None:
    """The parameter whose change along the records explains most of what a model leaves, if that is more than chance.

    And more than laws may be off anyway, and if segments agree on it; a smaller one, or one that laws that may be off
    in every segment take up, where records agree, too. ``least``: reduction of the sum of squares.
    """
    parameters, columns = at.parameters, at.columns
    angles = np.isfinite(parameters.period)  # one that goes round is a frequency that is another
    laws = [j for j, k in enumerate(parameters.keys) if not (at.model.parameter(k).nuisance or angles[j])]
    if not laws:
        return None
    late = [
        ((s.first + 0.5 * s.samples) / len(s.record) - 0.5)[:, None, None] * c[..., laws]
        for s, c in zip(at.split.segments, columns, strict=True)
    ]
    first = len(parameters)
    information = at.bordered(late).information
    own = np.linalg.pinv(information[:first, :first], rcond=1e-12, hermitian=True) @ information[:first, first:]
    # What of the lines neither initial states nor other values of the parameters can explain.
    lines = at.point.beyond([line - c @ own for line, c in zip(late, columns, strict=True)])
    along = np.concatenate([np.einsum("smq,sm->sq", x, r) for x, r in zip(lines, at.residual, strict=True)])
    squares = np.concatenate([np.sum(x**2, axis=1) for x in lines])
    fitted = np.concatenate(at.split.fit)
    total = np.maximum(squares[fitted].sum(axis=0), 1e-300)
    slope = -along[fitted].sum(axis=0) / total
    best = int(np.argmax(slope**2 * total))
    j, by, size = laws[best], float(slope[best]), float(total[best])
    key, value, scale = parameters.keys[j], float(parameters.values[j]), float(parameters.scales[j])
    share = by * scale / max(abs(value - (at.model.parameter(key).null or 0.0)), LEAST * scale)
    gains, sizes = -by * along[:, best], by**2 * squares[:, best]
    large = by**2 * size >= least and abs(share) >= LEAST and sure(gains, sizes, fitted)
    records = np.repeat(np.arange(len(late)), [len(x) for x in late])
    if not large and (abs(share) < LAW or not steady(gains, sizes, fitted, records)):
        return None
    return Drift(key, value, by * scale, scale / size**0.5, share, float(np.sum(2.0 * gains - sizes)))


def steady(own: Array, size: Array, fitted: Mask, records: Index) -> bool:
    """Whether segments agree on a change, but for the few that differ most, and so do records.

    ``own``, ``size``, ``fitted`` (S,) as `agreement` takes them, and which of the ``records`` (S,) each is of. What a
    law lacks may follow the time in a sweep; it does not in records of several kinds.
    """
    off = np.abs(own - size * own.sum() / max(float(size.sum()), np.finfo(float).tiny))
    kept = but_the_worst(off, np.ones(off.size))
    in_records = [np.bincount(records[kept], weights=x[kept]).astype(float) for x in (own, size)]
    few = np.count_nonzero(in_records[1]) < CRITERIA.several_records
    if few or agreement(in_records[0], in_records[1]) < CRITERIA.records_agree:
        return False
    return sure(own[kept], size[kept], fitted[kept])
