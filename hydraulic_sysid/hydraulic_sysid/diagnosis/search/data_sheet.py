"""Numbers of a data sheet that the records contradict.

A fixed value of the model file is not the truth: a gauge, a drawing or a guess stands behind it. In a search every such
number may move within its tolerance, so that no effect is named for what a number explains; in the end the few numbers
that have to move are named, by the cost of holding the others.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model import Model
from hydraulic_sysid.estimation.covariance import inverse
from hydraulic_sysid.estimation.parameters import Priors

from .candidates import inverse as inverse_to
from .criteria import CRITERIA
from .linearisation import Linearisation
from .uncertainty import Known

TOLERANCES = {"Pa": 0.06, "m^2": 0.04, "m^3": 0.5, "kg": 1.0, "m^3/s": 1.0}
"""Share by which a number of this unit may be off where its file gives no bounds."""
LEAST_PRESSURE = 1e5  # Pa, of a tank pressure near 0
NAMED = ("piston_area_a", "piston_area_b", "dead_volume_a", "dead_volume_b", "supply_pressure", "tank_pressure")
"""Base parameters that a data sheet states and a diagnosis leaves as they are."""


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


def stretched(given: Model) -> list[str]:
    """Free parameters of a model that go beyond their bounds in the `relaxed` one."""
    loose = relaxed(given)
    return [k for k in given.free_keys() if k in given.entries and loose.entries[k] != given.entries[k]]


def priors(given: Model) -> Priors:
    """What is known beforehand: a model file's numbers, with bounds or tolerance as two standard deviations.

    An effect that is not in the file, and whose size is a share of something, is as large as the library's default, or
    a few times that: a sensor's scale is not off by a third.
    """
    loose, found = relaxed(given), {}
    for effect in given.library.values():
        for p in () if effect.name in given.effects else effect.parameters:
            if p.unit == "1" and p.null not in (None, p.default) and not inverse_to(p.null, p.default):
                found[f"{effect.name}.{p.name}"] = (p.null, CRITERIA.plausible * abs(p.default - p.null))
    for key in loose.free_keys():
        own = given.entries.get(key)
        if "." not in key and own is not None and own.value > 0.0:
            low, high = own.bounds or loose.entry(key).bounds or (0.0, np.inf)
            if np.isfinite(high - low):
                found[key] = (own.value, 0.25 * (high - low))
    return found


def tolerances(given: Model) -> dict[str, float]:
    """By how much numbers of the data sheet may be off: standard deviations [SI, by key]."""
    return {key: std for key, (_, std) in priors(given).items() if "." not in key}


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


@dataclass(frozen=True)
class HeldNumbers:
    """What it costs to hold numbers at what the model file says, by the quadratic around a fit of a `relaxed` model.

    ``values`` (n,) of ``keys`` as fitted, with their covariance ``cover`` (n, n), and the ``nominal`` ones (n,) [SI].
    """

    keys: tuple[str, ...]
    values: Array
    nominal: Array
    cover: Array

    @classmethod
    def of(cls, at: Linearisation, given: Model) -> HeldNumbers:
        """Numbers of ``given`` that are others in the fit ``at``."""
        parameters, loose = at.parameters, relaxed(given)
        changed = [k for k, e in loose.entries.items() if e != given.entries.get(k) and k in parameters.keys]
        fitted = {k: float(parameters.values[parameters.keys.index(k)]) for k in changed}
        keys = tuple(k for k in changed if _nearest(given, k, fitted[k]) != fitted[k])
        place = [parameters.keys.index(k) for k in keys]
        scales = parameters.scales[place]
        cover = inverse(at.normal.information)[np.ix_(place, place)] * np.outer(scales, scales)
        nominal = np.array([_nearest(given, k, fitted[k]) for k in keys])
        return cls(keys, np.array([fitted[k] for k in keys]), nominal, cover)

    def cost(self, moved: Collection[str]) -> float:
        """Sum of squares that it costs to hold all but these."""
        held = [i for i, key in enumerate(self.keys) if key not in moved]
        off = (self.nominal - self.values)[held]
        scale = np.sqrt(np.maximum(np.diag(self.cover)[held], 1e-300))
        correlation = self.cover[np.ix_(held, held)] / np.outer(scale, scale)
        return float(off / scale @ np.linalg.pinv(correlation, hermitian=True) @ (off / scale)) if held else 0.0

    def fewest(self, enough: float, perhaps: float) -> Iterator[tuple[str, ...]]:
        """The fewest numbers that have to move for the others to cost less than ``perhaps``, then more and more.

        The quadratic may be far off, as where a piston meets its stop: until one costs less than ``enough``, each set
        costs less than half of the one before.
        """
        before = 2.0 * perhaps
        for size in range(len(self.keys) + 1):
            best = min(combinations(self.keys, size), key=self.cost)
            if self.cost(best) < max(enough, 0.5 * before):
                before = self.cost(best)
                yield best

    def deviation(self, key: str, moved: Collection[str], value: float) -> Deviation:
        """One of the numbers ``moved`` [SI], with the error that it has where all of them are free."""
        i, others = self.keys.index(key), [k for k in moved if k != key]
        error = math.sqrt(max(float(self.cover[i, i]), 0.0))
        return Deviation(key, float(self.nominal[i]), value, error, self.cost(others) - self.cost(moved))

    def instead(self, key: str, moved: Sequence[str], enough: float) -> list[tuple[str, ...]]:
        """Sets with another number in the place of ``key``, of those ``moved``, that may cost as little.

        That is ``enough`` more, or the share of what the number explains by which a quadratic may be off.
        """
        others = [k for k in moved if k != key]
        swapped = [(*others, other) for other in self.keys if other not in moved]
        least = self.cost(moved)
        near = [s for s in swapped if self.cost(s) - least < max(enough, CRITERIA.rough * (self.cost(others) - least))]
        return sorted(near, key=self.cost)


def significant(cost: float, count: int, variance: float) -> bool:
    """Whether a reduction of the sum of squares of ``count`` values is enough for a number to be named."""
    return cost > least_cost(count, variance)


def least_cost(count: int, variance: float) -> float:
    """The smallest reduction of the sum of squares of ``count`` values for which a number is named."""
    return max(CRITERIA.significant, CRITERIA.number_visible * count) * variance


def _nearest(given: Model, key: str, value: float) -> float:
    """What the model file says of a number: itself, or the end of the range it allows."""
    entry = given.entry(key)
    if not entry.free or entry.bounds is None:
        return given.value(key)
    return min(max(value, entry.bounds[0]), entry.bounds[1])
