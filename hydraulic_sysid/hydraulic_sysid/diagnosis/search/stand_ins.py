"""Wrong numbers of a data sheet that an effect may stand for, to first order.

An offset of the position is one dead volume larger and the other smaller; beside further numbers that are wrong nobody
would see it in them. What holding numbers at the model file's values costs follows from the sensitivities alone, with
and without an effect that is free, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import Effect
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations
from hydraulic_sysid.estimation.parallel import results

from .candidates import Probe, RecordFeatures, between, candidates, observed, probes
from .criteria import CRITERIA
from .linearisation import Linearisation

_TRIED = 0.02  # of an effect's usual size: what goes through a resonance is linear no further


@dataclass(frozen=True)
class Beside:
    """A fit with what an effect brings in one of its shapes, in units of its usual size: its ``normal`` equations.

    ``probes``: at which that was looked at.
    """

    effect: Effect
    probes: Sequence[Probe]
    normal: NormalEquations

    def start(self, off: Array, held: tuple[int, ...]) -> dict[str, float]:
        """The effect's parameters [SI, by name] where it does the most of what holding parameters costs."""
        amounts = _following(self.normal, off, held)[len(off) - len(held) :].tolist()
        moved = {p.moved: (p, amount) for p, amount in zip(self.probes, amounts, strict=True)}
        values = dict[str, float]()
        for parameter in self.effect.parameters:
            key = f"{self.effect.name}.{parameter.name}"
            value = self.probes[0].values.get(key, parameter.default)
            if key in moved:
                probe, amount = moved[key]
                value = between(probe.null, probe.values[key], amount / _TRIED, parameter.default)
            values[parameter.name] = min(max(value, parameter.bounds[0]), parameter.bounds[1])
        return values


@dataclass(frozen=True)
class StandIns:
    """Effects beside a fit in which numbers of the data sheet are others than the model file says.

    ``off`` (P,): by how much the file's values are, of the parameters' scales; ``places``: where these numbers are
    among them; ``normal``: of the fit, and ``beside``: what each effect brings, in every shape that is tried;
    ``share``: of the sum of squares that was looked at.
    """

    keys: tuple[str, ...]
    places: tuple[int, ...]
    off: Array
    normal: NormalEquations
    beside: Mapping[str, Sequence[Beside]]
    share: float

    @classmethod
    def of(cls, at: Linearisation, nominal: Mapping[str, float], features: RecordFeatures) -> StandIns:
        """Of the fit ``at``, in which the numbers ``nominal`` [SI, by key] have the values that the records ask for."""
        part, share = at.sample(CRITERIA.enough_to_score)
        own = part.parameters
        off = np.array([(nominal.get(k, v) - v) for k, v in own.by_key.items()]) / own.scales
        effects = [e for e in candidates(at.model) if not observed(e)]
        found = zip(effects, results(lambda effect: _beside(part, effect, features), effects), strict=True)
        beside = {e.name: every for e, every in found if every}
        return cls(tuple(own.keys), tuple(own.keys.index(k) for k in nominal), off, part.normal, beside, share)

    def sets(self, freedom: float) -> list[tuple[str, ...]]:
        """Sets of the numbers for which one effect of fewer parameters does, the likeliest first.

        :param freedom: what a number that is spared is worth of the sum of squares
        """
        sizes = range(2, len(self.places) + 1)
        sets = [held for size in sizes for held in combinations(self.places, size)]
        nothing = {held: self._nothing(held) for held in sets}
        best: dict[tuple[str, ...], float] = {}
        for name in self.beside:
            cost = {held: self._cost(name, held) for held in sets if len(held) > self._brought(name)}
            likely = {held: own - len(held) * freedom for held, own in cost.items() if own < nothing[held]}
            if likely:
                chosen = min(likely, key=lambda held: likely[held])
                keys = tuple(self.keys[i] for i in chosen)
                best[keys] = min(best.get(keys, np.inf), likely[chosen])
        return sorted(best, key=lambda keys: best[keys])

    def for_set(self, keys: Sequence[str]) -> dict[str, dict[str, float]]:
        """Effects that do what all of these numbers do → where a fit with them begins; the likeliest first."""
        held = tuple(self.keys.index(key) for key in keys)
        most = self._nothing(held)
        cost = {name: self._cost(name, held) for name in self.beside}
        likely = sorted((name for name in cost if cost[name] < most), key=lambda name: cost[name])
        return {name: self._best(name, held).start(self.off, held) for name in likely}

    def for_number(self, key: str, enough: float) -> list[str]:
        """Effects beside which it costs hardly anything to hold a number as it was, or half and less than ``enough``.

        The likeliest first.
        """
        held, alone = (self.keys.index(key),), self.alone(key)
        cost = {name: self._cost(name, held) for name in self.beside}
        most = max(CRITERIA.rough * alone, min(enough, CRITERIA.most_of * alone))
        return sorted((name for name in cost if cost[name] < most), key=lambda name: cost[name])

    def alone(self, key: str) -> float:
        """Sum of squares that it costs to hold a number as it was, without any effect."""
        return self._alone((self.keys.index(key),))

    def _nothing(self, held: tuple[int, ...]) -> float:
        """Up to which cost an effect is fitted, which decides: what several numbers do together is far off."""
        return CRITERIA.details * self._alone(held)

    def _alone(self, held: tuple[int, ...]) -> float:
        return _cost_of_holding(self.normal, self.off, held) / self.share

    def _brought(self, name: str) -> int:
        return min(len(b.probes) for b in self.beside[name])

    def _cost(self, name: str, held: tuple[int, ...]) -> float:
        return _cost_of_holding(self._best(name, held).normal, self.off, held) / self.share

    def _best(self, name: str, held: tuple[int, ...]) -> Beside:
        return min(self.beside[name], key=lambda b: _cost_of_holding(b.normal, self.off, held))


def _beside(at: Linearisation, effect: Effect, features: RecordFeatures) -> list[Beside]:
    """With what an effect brings, at the probes of each of its shapes that run."""
    model, found = at.model.with_effect(effect.name), list[Beside]()
    for group in probes(effect, features, (_TRIED,)):
        with suppress(SimulationError):
            changes = at.changes([Plant.for_fits(model.with_values(p.values)) for p in group])
            found.append(Beside(effect, group, at.bordered([c / _TRIED for c in changes])))
    return found


def _following(normal: NormalEquations, off: Array, held: tuple[int, ...]) -> Array:
    """Where all other parameters go, in their order, when those ``held`` move by ``off`` (P,)."""
    others = np.setdiff1d(np.arange(len(normal.information)), held)
    own, cross = normal.information[np.ix_(others, others)], normal.information[np.ix_(others, np.array(held))]
    return np.asarray(-np.linalg.pinv(own, rcond=1e-12, hermitian=True) @ cross @ off[list(held)])


def _cost_of_holding(normal: NormalEquations, off: Array, held: tuple[int, ...]) -> float:
    """Sum of squares that it costs to move the parameters ``held`` by ``off`` (P,), all others free to follow."""
    others = np.setdiff1d(np.arange(len(normal.information)), held)
    moved = normal.subset(np.concatenate((others, held))).marginal(len(others))
    return max(float(off[list(held)] @ moved.information @ off[list(held)]), 0.0)
