"""What else could be meant: models with another effect in the place of one, and whether these data distinguish them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant

from .criteria import CRITERIA
from .linearisation import Linearisation
from .misfit import Misfit
from .search_state import CandidateRefit, SearchState

_MOST = 5


@dataclass(frozen=True)
class CompetingModel:
    """A model with the effect ``name`` in another's place.

    ``difference``: how much larger its sum of squares is, and ``odds`` of the other against it; ``collinearity``:
    cosine between what the two effects change in the residuals beyond all free parameters; 1: the same. ``finished``:
    whether it was fitted to the end, not only with sensitivities that are held.
    """

    name: str
    model: Model
    misfit: Misfit
    difference: float
    odds: float
    collinearity: float
    finished: bool = False

    @property
    def distinguishable(self) -> bool:
        """Whether the data decide against it."""
        return self.odds > CRITERIA.odds


def nearest(name: str, without: SearchState) -> list[CandidateRefit]:
    """What comes nearest in the place of ``name``, which is empty in ``without``."""
    return without.others(name)[:_MOST]


def told_apart(final: Misfit, other: Misfit) -> bool:
    """Whether the data decide against a model that leaves ``other``."""
    return odds(final, other.total - final.total) > CRITERIA.odds


def odds(misfit: Misfit, difference: float) -> float:
    """Of a model that leaves ``misfit`` against one that leaves this ``difference`` more of the sum of squares."""
    needed = CRITERIA.distinct * misfit.variance + CRITERIA.law * misfit.excess
    return float(CRITERIA.odds ** min(max(difference / needed, -CRITERIA.most_power), CRITERIA.most_power))


def competing_models(name: str, without: SearchState, final: Misfit) -> list[CompetingModel]:
    """The competitors of ``name``, whose place in the fitted model is empty in ``without``; the closest first."""
    own = next((r.refit.model for r in without.refits if r.name == name), None)
    found = []
    for other in nearest(name, without):
        difference = other.misfit.total - final.total
        cosine = _collinearity(without.linearisation, own, other.refit.model)
        model = other.refit.model
        against = odds(final, difference)
        found.append(CompetingModel(other.name, model, other.misfit, difference, against, cosine, other.finished))
    return found


def _collinearity(at: Linearisation, one: Model | None, other: Model) -> float:
    """Of what two models' effects, at their fitted sizes, change in the residuals, all else being as it is."""
    if one is None:
        return float("nan")
    try:
        columns = at.changes([Plant.for_fits(m).with_parameters(at.parameters.by_key) for m in (one, other)])
    except SimulationError:
        return float("nan")
    information = at.bordered(columns).marginal(len(at.parameters)).information
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    return float(np.clip(abs(information[0, 1]) / (size[0] * size[1]), 0.0, 1.0))
