"""Intervals by profile likelihood, where those of a normal distribution say nothing or the wrong thing.

A parameter that ended at a bound has no error to either side, and one that is known to a third of its value or worse
moves the residual so far that it is no longer straight. There the parameter is held further and further off while all
others are fitted anew: what lies within its 95 % interval costs no more than the interval of a normal distribution does
at its end (Venzon & Moolgavkar, Applied Statistics 37 (1988) 87–94; Raue et al., Bioinformatics 25 (2009) 1923–1929).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from .criteria import CRITERIA
from .linearisation import Linearisation
from .uncertainty import EXACT, Known, errors_beside, law_share

_NEAR = 0.25  # of the cost that is sought: near enough
_MOST_FITS = 3  # towards one end
_FURTHEST = 3.0  # times as far as before, or a third of it: no fit is further from the one before

Cost = Callable[[str, float], float]
"""By how much the sum of squares is larger with a parameter held at a value [SI], all others fitted anew."""


@dataclass(frozen=True)
class _Profile:
    """The cost of holding a parameter off its fitted ``value``, to first order of the residuals.

    That is 2·``slope``·d + ``curvature``·d² for d scales; ``limit``: the cost at the end of its interval.
    """

    value: float
    scale: float
    slope: float
    curvature: float
    limit: float

    def distance(self, side: float) -> float:
        """How many scales to that ``side`` (1 or -1) the limit is reached; infinite where nothing is known of it."""
        if not self.curvature > 0.0 or not math.isfinite(self.limit):
            return math.inf
        slope = max(side * self.slope, 0.0)  # a fit that stopped short goes downhill for a little
        return (math.sqrt(slope**2 + self.curvature * self.limit) - slope) / self.curvature


def with_profiles(
    at: Linearisation,
    known: Mapping[str, Known],
    named: Collection[str],
    cost: Cost,
    tolerances: Mapping[str, float] = EXACT,
) -> dict[str, Known]:
    """What is ``known`` of the fitted parameters, with the intervals of those at a bound or hardly known.

    Those that a verdict has ``named`` are fitted anew, by ``cost``; the others follow from the sensitivities.

    :param tolerances: as of `uncertainty.parameter_errors`
    """
    found = dict(known)
    for key, value in at.parameters.by_key.items():
        own = known[key]
        if own.at_bound is not None or not own.standard_error < CRITERIA.vague_value * abs(value):
            found[key] = replace(own, profile=_interval(at, key, cost if key in named else None, tolerances))
    return found


def _interval(
    at: Linearisation, key: str, cost: Cost | None, tolerances: Mapping[str, float]
) -> tuple[float, float]:
    """The 95 % interval of a parameter [SI], within its bounds; what its law may be off comes on top, as always."""
    profile, i = _profile(at, key, tolerances), at.parameters.keys.index(key)
    low, high = (float(bounds[i]) for bounds in (at.parameters.low, at.parameters.high))
    ends = []
    for side, bound in ((-1.0, low), (1.0, high)):
        end = _end(profile, key, side, bound, cost)
        end += side * 2.0 * law_share(at.model, key) * (abs(profile.value) or abs(end))
        ends.append(min(max(end, low), high))
    return ends[0], ends[1]


def _profile(at: Linearisation, key: str, tolerances: Mapping[str, float]) -> _Profile:
    parameters = at.parameters
    i, bound = parameters.keys.index(key), parameters.at_bound
    others = [k for k, name in enumerate(parameters.keys) if name not in bound and k != i]
    free = np.array([*others, i])
    normal = at.normal.subset(free).marginal(len(others))
    _, half = errors_beside(at, free, tolerances)
    curvature, slope = float(normal.information[0, 0]), float(normal.gradient[0])
    limit = float(half[-1]) ** 2 * curvature
    return _Profile(float(parameters.values[i]), float(parameters.scales[i]), slope, curvature, limit)


def _end(profile: _Profile, key: str, side: float, bound: float, cost: Cost | None) -> float:
    """Where the interval ends on one side [SI]: where holding the parameter costs the limit, or its bound."""
    room = abs(bound - profile.value) / profile.scale
    distance = min(profile.distance(side), room)
    if cost is None or not 0.0 < distance < math.inf or not math.isfinite(profile.limit):
        return profile.value + side * distance * profile.scale if math.isfinite(distance) else bound
    for _ in range(_MOST_FITS):
        paid = cost(key, profile.value + side * distance * profile.scale) / profile.limit
        if abs(paid - 1.0) < _NEAR or (paid < 1.0 and distance >= room):
            break
        times = 1.0 / math.sqrt(paid) if paid > 0.0 else _FURTHEST
        distance = min(distance * min(max(times, 1.0 / _FURTHEST), _FURTHEST), room)
    return profile.value + side * distance * profile.scale
