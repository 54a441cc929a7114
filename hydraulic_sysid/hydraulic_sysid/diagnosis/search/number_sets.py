"""Several wrong numbers of a data sheet that one effect may stand for, to first order.

An offset of the position is one dead volume larger and the other smaller; beside further numbers that are wrong nobody
would see it in them. What holding numbers at the model file's values costs follows from the sensitivities alone, with
and without an effect that is free, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain, combinations, islice

import numpy as np

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.parallel import results

from .candidates import RecordFeatures, candidates, observed, probes
from .data_sheet import ROUGH
from .linearisation import Linearisation
from .score_test import ENOUGH


def sets_of_one_effect(
    at: Linearisation, nominal: Mapping[str, float], features: RecordFeatures, freedom: float
) -> list[tuple[str, ...]]:
    """Sets of the wrong numbers ``nominal`` [SI, by key] for which one effect of fewer parameters does.

    The likeliest first.

    :param at: the fit in which they have the values that the records ask for
    :param freedom: what a number that is spared is worth of the sum of squares
    """
    part, share = at.sample(ENOUGH)
    own = part.parameters
    off = np.array([(nominal.get(k, v) - v) for k, v in own.by_key.items()]) / own.scales
    places = [own.keys.index(k) for k in nominal]
    sets = [c for size in range(2, len(places) + 1) for c in combinations(places, size)]
    alone = {held: _cost(part.normal.information, off, held) for held in sets}
    best: dict[tuple[str, ...], float] = {}
    effects = [e for e in candidates(at.model) if not observed(e)] if sets else []
    normals = results(lambda effect: [*islice(_bordered(part, effect.name, probes(effect, features)), 1)], effects)
    for information in chain.from_iterable(normals):
        beside = np.concatenate((off, np.zeros(len(information) - len(off))))
        left = {held: _cost(information, beside, held) for held in sets}
        simpler = [h for h in sets if len(h) > len(information) - len(off) and left[h] < ROUGH * alone[h]]
        likely = {h: left[h] / share - len(h) * freedom for h in simpler}
        if likely:
            chosen = min(likely, key=lambda held: likely[held])
            keys = tuple(own.keys[i] for i in chosen)
            best[keys] = min(best.get(keys, np.inf), likely[chosen])
    return sorted(best, key=lambda keys: best[keys])


def _bordered(at: Linearisation, name: str, groups: Iterator) -> Iterator[Array]:
    """The normal equations' matrix with what an effect brings, at the probes of its first shape that run."""
    model = at.model.with_effect(name)
    for group in groups:
        try:
            yield at.bordered(at.changes([Plant.for_fits(model.with_values(p.values)) for p in group])).information
        except SimulationError:
            continue


def _cost(information: Array, off: Array, held: tuple[int, ...]) -> float:
    """Sum of squares that it costs to move the parameters ``held`` by ``off`` (P,), the others free to follow."""
    fixed: Mask = np.isin(np.arange(len(off)), held)
    own, cross = information[np.ix_(fixed, fixed)], information[np.ix_(~fixed, fixed)]
    followed = np.linalg.lstsq(information[np.ix_(~fixed, ~fixed)], cross @ off[fixed], rcond=1e-12)[0]
    return max(float(off[fixed] @ (own @ off[fixed] - cross.T @ followed)), 0.0)
