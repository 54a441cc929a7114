"""How well the parameters of a fitted model are known, when no model is exact.

The scores of segments, and of whole records, are taken as independent clusters (`estimation.covariance`); the larger
error of the two counts. What a record says of a parameter depends on its experiment where the law of an effect is not
quite the true one; the scatter between records then holds that too. What all records share of that they cannot show: no
law of a library is that of a bench. It is taken to be much larger than the scatter, and never less than a share of the
value (a model discrepancy in the sense of Kennedy & O'Hagan, J. R. Statist. Soc. B 63 (2001)). The laws of effects are
the rougher ones, and what shapes them is the roughest; numbers of a data sheet are of gauges and drawings, not of laws.
Both were chosen on 47 parameters of effects of the seeds 104001 to 106001 (others: docs/diagnosis-matrix.md).
Numbers of the data sheet that a fit holds are not exact either: what they may be off within their tolerance moves the
parameters, and is in the errors (their covariance with all of them free under their priors, less that of the fit).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.effect import Effect
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.covariance import inverse, sandwich

from .criteria import CRITERIA
from .linearisation import Linearisation

_COVERED = 0.95
_STEP = 0.25  # of a tolerance: how far a held number is moved to see what it changes
EXACT: Mapping[str, float] = MappingProxyType({})
"""Tolerances of a data sheet that is taken for the truth."""


@dataclass(frozen=True)
class Known:
    """Standard error and half width of the 95 % interval [SI]; infinite where the data do not determine it.

    ``profile``: the ends of the interval where that is not so wide to both sides (`profile_likelihood`).
    """

    standard_error: float
    half_width: float
    at_bound: str | None
    profile: tuple[float, float] | None = None

    def interval(self, value: float) -> tuple[float, float]:
        """The 95 % interval of a parameter with this value [SI]."""
        low, high = self.profile or (value - self.half_width, value + self.half_width)
        return min(low, value), max(high, value)


def parameter_errors(
    at: Linearisation, tolerances: Mapping[str, float] = EXACT, shared: float = CRITERIA.shared
) -> dict[str, Known]:
    """By key, of all parameters that were fitted. One at a bound counts as fixed there.

    ``tolerances``: by how much numbers may be off that were not fitted (standard deviation) [SI, by key].
    """
    parameters, at_bound = at.parameters, at.parameters.at_bound
    free = np.flatnonzero([k not in at_bound for k in parameters.keys])
    errors, widths = np.full((2, len(parameters)), np.inf)
    if free.size:
        errors[free], widths[free] = errors_beside(at, free, tolerances, shared)
    found = {}
    for key, error, width, value, scale in zip(
        parameters.keys, errors.tolist(), widths.tolist(), parameters.values.tolist(), parameters.scales, strict=True
    ):
        law = law_share(at.model, key) * abs(value)
        known = error < 1e3
        found[key] = Known(
            math.hypot(error * scale, law) if known else math.inf,
            width * scale + 2.0 * law if known else math.inf,
            at_bound.get(key),
        )
    return found


def may_be_nothing(at: Linearisation, effect: Effect) -> bool:
    """Whether an effect of a fitted model may as well be absent: every interval of a size of it holds its null value.

    A law that is there has much the same size in all segments; one that only follows what another does has not, and
    then its error by their scatter is as large as it is. One at a bound is no matter of that.
    """
    known = parameter_errors(at, shared=1.0)
    nulls = {f"{effect.name}.{p.name}": p.null for p in effect.parameters if p.null is not None}
    sized = {key: null for key, null in nulls.items() if key in known}
    return bool(sized) and all(
        known[k].at_bound is None and abs(at.model.value(k) - null) <= known[k].half_width for k, null in sized.items()
    )


def errors_beside(
    at: Linearisation, free: Index, tolerances: Mapping[str, float], shared: float = CRITERIA.shared
) -> tuple[Array, Array]:
    """Standard errors (F,) and half widths (F,) of 95 % of the parameters ``free``, the others held, of their scales.

    `law_share` is not in them.
    """
    normal = at.normal.subset(free)
    bread = inverse(normal.information)
    times = np.array([shared if "." in at.parameters.keys[k] else 1.0 for k in free])
    own, half = (times * each for each in _errors(bread, normal.scores))
    sheet = _of_held(at, free, bread, tolerances)
    return np.hypot(own, sheet), np.hypot(half, norm.ppf(0.5 + 0.5 * _COVERED) * sheet)


def law_share(model: Model, key: str) -> float:
    """Standard error of a parameter for the law that it stands in, of its value; gauges and drawings tell of no law."""
    record = model.parameter(key)
    if "." not in key:
        return CRITERIA.law_error if record.free or record.nuisance else 0.0
    return CRITERIA.shape_error if record.null is None else CRITERIA.law_error


def _of_held(at: Linearisation, free: Index, bread: Array, tolerances: Mapping[str, float]) -> Array:
    """Standard errors (F,) of these parameters, of their scales, from the numbers that were held.

    ``bread`` (F, F): their covariance where nothing else may be off.
    """
    held = {k: s for k, s in tolerances.items() if k not in at.parameters.keys}
    if not held:
        return np.zeros(free.size)
    model, fitted = at.model, len(at.parameters)
    moved = [model.with_values({k: model.value(k) + _STEP * s}) for k, s in held.items()]
    try:
        columns = [c / _STEP for c in at.changes([Plant.for_fits(m) for m in moved])]
    except SimulationError:  # it does not run with one of them
        return np.zeros(free.size)
    information = at.bordered(columns).information
    information[fitted:, fitted:] += np.eye(len(held))
    every = np.concatenate((free, fitted + np.arange(len(held))))
    both = inverse(information[np.ix_(every, every)])
    return np.sqrt(np.maximum(np.diag(both)[: free.size] - np.diag(bread), 0.0))


def _errors(bread: Array, scores: Sequence[Array]) -> tuple[Array, Array]:
    """Standard errors (P,) and half widths (P,) of the 95 % intervals, by segments and by records."""
    clusters = [np.concatenate(scores)]
    if len(scores) >= CRITERIA.several_records:
        clusters.append(np.array([s.sum(axis=0) for s in scores]))
    variances = [np.diag(sandwich(bread, c)) for c in clusters]
    variances[0] = np.maximum(variances[0], np.diag(bread))
    errors = np.sqrt(variances)
    times = [student.ppf(0.5 + 0.5 * _COVERED, max(len(c) - 1, 1)) for c in clusters]
    return errors.max(axis=0), (errors * np.array(times)[:, None]).max(axis=0)
