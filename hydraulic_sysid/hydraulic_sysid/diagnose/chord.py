"""Quick refits of a model with a candidate switched on.

The sensitivities to the model's own parameters and to the starts of the pieces are those of the anchor throughout
(chord method): only the candidate's are taken anew in every step. A step that does not lower the sum of squares is
damped (Levenberg-Marquardt), so that what is approximate costs steps and not truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.calibrate.estimate import scale
from hydraulic_sysid.calibrate.steps import bounded_step

from .anchor import Anchor, inner, project, within
from .candidates import between

Array = NDArray[np.float64]

_STEP = 2e-3
_MOST_DAMPING = 1e4
_FLAT = 2e-4  # relative gain of a step that ends the refit
MOST_STEPS = 10
_SHARES = (1.0, 0.5, 0.2, 0.05)  # of the predicted size, to start from
_RESTS = 2  # times that starts are moved at the end


@dataclass(frozen=True)
class Refit:
    """A model refitted: ``costs[i]`` (S_i,) sums of squares of every piece, ``fitted`` over the fitted ones."""

    model: Model
    costs: list[Array]
    fitted: float
    held_out: float
    added: tuple[str, ...]


def refit(anchor: Anchor, model: Model, start: Mapping[str, float], most_steps: int = MOST_STEPS) -> Refit:
    """Fit ``model``, which has the anchor's effects and more, from the anchor's values and ``start`` [SI, by key]."""
    own = [k for k in start if model.entry(k).free]
    keys = [*anchor.keys, *own]
    values = {**anchor.values, **{k: float(v) for k, v in start.items()}}
    scales = {**anchor.scales, **{k: scale(model, k) for k in own}}
    bounds = [*anchor.bounds, *(model.entry(k).bounds for k in own)]
    for key, bound in zip(keys, bounds, strict=True):
        low, high = bound  # type: ignore[misc]
        values[key] = min(max(values[key], low), high)
    plant = Plant(model)
    starts = [s.copy() for s in anchor.shooting.starts]
    raw, values = _begin(anchor, plant, model, values, own, starts)
    if raw is None:
        return Refit(model, anchor.costs, *_sums(anchor, anchor.costs), tuple(own))
    residual = [lin.project(r) for lin, r in zip(anchor.linear, raw, strict=True)]
    cost = _sums(anchor, [np.sum(r**2, axis=1) for r in residual])[0]
    damping = 1e-3
    for _ in range(most_steps):
        columns = _columns(anchor, plant, values, own, scales, starts, raw, model)
        if columns is None:
            break
        beyond = project(anchor.linear, columns) if own else columns
        every = [np.concatenate([a, b], axis=-1) for a, b in zip(anchor.beyond, beyond, strict=True)]
        information = inner(anchor.split, every, every)
        gradient = inner(anchor.split, every, [r[..., None] for r in residual])[:, 0]
        used = {k: values[k] for k in keys}
        moved = False
        while damping <= _MOST_DAMPING:
            change = bounded_step(information, gradient, used, scales, bounds, damping)
            tried = {**values, **{k: used[k] + float(change[i]) * scales[k] for i, k in enumerate(keys)}}
            there = []
            for lin, s, r, a, b, p in zip(
                anchor.linear, starts, raw, anchor.columns, columns, anchor.shooting.pieces, strict=True
            ):
                ahead = r + np.concatenate([a, b], axis=-1) @ change
                new = s.copy()
                new[:, p.free] += (lin.back @ ahead[..., None])[..., 0]
                there.append(new)
            again = _run(anchor, plant, tried, there)
            if again is not None:
                left = [lin.project(r) for lin, r in zip(anchor.linear, again, strict=True)]
                lower = _sums(anchor, [np.sum(r**2, axis=1) for r in left])[0]
                if lower < cost:
                    moved = True
                    break
            damping *= 8.0
        if not moved:
            break
        assert again is not None
        gain = (cost - lower) / cost
        values, starts, raw, residual, cost = tried, there, again, left, lower
        damping = max(damping / 5.0, 1e-6)
        if gain < _FLAT:
            break
    costs = _settled(anchor, plant, values, starts, raw)
    done = model.with_values(within(model, values), source="fitted")
    return Refit(done, costs, *_sums(anchor, costs), tuple(own))


def _begin(
    anchor: Anchor, plant: Plant, model: Model, values: dict[str, float], own: list[str], starts: list[Array]
) -> tuple[list[Array] | None, dict[str, float]]:
    """Where to start: as far towards the prediction as lowers the sum of squares."""
    nulls = {k: model.parameter(k).null for k in own}
    for share in _SHARES:
        tried = dict(values)
        for key, null in nulls.items():
            if null is not None:
                tried[key] = between(null, values[key], share, model.parameter(key).default)
        raw = _run(anchor, plant, tried, starts)
        if raw is not None:
            cost = _sums(
                anchor, [np.sum(lin.project(r) ** 2, axis=1) for lin, r in zip(anchor.linear, raw, strict=True)]
            )
            if cost[0] < _sums(anchor, anchor.costs)[0] or share == _SHARES[-1]:
                return raw, tried
    return None, values


def _settled(
    anchor: Anchor, plant: Plant, values: Mapping[str, float], starts: list[Array], raw: list[Array]
) -> list[Array]:
    """Sums of squares of the pieces, each from the best of a few starts."""
    costs = [np.sum(lin.project(r) ** 2, axis=1) for lin, r in zip(anchor.linear, raw, strict=True)]
    for _ in range(_RESTS):
        there = []
        for lin, s, r, p in zip(anchor.linear, starts, raw, anchor.shooting.pieces, strict=True):
            new = s.copy()
            new[:, p.free] += (lin.back @ r[..., None])[..., 0]
            there.append(new)
        again = _run(anchor, plant, values, there)
        if again is None:
            break
        left = [np.sum(lin.project(r) ** 2, axis=1) for lin, r in zip(anchor.linear, again, strict=True)]
        better = [b < a for a, b in zip(costs, left, strict=True)]
        costs = [np.where(c, b, a) for a, b, c in zip(costs, left, better, strict=True)]
        starts = [np.where(c[:, None], n, s) for s, n, c in zip(starts, there, better, strict=True)]
        raw = [np.where(c[:, None], n, r) for r, n, c in zip(raw, again, better, strict=True)]
    return costs


def _sums(anchor: Anchor, costs: list[Array]) -> tuple[float, float]:
    fitted = sum(float(c[f].sum()) for c, f in zip(costs, anchor.split.fitted, strict=True))
    held = sum(float(c[~f].sum()) for c, f in zip(costs, anchor.split.fitted, strict=True))
    return fitted, held


def _run(anchor: Anchor, plant: Plant, values: Mapping[str, float], starts: list[Array]) -> list[Array] | None:
    try:
        found = anchor.shooting.run(plant.with_parameters(dict(values)), starts)
    except SimulationError:  # a step too far: the plant does not run there
        return None
    return found if all(np.isfinite(r).all() for r in found) else None


def _columns(anchor, plant, values, own, scales, starts, raw, model) -> list[Array] | None:
    found = []
    for key in own:
        high = model.entry(key).bounds[1]
        step = _STEP * max(abs(values[key]), 0.1 * scales[key])
        step = step if values[key] + step <= high else -step
        moved = _run(anchor, plant, {**values, key: values[key] + step}, starts)
        if moved is None:
            return None
        found.append([(m - r) * (scales[key] / step) for m, r in zip(moved, raw, strict=True)])
    return [
        np.stack([c[i] for c in found], axis=-1) if found else np.zeros((*raw[i].shape, 0)) for i in range(len(raw))
    ]
