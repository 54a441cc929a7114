"""How probable it is that the library holds no law that is right, by what is left when the most was explained."""

from __future__ import annotations

from .criteria import CRITERIA, Criteria
from .misfit import Misfit


def probability_of_unknown(before: Misfit, after: Misfit, criteria: Criteria = CRITERIA) -> float:
    """That the library lacks the law that is right, by what is left after most was explained."""
    left, explained = after.variance - 1.0, max(before.variance - after.variance, 0.0)
    missed = criteria.noise_missed + criteria.unknown_laws * explained
    odds = (1.0 + left / missed) / criteria.odds
    return odds / (1.0 + odds)
