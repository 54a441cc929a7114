"""Quick refits of a model with a candidate switched on.

The sensitivities to the model's own parameters and to the starts of the pieces are those of the anchor throughout
(chord method): only the candidate's are taken anew in every step. A step that does not lower the sum of squares is
damped (Levenberg-Marquardt), so that what is approximate costs steps and not truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.estimate import scale
from hydraulic_sysid.estimation.steps import bounded_step

from .anchor import Anchor, inner, keys_of, project, within
from .candidates import between

Array = NDArray[np.float64]

_STEP = 2e-3
_MOST_DAMPING = 1e4
_FLAT = 2e-4  # relative gain of a step that ends the refit
MOST_STEPS = 10
_SHARES = (1.0, 0.5, 0.2, 0.05)  # of the predicted size, to start from
_RESTS = 2  # times that starts are moved at the end
_ROUNDED = 6  # the same where what is measured is rounded, and the sensitivities only point the way


@dataclass(frozen=True)
class Refit:
    """A model refitted: ``costs[i]`` (S_i,) sums of squares of every piece, ``fitted`` over the fitted ones, and, of
    `as_it_is`, the residuals ``raw[i]`` (S_i, m)."""

    model: Model
    costs: list[Array]
    fitted: float
    held_out: float
    added: tuple[str, ...]
    raw: list[Array] = field(default_factory=list)


def refit(anchor: Anchor, model: Model, start: Mapping[str, float], most_steps: int = MOST_STEPS) -> Refit:
    """Fit ``model``, which has the anchor's effects and more, from the anchor's values and ``start`` [SI, by key]."""
    fit = _Fit(anchor, model, start)
    now = fit.begin(start)
    if now is None:
        return Refit(model, anchor.costs, *fit.sums(anchor.costs), tuple(fit.own))
    damping = 1e-3
    for _ in range(most_steps):
        columns = fit.columns(now)
        if columns is None:
            break
        better, damping = fit.step(now, columns, damping)
        if better is None:
            break
        gain = (now.cost - better.cost) / now.cost
        now, damping = better, max(damping / 5.0, 1e-6)
        if gain < _FLAT:
            break
    costs, _ = fit.settled(now)
    done = model.with_values(within(model, now.values), source="fitted")
    return Refit(done, costs, *fit.sums(costs), tuple(fit.own))


def as_it_is(anchor: Anchor, model: Model) -> Refit:
    """``model``, which has the anchor's effects and more, with the values it has; only starts of pieces are moved."""
    fit = _Fit(anchor, model, {})
    now = fit._at({k: model.value(k) for k in keys_of(model)}, [s.copy() for s in anchor.shooting.starts])
    costs, raw = (anchor.costs, anchor.residual) if now is None else fit.settled(now, _ROUNDED)
    return Refit(model, costs, *fit.sums(costs), (), raw)


@dataclass(frozen=True)
class _Point:
    """Values of all parameters by key, starts of the pieces (S, states), residuals (S, m) as they are (``raw``) and
    without what other starts would explain, per record; and the sum of squares of the latter on fitted pieces."""

    values: dict[str, float]
    starts: list[Array]
    raw: list[Array]
    residual: list[Array]
    cost: float


