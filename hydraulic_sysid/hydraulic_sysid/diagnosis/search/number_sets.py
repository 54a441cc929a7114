"""Several wrong numbers of a data sheet that one effect may stand for, to first order.

An offset of the position is one dead volume larger and the other smaller; beside further numbers that are wrong nobody
would see it in them. What holding numbers at the model file's values costs follows from the sensitivities alone, with
and without an effect that is free, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import combinations

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import Effect
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations
from hydraulic_sysid.estimation.parallel import results

from .candidates import RecordFeatures, candidates, observed, probes
from .criteria import CRITERIA
from .linearisation import Linearisation


def sets_of_one_effect(
    at: Linearisation, nominal: Mapping[str, float], features: RecordFeatures, freedom: float
) -> list[tuple[str, ...]]:
    """Sets of the wrong numbers ``nominal`` [SI, by key] for which one effect of fewer parameters does.

    The likeliest first.

    :param at: the fit in which they have the values that the records ask for
    :param freedom: what a number that is spared is worth of the sum of squares
    """
    part, share = at.sample(CRITERIA.enough_to_score)
    own = part.parameters
    off = np.array([(nominal.get(k, v) - v) for k, v in own.by_key.items()]) / own.scales
    places = [own.keys.index(k) for k in nominal]
    sets = [c for size in range(2, len(places) + 1) for c in combinations(places, size)]
    alone = {held: _cost(part.normal, off, held) for held in sets}
    best: dict[tuple[str, ...], float] = {}
    effects = [e for e in candidates(at.model) if not observed(e)] if sets else []
    for normal in results(lambda effect: _beside(part, effect, features), effects):
        if normal is None:
            continue
        brought = len(normal.information) - len(off)
        left = {held: _cost(normal, np.concatenate((off, np.zeros(brought))), held) for held in sets}
        simpler = [h for h in sets if len(h) > brought and left[h] < CRITERIA.rough * alone[h]]
        likely = {h: left[h] / share - len(h) * freedom for h in simpler}
        if likely:
            chosen = min(likely, key=lambda held: likely[held])
            keys = tuple(own.keys[i] for i in chosen)
            best[keys] = min(best.get(keys, np.inf), likely[chosen])
    return sorted(best, key=lambda keys: best[keys])


def _beside(at: Linearisation, effect: Effect, features: RecordFeatures) -> NormalEquations | None:
    """The normal equations with what an effect brings, at the probes of its first shape that run; None: none do."""
    model = at.model.with_effect(effect.name)
    for group in probes(effect, features):
        with suppress(SimulationError):
            return at.bordered(at.changes([Plant.for_fits(model.with_values(p.values)) for p in group]))
    return None


def _cost(normal: NormalEquations, off: Array, held: tuple[int, ...]) -> float:
    """Sum of squares that it costs to move the parameters ``held`` by ``off`` (P,), the others free to follow."""
    others = np.setdiff1d(np.arange(len(off)), held)
    moved = normal.subset(np.concatenate((others, held))).marginal(len(others))
    return max(float(off[list(held)] @ moved.information @ off[list(held)]), 0.0)
