"""Which unit of a fleet is not one of the others, and with what probability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from hydraulic_sim.arrays import Array

from .random_effects import pooled

ODD = 0.05
"""Probability, before any measurement, that a unit is out of family in a parameter; half and double it: the odds halve
and double."""
WIDER = 10.0
"""Standard deviation of units that are out of family, over that of the family: far off, in either direction."""
_SMALLEST = 4


@dataclass(frozen=True)
class Member:
    """A unit beside the others: how far off in standard deviations, and the probability that it is none of them."""

    unit: str
    value: float
    error: float
    distance: float
    probability: float


def members(units: list[str], values: Array, errors: Array) -> list[Member]:
    """Each unit, of at least four, beside the family of the others: ``values`` (n,) with standard ``errors`` (n,).

    The family is pooled without the unit itself and without the one that lies farthest from it, which may be out of
    family too. The probability is Bayes' of two Student distributions, the second `WIDER` times as wide, `ODD` before.

    :raises ValueError: fewer than four units.
    """
    if len(units) < _SMALLEST:
        raise ValueError(f"{len(units)} units make no family; at least {_SMALLEST} are needed")
    found = []
    for i, unit in enumerate(units):
        others = np.array([j for j in range(len(units)) if j != i])
        if len(others) > _SMALLEST:
            centre = float(np.median(values[others]))
            others = np.delete(others, int(np.argmax(np.abs(values[others] - centre))))
        family = pooled(values[others], errors[others])
        distance = family.distance(float(values[i]), float(errors[i]))
        freedom = family.count - 1
        usual = stats.t.pdf(distance, freedom)
        unusual = stats.t.pdf(distance / WIDER, freedom) / WIDER
        odds = ODD * unusual / ((1.0 - ODD) * usual)
        found.append(Member(unit, float(values[i]), float(errors[i]), distance, float(odds / (1.0 + odds))))
    return found
