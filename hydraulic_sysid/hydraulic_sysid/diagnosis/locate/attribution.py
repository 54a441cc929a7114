"""How much of what the balances lack each subsystem can explain.

Least squares of the whitened balances on `regressors`, always beside those of the model's free parameters, so that a
wrong parameter is not attributed to a subsystem. A share counts only as far as it holds on data that did not make it:
half-second blocks are left out in turn (cross-validation, four folds), which also charges a subsystem for its number of
regressors. Subsystems are taken in one after the other (forward selection), each time the one that explains most beside
those taken before: two faults in different places are both found, and what was only a proxy gets no share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Index

from .normal_equations import NormalEquations

PARAMETERS = "parameters"
_LEAST = 10.0  # reduction over ln N from which a subsystem gets a share
_SMALL = 0.1  # and least part of what those before have left
_MOST = 3  # subsystems that get a share
_WORTH = 2.0  # reduction over ln N from which functions of one more variable are taken in
_PART = 1e-3  # and least part of what those before have gained


@dataclass(frozen=True)
class Share:
    """Of one subsystem: the part of the excess that it adds when it is taken in, and what it explains alone."""

    subsystem: str
    share: float
    alone: float
    reduction: float
    """Of the sum of squares on data left out, in units of the noise's variance, beyond that of the reference run."""
    variables: dict[str, float]
    """Variable → part of this subsystem's reduction that functions of it alone reach."""


@dataclass(frozen=True)
class Attribution:
    """Mean square over noise of the model as it is, after its free parameters may move, and with all shares taken."""

    before: float
    refitted: float
    left: float
    exact: float
    """Of the reference run, after the parameters may move: what an exact model shows."""
    ranked: list[Share]
    count: float


@dataclass(frozen=True)
class _Trial:
    """What a subsystem reaches: those regressors of it that are worth it, what they leave, and by how much it falls."""

    chosen: Index
    left: float
    left_reference: float
    reduction: float
    variables: dict[str, float]


class _Selection:
    """Tries subsystems on the record and on its reference run."""

    def __init__(
        self, measured: NormalEquations, reference: NormalEquations, subsystems: Sequence[str],
        variables: Sequence[str], bounds: Array,
    ) -> None:  # fmt: skip
        self.measured, self.reference = measured, reference
        self.variables, owner = np.array(variables), np.array(subsystems)
        self.members = {n: np.flatnonzero(owner == n) for n in dict.fromkeys(subsystems) if n != PARAMETERS}
        self.low, self.high = bounds.reshape(-1, 2).T
        self.count = float(measured.count.sum())

    def left(self, of: NormalEquations, taken: Index, tried: Index) -> float:
        return of.left(taken, tried, self.low, self.high)

    def trial(self, subsystem: str, taken: Index, before: float, before_reference: float) -> _Trial:
        """Take in the subsystem's variables one after the other, the best first, as long as each is worth it."""
        own = self.members[subsystem]
        groups = {name: own[self.variables[own] == name] for name in dict.fromkeys(self.variables[own].tolist())}
        chosen: Index = np.zeros(0, dtype=np.int64)
        now = before
        by: dict[str, float] = {}
        while groups:
            left = {name: self.left(self.measured, taken, np.concatenate((chosen, g))) for name, g in groups.items()}
            by = by or {name: before - value for name, value in left.items()}
            best = min(left, key=lambda name: left[name])
            if now - left[best] <= max(_WORTH * np.log(self.count), _PART * (before - now)):
                break
            chosen, now = np.concatenate((chosen, groups.pop(best))), left[best]
        now_reference = self.left(self.reference, taken, chosen)
        reduction = before - now - max(before_reference - now_reference, 0.0)
        whole = max(before - now, 1e-300)
        parts = {n: max(0.0, v / whole) for n, v in sorted(by.items(), key=lambda item: -item[1])}
        return _Trial(chosen, now, now_reference, reduction, parts)


def attribute(
    measured: NormalEquations, reference: NormalEquations, subsystems: Sequence[str], variables: Sequence[str],
    bounds: Sequence[tuple[float, float]],
) -> Attribution:  # fmt: skip
    """Subsystems by what they explain. ``subsystems`` (K,) and ``variables`` (K,) name every regressor.

    ``bounds``: how far each parameter (they come first) may still move. The reference run is an exact model's record
    under the same noise: what a subsystem explains of it, for regressors are made from noisy signals too, is taken off.
    """
    selection = _Selection(measured, reference, subsystems, variables, np.array(bounds, dtype=float))
    none: Index = np.zeros(0, dtype=np.int64)
    taken, count = none, selection.count
    now, now_reference = refitted, exact = [selection.left(of, none, none) for of in (measured, reference)]
    least = _LEAST * float(np.log(count))
    excess = refitted - exact

    def part(reduction: float) -> float:
        return reduction / excess if excess > least else 0.0  # else nothing is left to share

    alone = {n: selection.trial(n, none, refitted, exact) for n in selection.members}
    tried, ranked, rest = alone, list[Share](), list(selection.members)
    while rest and len(ranked) < _MOST:
        best = max(rest, key=lambda n: tried[n].reduction)
        trial = tried[best]
        if trial.reduction <= max(least, _SMALL * (now - now_reference)):
            break
        share = min(part(trial.reduction), 1.0 - sum(b.share for b in ranked))
        ranked.append(Share(best, share, part(alone[best].reduction), trial.reduction, trial.variables))
        rest.remove(best)
        taken, now, now_reference = np.concatenate((taken, trial.chosen)), trial.left, trial.left_reference
        tried = {n: selection.trial(n, taken, now, now_reference) for n in rest} if len(ranked) < _MOST else {}
    for n in sorted(rest, key=lambda n: -alone[n].reduction):
        ranked.append(Share(n, 0.0, part(alone[n].reduction), 0.0, {}))
    left = now + (exact - now_reference)
    before = float(measured.square.sum())
    return Attribution(before / count, refitted / count, left / count, exact / count, ranked, count)
