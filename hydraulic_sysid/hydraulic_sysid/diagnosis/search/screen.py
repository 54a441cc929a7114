"""How much each candidate would explain, from its sensitivities beyond those of the free parameters (score test).

Rao, Proc. Cambridge Phil. Soc. 44 (1948): the gain of a parameter not yet fitted follows from residuals and
sensitivities at the present fit alone. Here with the bounds of all parameters, and at probes of finite size, as many
effects have no derivative at their null value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.steps import bounded_step

from .anchor import Anchor, inner, project
from .candidates import LARGE, SIZES, Hints, Probe, between, inverse, observed, probes

Array = NDArray[np.float64]

ENOUGH = 50  # pieces that do for a look, spread over all records


@dataclass(frozen=True)
class Prospect:
    """A candidate and the best its probes promise: ``gain`` of the sum of squares, ``start`` values [SI, by key]."""

    effect: Effect
    gain: float
    start: dict[str, float]


def screen(anchor: Anchor, effects: Sequence[Effect], hints: Hints) -> list[Prospect]:
    """All candidates, the most promising first; gains of all fitted pieces, some of which are looked at."""
    part, share = sample(anchor)
    found = [_prospect(part, effect, hints, share) for effect in effects]
    return sorted((f for f in found if f is not None), key=lambda f: -f.gain)


def sample(anchor: Anchor) -> tuple[Anchor, float]:
    """The anchor on fitted pieces alone, on every so many of them; and what share of them that is."""
    total = sum(int(f.sum()) for f in anchor.split.fitted)
    every = max(1, round(total / ENOUGH))
    chosen = []
    for fitted in anchor.split.fitted:
        keep = np.zeros_like(fitted)
        keep[np.flatnonzero(fitted)[::every]] = True
        chosen.append(keep)
    return anchor.some(chosen), sum(int(c.sum()) for c in chosen) / max(total, 1)


def _prospect(anchor: Anchor, effect: Effect, hints: Hints, share: float) -> Prospect | None:
    plant = Plant(anchor.model.with_effect(effect.name))
    best: Prospect | None = None
    for sizes in (SIZES, LARGE):
        for group in probes(effect, hints, sizes):
            found = _predict(anchor, plant, effect, group)
            if found is not None and (best is None or found.gain > best.gain):
                best = found
        if best is not None:
            break
    return None if best is None else replace(best, gain=best.gain / share)


def _predict(anchor: Anchor, plant: Plant, effect: Effect, group: list[Probe]) -> Prospect | None:
    shooting, linear = anchor.shooting, anchor.linear
    columns = []
    for probe in group:
        moved = plant.with_parameters({**anchor.values, **probe.values})
        try:
            raw = shooting.run(moved)
        except SimulationError:
            return None
        columns.append([r - lin.raw for r, lin in zip(raw, linear, strict=True)])
    if observed(effect):
        return _as_observed(anchor, effect, group[0], columns[0])
    stacked = project(linear, [np.stack([c[i] for c in columns], axis=-1) for i in range(len(linear))])
    new = inner(anchor.split, stacked, stacked)
    size = np.diag(new)
    usable = (size > 1e-12 * max(float(size.max()), 1e-300)) & (size >= 1e-6)
    if not usable.any():
        return None
    # What changes nothing by itself, as a damping where there is no spring, begins at its null value.
    group = [p for p, u in zip(group, usable, strict=True) if u]
    stacked = [s[..., usable] for s in stacked]
    new = new[np.ix_(usable, usable)]
    cross = inner(anchor.split, anchor.beyond, stacked)
    information = np.block([[anchor.information, cross], [cross.T, new]])
    residual = [r[..., None] for r in anchor.residual]
    gradient = np.concatenate(
        [inner(anchor.split, anchor.beyond, residual)[:, 0], inner(anchor.split, stacked, residual)[:, 0]]
    )
    # In units of the probes: 0 is the null value, 1 the probe.
    values = {**anchor.values, **{p.moved: 0.0 for p in group}}
    scales = {**anchor.scales, **{p.moved: 1.0 for p in group}}
    bounds = [*anchor.bounds, *(_reach(effect, p) for p in group)]
    change = bounded_step(information, gradient, values, scales, bounds, 1e-9)
    without = (
        bounded_step(
            anchor.information, gradient[: len(anchor.keys)], anchor.values, anchor.scales, anchor.bounds, 1e-9
        )
        if anchor.keys
        else np.zeros(0)
    )
    gain = _quadratic(information, gradient, change) - _quadratic(
        anchor.information, gradient[: len(anchor.keys)], without
    )
    start = dict(group[0].values)
    for p, amount in zip(group, change[len(anchor.keys) :], strict=True):
        start[p.moved] = between(p.null, p.values[p.moved], float(amount), _parameter(effect, p).default)
    return Prospect(effect, float(gain), start)


def _as_observed(anchor: Anchor, effect: Effect, probe: Probe, change: list[Array]) -> Prospect:
    """The gain of an effect whose size the records show: nothing is left to fit, and nothing to differentiate."""
    gain = 0.0
    for lin, c in zip(anchor.linear, change, strict=True):
        gain += float(np.sum(lin.residual**2) - np.sum(lin.project(lin.raw + c) ** 2))
    return Prospect(effect, gain, dict(probe.values))


def _parameter(effect: Effect, probe: Probe) -> Parameter:
    return next(p for p in effect.parameters if f"{effect.name}.{p.name}" == probe.moved)


def _reach(effect: Effect, probe: Probe) -> tuple[float, float]:
    """The parameter's bounds in units of the probe."""
    parameter, value = _parameter(effect, probe), probe.values[probe.moved]
    low, high = parameter.bounds
    if inverse(probe.null, parameter.default):
        return 0.0, value / low
    span = value - probe.null
    ends = sorted(((low - probe.null) / span, (high - probe.null) / span))
    return ends[0], ends[1]


def _quadratic(information: Array, gradient: Array, change: Array) -> float:
    return float(-2.0 * gradient @ change - change @ information @ change)
