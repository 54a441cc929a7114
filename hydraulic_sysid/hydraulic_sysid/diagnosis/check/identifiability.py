"""Which free parameters the records cannot identify, from one linearisation of the model as it is.

The errors are those of an exact model whose sensors have white noise, and whose laws are off by 3 % of themselves in
every segment, as no law is quite that of a bench: what cannot be identified then cannot be identified at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import quantity
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.errors import CalibrationError, SegmentError
from hydraulic_sysid.estimation.fit import FitPoint
from hydraulic_sysid.estimation.parameters import bounded
from hydraulic_sysid.estimation.refinement import LAW
from hydraulic_sysid.estimation.segments import cut, spread
from hydraulic_sysid.estimation.uncertainty import VAGUE, attainable

from .finding import NOT_IDENTIFIABLE, NOTE, Finding

_MOST = 60  # segments that are linearised, spread over all records
_SAME = 0.9999  # correlation under white noise alone: the influences of the two are one to about a hundredth
_ALIKE = (
    0.95  # correlation where one of the two is not identifiable: fixing the other makes it three times better known
)


def not_identifiable(
    model: Model, records: Sequence[Record], length: float, keys: Sequence[str] | None = None
) -> list[Finding]:
    """Parameters (by default the free ones) whose standard error exceeds half the width of their bounds, and pairs.

    :raises CalibrationError: a key that is not in the model.
    """
    model = bounded(model)
    keys = model.free_keys() if keys is None else tuple(dict.fromkeys(keys))
    in_use = model.keys()
    unknown = [k for k in keys if k not in in_use]
    if unknown:
        raise CalibrationError(f"{', '.join(unknown)}: not in the model; it has: {', '.join(in_use)}")
    if not keys:
        return []
    try:
        segments = cut(records, model.kind, length)
        point = FitPoint.begin(Plant.for_fits(model), spread(segments, _MOST), keys)
        share = sum(map(len, point.shooting.segments)) / sum(map(len, segments))
        known = attainable(with_laws_off(point), point.columns, share)
        same = attainable(point, point.columns, share).correlation
    except (SegmentError, SimulationError) as error:
        text = f"The model cannot be linearised along the records: {error}."
        return [Finding("linearisation", "model", NOTE, text, "Mend what else was found first.")]
    vague = [k for k in keys if known.standard_errors[k] > _allowed(model, k)]
    return [_alone(model, key, known.standard_errors[key]) for key in vague] + _pairs(
        keys, vague, known.correlation, same
    )


def with_laws_off(point: FitPoint) -> FitPoint:
    """The same point; the law of every parameter may be off by `LAW` of itself in each segment."""
    parameters = point.parameters
    off = np.where(parameters.turning > 0.0, 0.0, parameters.values / parameters.scales * LAW)
    segments = [
        replace(s, nuisance=c[:, : s.samples * len(s.channels)] * off)
        for s, c in zip(point.shooting.segments, point.columns, strict=True)
    ]
    return point.settled(replace(point.shooting, segments=segments), parameters)


def _allowed(model: Model, key: str) -> float:
    """Half the width of the bounds that the file gives, else half of the parameter's size."""
    own = model.entries.get(key)
    if own is not None and own.bounds is not None:
        return 0.5 * (own.bounds[1] - own.bounds[0])
    return VAGUE * (abs(model.value(key)) or abs(model.parameter(key).default))


def _alone(model: Model, key: str, error: float) -> Finding:
    unit, value = model.parameter(key).unit, model.value(key)
    size = f"known to ± {quantity(error, unit, 2)} at best" if np.isfinite(error) else "without any influence"
    text = f"{key} ({quantity(value, unit)}) is {size} from these records."
    remedy = "Fix it in the model file (fit: fixed), or record what excites it: next_experiment designs that."
    return Finding("identifiability", key, NOT_IDENTIFIABLE, text, remedy, error, value, unit)


def _pairs(keys: Sequence[str], vague: Sequence[str], correlation: Array, same: Array) -> list[Finding]:
    """Pairs of which the records know a combination alone."""
    found = []
    for i, j in zip(*np.triu_indices(len(keys), 1), strict=True):
        pair = keys[i], keys[j]
        hidden = abs(correlation[i, j]) > _ALIKE and not {*pair}.isdisjoint(vague)
        if hidden or abs(same[i, j]) > _SAME:
            together = float(correlation[i, j] if hidden else same[i, j])
            text = f"{pair[0]} and {pair[1]} act alike on these records: their errors correlate by {together:.4f}."
            remedy = "Fix one of the two, or record what distinguishes them."
            found.append(Finding("collinear", ", ".join(pair), NOT_IDENTIFIABLE, text, remedy, together))
    return found