class _Fit:
    """One refit: the anchor, and what is beyond it (``own``: keys of the candidate's free parameters)."""

    def __init__(self, anchor: Anchor, model: Model, start: Mapping[str, float]) -> None:
        self.anchor, self.model, self.plant = anchor, model, Plant(model)
        self.own = [k for k in start if model.entry(k).free]
        self.keys = [*anchor.keys, *self.own]
        self.scales = {**anchor.scales, **{k: scale(model, k) for k in self.own}}
        self.bounds = [*anchor.bounds, *(model.entry(k).bounds for k in self.own)]

    def sums(self, costs: list[Array]) -> tuple[float, float]:
        """Of the fitted pieces, and of those held out."""
        chosen = self.anchor.split.fitted
        fitted = sum(float(c[f].sum()) for c, f in zip(costs, chosen, strict=True))
        return fitted, sum(float(c[~f].sum()) for c, f in zip(costs, chosen, strict=True))

    def begin(self, start: Mapping[str, float]) -> _Point | None:
        """Where to start: as far towards the prediction as lowers the sum of squares."""
        values = {**self.anchor.values, **{k: float(v) for k, v in start.items()}}
        for key, bound in zip(self.keys, self.bounds, strict=True):
            low, high = bound  # type: ignore[misc]
            values[key] = min(max(values[key], low), high)
        before = self.sums(self.anchor.costs)[0]
        for share in _SHARES:
            tried = dict(values)
            for key in self.own:
                parameter = self.model.parameter(key)
                if parameter.null is not None:
                    tried[key] = between(parameter.null, values[key], share, parameter.default)
            there = self._at(tried, [s.copy() for s in self.anchor.shooting.starts])
            if there is not None and (there.cost < before or share == _SHARES[-1]):
                return there
        return None

    def columns(self, now: _Point) -> list[Array] | None:
        """Change of the residuals (S, m, own) with each of the candidate's parameters over its scale, per record."""
        found = []
        for key in self.own:
            high = self.model.entry(key).bounds[1]  # type: ignore[index]
            step = _STEP * max(abs(now.values[key]), 0.1 * self.scales[key])
            step = step if now.values[key] + step <= high else -step
            moved = self._run({**now.values, key: now.values[key] + step}, now.starts)
            if moved is None:
                return None
            found.append([(m - r) * (self.scales[key] / step) for m, r in zip(moved, now.raw, strict=True)])
        return [
            np.stack([c[i] for c in found], axis=-1) if found else np.zeros((*r.shape, 0))
            for i, r in enumerate(now.raw)
        ]

    def step(self, now: _Point, columns: list[Array], damping: float) -> tuple[_Point | None, float]:
        """A point with a smaller sum of squares and the damping it took; None where no damping gives one."""
        anchor = self.anchor
        beyond = project(anchor.linear, columns) if self.own else columns
        every = [np.concatenate(pair, axis=-1) for pair in zip(anchor.beyond, beyond, strict=True)]
        information = inner(anchor.split, every, every)
        gradient = inner(anchor.split, every, [r[..., None] for r in now.residual])[:, 0]
        used = {k: now.values[k] for k in self.keys}
        while damping <= _MOST_DAMPING:
            change = bounded_step(information, gradient, used, self.scales, self.bounds, damping)
            moved = {k: used[k] + float(c) * self.scales[k] for k, c in zip(self.keys, change, strict=True)}
            ahead = [
                r + np.concatenate(pair, axis=-1) @ change
                for r, *pair in zip(now.raw, anchor.columns, columns, strict=True)
            ]
            there = self._at({**now.values, **moved}, self._rested(now.starts, ahead))
            if there is not None and there.cost < now.cost:
                return there, damping
            damping *= 8.0
        return None, damping

    def settled(self, now: _Point, rests: int = _RESTS) -> tuple[list[Array], list[Array]]:
        """Sums of squares (S,) and residuals (S, m) of the pieces per record, each from the best of a few starts."""
        costs = [np.sum(r**2, axis=1) for r in now.residual]
        starts, raw = now.starts, now.raw
        for _ in range(rests):
            there = self._at(now.values, self._rested(starts, raw))
            if there is None:
                break
            left = [np.sum(r**2, axis=1) for r in there.residual]
            better = [b < a for a, b in zip(costs, left, strict=True)]
            costs = [np.where(c, b, a) for a, b, c in zip(costs, left, better, strict=True)]
            starts = [np.where(c[:, None], n, s) for s, n, c in zip(starts, there.starts, better, strict=True)]
            raw = [np.where(c[:, None], n, r) for r, n, c in zip(raw, there.raw, better, strict=True)]
        return costs, raw

    def _rested(self, starts: list[Array], raw: list[Array]) -> list[Array]:
        """Starts moved to where these residuals ask for, to first order."""
        found = []
        for lin, s, r, p in zip(self.anchor.linear, starts, raw, self.anchor.shooting.pieces, strict=True):
            new = s.copy()
            new[:, p.free] += (lin.back @ r[..., None])[..., 0]
            found.append(new)
        return found

    def _at(self, values: dict[str, float], starts: list[Array]) -> _Point | None:
        raw = self._run(values, starts)
        if raw is None:
            return None
        residual = [lin.project(r) for lin, r in zip(self.anchor.linear, raw, strict=True)]
        return _Point(values, starts, raw, residual, self.sums([np.sum(r**2, axis=1) for r in residual])[0])

    def _run(self, values: Mapping[str, float], starts: list[Array]) -> list[Array] | None:
        try:
            found = self.anchor.shooting.run(self.plant.with_parameters(dict(values)), starts)
        except SimulationError:  # a step too far: the plant does not run there
            return None
        return found if all(np.isfinite(r).all() for r in found) else None
