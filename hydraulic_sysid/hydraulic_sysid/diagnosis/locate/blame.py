"""How much of what the balances lack each subsystem can explain.

Least squares of the whitened balances on directions (`directions`), always beside those of the model's free parameters,
so that a wrong parameter is not called a fault of a subsystem. A share counts only as far as it holds on data that did
not make it: half-second blocks are left out in turn (cross-validation, four folds), which also charges a subsystem for
its number of directions. Subsystems are taken in one after the other, each time the one that explains most beside those
taken before: two faults in different places are both found, and what was only a stand-in gets no share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .moments import Array, Index, Moments

PARAMETERS = "parameters"
Bounds = tuple[float, float]
_LEAST = 10.0  # gain over ln N from which a subsystem gets a share
_SMALL = 0.1  # and least part of what those before have left
_MOST = 3  # subsystems that get a share
_WORTH = 2.0  # gain over ln N from which directions over one more variable are taken in
_PART = 1e-3  # and least part of what those before have gained


@dataclass(frozen=True)
class Blame:
    """One subsystem: share of the excess that it adds when it is taken in, and the share that it explains alone."""

    subsystem: str
    share: float
    alone: float
    gain: float
    """Fall of the sum of squares on data left out, in units of the noise's variance, beyond the twin's."""
    variables: dict[str, float]
    """Variable → part of this subsystem's gain that its directions over this variable reach by themselves."""


@dataclass(frozen=True)
class Verdict:
    """Mean square over noise of the model as it is, after its free parameters may move, and after all blame."""

    before: float
    refitted: float
    left: float
    exact: float
    """Of the twin, after the parameters may move: what an exact model shows."""
    ranked: list[Blame]
    count: float


@dataclass(frozen=True)
class _Trial:
    """What a family of directions reaches: those of it that are worth it, what they leave, and what they gain."""

    chosen: Index
    left: float
    left_twin: float
    gain: float
    by: dict[str, float]


class _Court:
    """Tries families on the record and on its twin."""

    def __init__(self, measured: Moments, twin: Moments, names: Sequence[str], over: Sequence[str], box: Array) -> None:
        self.measured, self.twin = measured, twin
        self.over = np.array(over)
        owner = np.array(names)
        self.families = {n: np.flatnonzero(owner == n) for n in dict.fromkeys(names) if n != PARAMETERS}
        self.low, self.high = box.reshape(-1, 2).T
        self.count = float(measured.count.sum())

    def left(self, taken: Index, tried: Index) -> float:
        return self.measured.left(taken, tried, self.low, self.high)

    def left_twin(self, taken: Index, tried: Index) -> float:
        return self.twin.left(taken, tried, self.low, self.high)

    def trial(self, family: str, taken: Index, before: float, before_twin: float) -> _Trial:
        """Take in the family's variables one after the other, the best first, as long as each is worth it."""
        own = self.families[family]
        groups = {name: own[self.over[own] == name] for name in dict.fromkeys(self.over[own].tolist())}
        chosen: Index = np.zeros(0, dtype=np.int64)
        now = before
        by: dict[str, float] = {}
        while groups:
            left = {name: self.left(taken, np.concatenate((chosen, g))) for name, g in groups.items()}
            by = by or {name: before - value for name, value in left.items()}
            best = min(left, key=lambda name: left[name])
            if now - left[best] <= max(_WORTH * np.log(self.count), _PART * (before - now)):
                break
            chosen, now = np.concatenate((chosen, groups.pop(best))), left[best]
        now_twin = self.left_twin(taken, chosen)
        gain = before - now - max(before_twin - now_twin, 0.0)
        whole = max(before - now, 1e-300)
        parts = {n: max(0.0, v / whole) for n, v in sorted(by.items(), key=lambda item: -item[1])}
        return _Trial(chosen, now, now_twin, gain, parts)


def rank(
    measured: Moments, twin: Moments, subsystems: Sequence[str], variables: Sequence[str], bounds: Sequence[Bounds]
) -> Verdict:
    """Subsystems by what they explain. ``subsystems`` (K,) and ``variables`` (K,) name every direction.

    ``bounds``: how far each parameter (they come first) may still move. The twin is an exact model's record under the
    same noise: what a subsystem explains of it, for directions are made from noisy signals too, is taken off.
    """
    court = _Court(measured, twin, subsystems, variables, np.array(bounds, dtype=float))
    none: Index = np.zeros(0, dtype=np.int64)
    taken, count = none, court.count
    now, now_twin = refitted, exact = court.left(none, none), court.left_twin(none, none)
    excess = max(refitted - exact, 1e-9 * count)
    alone = {n: court.trial(n, none, refitted, exact) for n in court.families}
    tried, ranked, rest = alone, list[Blame](), list(court.families)
    while rest and len(ranked) < _MOST:
        best = max(rest, key=lambda n: tried[n].gain)
        trial = tried[best]
        if trial.gain <= max(_LEAST * np.log(count), _SMALL * (now - now_twin)):
            break
        share = min(trial.gain / excess, 1.0 - sum(b.share for b in ranked))
        ranked.append(Blame(best, share, alone[best].gain / excess, trial.gain, trial.by))
        rest.remove(best)
        taken, now, now_twin = np.concatenate((taken, trial.chosen)), trial.left, trial.left_twin
        tried = {n: court.trial(n, taken, now, now_twin) for n in rest} if len(ranked) < _MOST else {}
    for n in sorted(rest, key=lambda n: -alone[n].gain):
        ranked.append(Blame(n, 0.0, alone[n].gain / excess, 0.0, {}))
    left = now + (exact - now_twin)
    before = float(measured.square.sum())
    return Verdict(before / count, refitted / count, left / count, exact / count, ranked, count)
