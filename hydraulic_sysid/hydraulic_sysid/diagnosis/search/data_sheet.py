"""Numbers of a data sheet that the records contradict.

A fixed value of the model file is not the truth: a gauge, a drawing or a guess stands behind it. In a search every such
number may move within its tolerance, so that no effect is named for what a number explains; in the end the few numbers
that have to move are named, by the cost of holding the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sysid.estimation.covariance import inverse
from hydraulic_sysid.estimation.parameters import Priors

from .linearisation import Linearisation
from .uncertainty import Known

TOLERANCES = {"Pa": 0.06, "m^2": 0.04, "m^3": 0.5, "kg": 1.0, "m^3/s": 1.0}
"""Share by which a number of this unit may be off where its file gives no bounds."""
LEAST_PRESSURE = 1e5  # Pa, of a tank pressure near 0
NAMED = ("piston_area_a", "piston_area_b", "dead_volume_a", "dead_volume_b", "supply_pressure", "tank_pressure")
"""Base parameters that a data sheet states and a diagnosis leaves as they are."""
SIGNIFICANT = 25.0  # reduction of the sum of squares, of the variance, for which a number is named …
SURE = 2.0  # standard errors by which a number must be off to be named
VISIBLE = 0.01  # … at least this share of the number of residuals


@dataclass(frozen=True)
class Deviation:
    """A number of the model file that the records contradict [SI]; ``cost``: sum of squares that keeping it costs.

    ``instead``: effects, and ``alternatives``: other numbers, that would explain the same.
    """

    key: str
    nominal: float
    value: float
    standard_error: float
    cost: float
    instead: tuple[str, ...] = ()
    alternatives: tuple[Deviation, ...] = ()

    @property
    def sure(self) -> bool:
        """Whether it is another number than that of the model file, beyond its error."""
        return abs(self.value - self.nominal) > SURE * self.standard_error


def with_error(deviation: Deviation, known: Mapping[str, Known]) -> Deviation:
    """With the standard error that the parameters have, where the records determine the number."""
    error = known[deviation.key].standard_error
    return replace(deviation, standard_error=error) if math.isfinite(error) else deviation


def relaxed(model: Model) -> Model:
    """The model, its data-sheet numbers free within their tolerances, and free base parameters beyond their bounds."""
    for key in model.keys():  # noqa: SIM118, a method of the model
        own, record, value = model.entries.get(key), model.parameter(key), model.value(key)
        share = TOLERANCES.get(record.unit)
        if own is None or share is None or "." in key:
            continue
        if key in NAMED and own.free is None:
            reach = max(share * abs(value), LEAST_PRESSURE if record.unit == "Pa" else 0.0)
            low, high = own.bounds or (value - reach, value + reach)
        elif model.entry(key).free and own.bounds is not None:
            low, high = own.bounds[0] / (1.0 + share), own.bounds[1] * (1.0 + share)
        else:
            continue
        bounds = (max(low, record.bounds[0]), min(high, record.bounds[1]))
        model = model.with_entry(key, free=True, bounds=bounds)
    return model


def priors(given: Model) -> Priors:
    """What a model file says of its numbers: its value, and bounds or tolerance as two standard deviations."""
    loose, found = relaxed(given), {}
    for key in loose.free_keys():
        own = given.entries.get(key)
        if "." not in key and own is not None and own.value > 0.0:
            low, high = own.bounds or loose.entry(key).bounds or (0.0, np.inf)
            if np.isfinite(high - low):
                found[key] = (own.value, 0.25 * (high - low))
    return found


def restored(model: Model, given: Model, moved: Sequence[str]) -> Model:
    """A fitted model with the data sheet as it was ``given``, but for the numbers that have ``moved``."""
    loose = relaxed(given)
    for key, entry in loose.entries.items():
        if entry == given.entries.get(key):
            continue
        own = given.entries[key]
        if key in moved:
            model = model.with_entry(key, free=True, bounds=entry.bounds)
        elif own.free is None and not given.entry(key).free:
            model = model.with_entry(key, value=own.value, free=own.free, bounds=own.bounds, source=own.source)
        else:
            low, high = own.bounds or given.entry(key).bounds or (-np.inf, np.inf)
            model = model.with_entry(key, value=min(max(model.value(key), low), high), bounds=own.bounds)
    return model


def as_filed(model: Model, filed: Model) -> Model:
    """A fitted model whose parameters may move as far as they may in its file: a search lets them move further.

    Bounds that a fitted value lies beyond are left out.
    """
    for key, own in model.entries.items():
        if key in filed.entries:
            free, bounds = filed.entries[key].free, filed.entries[key].bounds
            outside = bounds is not None and not bounds[0] <= own.value <= bounds[1]
            model = model.with_entry(key, free=free, bounds=None if outside else bounds)
    return model


def suspects(at: Linearisation, given: Model, named: Sequence[str]) -> list[Deviation]:
    """Numbers of ``given`` whose release beside those ``named`` promises most, the best first.

    ``at``: a fit of a `relaxed` model. What holding numbers costs is that of the quadratic around the fit.
    """
    parameters, loose = at.parameters, relaxed(given)
    changed = [k for k, e in loose.entries.items() if e != given.entries.get(k) and k in parameters.keys]
    keys = [k for k in changed if k not in named]
    place = [parameters.keys.index(k) for k in keys]
    cover, values = inverse(at.normal.information), parameters.values[place]
    nominal = np.array([_nearest(given, k, v) for k, v in zip(keys, values.tolist(), strict=True)])
    off = (nominal - values) / parameters.scales[place]
    errors = np.sqrt(np.maximum(np.diag(cover)[place], 0.0)) * parameters.scales[place]

    def cost(of: Sequence[int]) -> float:
        chosen = [place[i] for i in of]
        return float(off[of] @ np.linalg.pinv(cover[np.ix_(chosen, chosen)], hermitian=True) @ off[of]) if of else 0.0

    held = list(range(len(keys)))
    every = cost(held)
    found = [
        Deviation(key, float(n), float(v), float(e), every - cost([h for h in held if h != i]))
        for i, (key, n, v, e) in enumerate(zip(keys, nominal, values, errors, strict=True))
        if n != v
    ]
    return sorted(found, key=lambda d: -d.cost)


def significant(cost: float, count: int, variance: float) -> bool:
    """Whether a reduction of the sum of squares of ``count`` values is enough for a number to be named."""
    return cost > max(SIGNIFICANT, VISIBLE * count) * variance


def _nearest(given: Model, key: str, value: float) -> float:
    """What the model file says of a number: itself, or the end of the range it allows."""
    entry = given.entry(key)
    if not entry.free or entry.bounds is None:
        return given.value(key)
    return min(max(value, entry.bounds[0]), entry.bounds[1])
