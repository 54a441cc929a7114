"""Quick refits of a model with a candidate switched on, by a frozen Jacobian.

The sensitivities to the model's own parameters and to the initial states are those of the linearisation throughout:
only the candidate's are taken anew in every step. A step that does not lower the sum of squares is damped, so that what
is approximate costs steps and not truth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.levenberg_marquardt import Exact, NormalEquations, minimise
from hydraulic_sysid.estimation.parallel import lazy
from hydraulic_sysid.estimation.parameters import Parameters

from .candidates import between
from .linearisation import Linearisation

_ENDLESS = 1e100  # residual over noise of a run that has left all bounds
_FLAT = 2e-4  # relative gain of a step that ends the refit
_NOTHING = 1e-6  # relative change of the sum of squares: none
_MOST_STEPS = 10
_SHARES = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05)  # of the predicted size, to start from
_ROUNDS = 2  # times that initial states are moved at the end
_ROUNDED = 6  # the same where what is measured is rounded, and the sensitivities only point the way


@dataclass(frozen=True)
class Refit:
    """A model refitted: ``costs[i]`` (S_i,) sums of squares of every segment.

    Of `refit_rounded` also ``residual[i]`` (S_i, m): what is left.
    """

    model: Model
    costs: list[Array]
    residual: Sequence[Array] = ()


def refit(at: Linearisation, model: Model, start: Mapping[str, float]) -> Refit:
    """Fit ``model``, which has the linearisation's effects and more, from its values and ``start`` [SI, by key].

    Where it does not run from there, it is that of the linearisation: what it has more changes nothing.
    """
    own = tuple(k for k in start if model.entry(k).free)
    begin = _begin(at, model, start, own)
    if begin is None:
        nothing = {k: null for k in own if (null := model.parameter(k).null) is not None}
        return Refit(model.with_values({**start, **nothing}), at.costs)
    point = minimise(begin, _MOST_STEPS, _FLAT).point
    values = {**start, **point.parameters.by_key}
    return Refit(model.with_values(values, source="fitted"), point.at_rest(_ROUNDS).costs)


def refit_rounded(at: Linearisation, model: Model) -> Refit:
    """Fit ``model``, which has effects without a derivative beyond those of the linearisation, from its values.

    They only move the residuals: the sensitivities are those of the linearisation.
    """
    begin = FrozenPoint.at(at, Plant.for_fits(model), at.parameters, at.point.initial_states)
    if begin is None:
        return Refit(model, at.costs, at.residual)
    point = minimise(begin.at_rest(_ROUNDED), _MOST_STEPS, _FLAT).point.at_rest(_ROUNDED)
    return Refit(model.with_values(point.parameters.by_key, source="fitted"), point.costs, point.raw)


def left_rounded(at: Linearisation, model: Model) -> list[Array]:
    """What ``model``, with effects without a derivative beyond those of the linearisation, leaves: (S_i,) per record.

    It has its values; only initial states are fitted.
    """
    begin = FrozenPoint.at(at, Plant.for_fits(model), at.parameters, at.point.initial_states)
    return at.costs if begin is None else begin.at_rest(_ROUNDED).costs


def _begin(at: Linearisation, model: Model, start: Mapping[str, float], own: Sequence[str]) -> FrozenPoint | None:
    """Where to start: as far towards the prediction as lowers the sum of squares.

    Where the effect changes nothing short of it, as a limit that is never reached, there: else no way leads to it.
    """
    predicted = Parameters.of(model, own)
    values = np.array([start[k] for k in own])
    predicted = replace(predicted, values=np.clip(values, predicted.low, predicted.high))
    plant = Plant.for_fits(model.with_values({**start, **predicted.by_key}))
    records = [model.parameter(k) for k in own]
    before = sum(float(c[f].sum()) for c, f in zip(at.costs, at.split.fit, strict=True)) + at.parameters.prior_cost
    found, whole = None, None
    for share in _SHARES:
        tried = [
            v if r.null is None else between(r.null, v, share, r.default)
            for r, v in zip(records, predicted.values.tolist(), strict=True)
        ]
        candidate = replace(predicted, values=np.array(tried))
        found = FrozenPoint.at(at, plant, at.parameters + candidate, at.point.initial_states)
        whole = whole or found
        if found is not None and found.cost < (1.0 - _NOTHING) * before:
            return found
    nothing = found is not None and abs(found.cost - before) < _NOTHING * before
    return whole if nothing else found


@dataclass(frozen=True)
class FrozenPoint(Exact):
    """Where a quick refit stands.

    ``plant``: with the candidate; ``parameters``: the linearisation's and the candidate's; ``raw[i]`` (S, m): residuals
    of record i from these ``initial_states``.
    """

    linearisation: Linearisation
    plant: Plant
    parameters: Parameters
    initial_states: list[Array]
    raw: list[Array]

    @classmethod
    def at(
        cls, linearisation: Linearisation, plant: Plant, parameters: Parameters, initial_states: list[Array]
    ) -> FrozenPoint | None:
        """None where the plant does not run."""
        located = plant.with_parameters(parameters.by_key)
        try:
            raw = linearisation.point.shooting.try_out(located, initial_states)
        except SimulationError:
            return None
        bounded = all((np.abs(r) < _ENDLESS).all() for r in raw)
        return cls(linearisation, plant, parameters, initial_states, raw) if bounded else None

    @lazy
    def residual(self) -> list[Array]:
        """(S, m) per record without what other initial states would explain."""
        raw = [r[..., None] for r in self.raw]
        return [r[..., 0] for r in self.linearisation.point.beyond(raw)]

    @lazy
    def costs(self) -> list[Array]:
        """(S,) per record: sum of squares of each segment."""
        return [np.sum(r**2, axis=1) for r in self.residual]

    @lazy
    def cost(self) -> float:
        """Sum of squares of the segments for fitting."""
        squares = sum(float(c[f].sum()) for c, f in zip(self.costs, self.linearisation.split.fit, strict=True))
        return squares + self._frozen.prior_cost

    @property
    def _frozen(self) -> Parameters:
        return self.parameters.first(len(self.linearisation.parameters))

    @lazy
    def own_columns(self) -> list[Array]:
        """Change of the residuals (S, m, Q) with each of the candidate's parameters over its scale, per record."""
        own = self.parameters.after(len(self.linearisation.parameters))
        plant = self.plant.with_parameters(self.parameters.by_key)
        return self.linearisation.point.shooting.jacobian(plant, own, self.initial_states, self.raw)

    @lazy
    def normal(self) -> NormalEquations | None:
        """None where the candidate's parameters cannot be moved."""
        try:
            return self.linearisation.bordered(self.own_columns, self.residual, self._frozen)
        except SimulationError:
            return None

    def moved(self, change: Array) -> FrozenPoint | None:
        """A change (P,) of the parameters away; initial states follow to where they will fit best, to first order."""
        frozen = len(self.linearisation.parameters)
        ahead = [
            r + old @ change[:frozen] + new @ change[frozen:]
            for r, old, new in zip(self.raw, self.linearisation.columns, self.own_columns, strict=True)
        ]
        return self._from(self.parameters.moved(change), ahead)

    def at_rest(self, rounds: int) -> FrozenPoint:
        """The same parameters, every segment from the best of a few initial states.

        Those that a model without the candidate was fitted with may be bent to where no first-order step leads out: in
        the end each segment is begun from where the record shows it, too.
        """
        point, at = self, self.linearisation
        for _ in range(rounds):
            point = point._better_of(point._from(point.parameters, point.raw))
        anew = FrozenPoint.at(at, self.plant, self.parameters, at.point.shooting.initial_states)
        if anew is not None:
            point = point._better_of(anew)._better_of(anew._from(anew.parameters, anew.raw))
        return point

    def _better_of(self, other: FrozenPoint | None) -> FrozenPoint:
        """Every segment from that one's initial states where they leave less."""
        if other is None:
            return self
        better = [(new < old)[:, None] for new, old in zip(other.costs, self.costs, strict=True)]
        return replace(
            self,
            initial_states=_chosen(better, other.initial_states, self.initial_states),
            raw=_chosen(better, other.raw, self.raw),
        )

    def _from(self, parameters: Parameters, residuals: Sequence[Array]) -> FrozenPoint | None:
        """From the initial states that these residuals ask for."""
        at = self.linearisation.point
        states = at.shooting.corrected(self.initial_states, at.projections, residuals)
        return FrozenPoint.at(self.linearisation, self.plant, parameters, states)


def _chosen(better: Sequence[Mask], new: Sequence[Array], old: Sequence[Array]) -> list[Array]:
    return [np.where(b, n, o) for b, n, o in zip(better, new, old, strict=True)]
