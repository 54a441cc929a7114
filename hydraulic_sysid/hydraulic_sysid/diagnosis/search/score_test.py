"""How much each candidate would explain, from its sensitivities beyond those of the free parameters (score test).

Rao, Proc. Cambridge Phil. Soc. 44 (1948): what a parameter not yet fitted gains follows from residuals and
sensitivities at the present fit alone. Here with the bounds of all parameters, and at probes of finite size, as many
effects have no derivative at their null value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.levenberg_marquardt import bounded_step
from hydraulic_sysid.estimation.parallel import results
from hydraulic_sysid.estimation.parameters import Parameters

from .candidates import LARGE, SIZES, SMALL, Probe, RecordFeatures, between, inverse, observed, probes
from .criteria import CRITERIA
from .linearisation import Linearisation


@dataclass(frozen=True)
class CandidateScore:
    """A candidate and the best its probes predict.

    ``reduction`` of the sum of squares, and the values to ``start`` a refit from [SI, by key]; ``others``: where it may
    begin if that leads nowhere, as a prediction that far is rough.
    """

    effect: Effect
    reduction: float
    start: dict[str, float]
    others: tuple[dict[str, float], ...] = ()


@dataclass(frozen=True)
class _Prediction:
    """What one group of probes promises; ``change``: of the residuals, over what is left (sums of squares)."""

    score: CandidateScore
    change: float


def score(at: Linearisation, effects: Sequence[Effect], features: RecordFeatures) -> list[CandidateScore]:
    """All candidates, the best first; reductions of all segments for fitting, of which a sample is looked at."""
    part, share = at.sample(CRITERIA.enough_to_score)
    one = part.of_one_record()
    _ = part.own_reduction, part.costs, one.own_reduction, one.costs  # once, for all that work at the same time
    found = list(results(lambda effect: _score(part, one, effect, features), effects))
    scaled = [replace(f, reduction=f.reduction / share) for f in found if f is not None]
    return sorted(scaled, key=lambda f: -f.reduction)


def _score(at: Linearisation, one: Linearisation, effect: Effect, features: RecordFeatures) -> CandidateScore | None:
    """By probes of usual sizes; by larger ones where those change nothing, by smaller ones where they go too far.

    ``one``: a part of the segments, on which many probes are narrowed down first.
    """
    model = at.model.with_effect(effect.name)

    def predictions(sizes: Sequence[float]) -> list[_Prediction]:
        groups = list(probes(effect, features, sizes))
        if len(groups) > CRITERIA.many_probes:
            rough = [(_predict(one, model, effect, group), group) for group in groups]
            near = sorted([(p.score.reduction, i) for i, (p, _) in enumerate(rough) if p is not None], reverse=True)
            nearest = [groups[i] for _, i in near[: CRITERIA.nearest_probes]]
            groups = nearest if len(nearest) == CRITERIA.nearest_probes else groups
        every = [_predict(at, model, effect, group) for group in groups]
        return [p for p in every if p is not None]

    tried = [predictions(SIZES)]
    if max((p.change for p in tried[0]), default=0.0) < CRITERIA.too_near:
        tried.append(predictions(LARGE))
    if not tried[-1] or min(p.change for p in tried[-1]) > CRITERIA.too_far * max(_beyond_noise(at), CRITERIA.law):
        tried.append(predictions(SMALL))
    found = [p.score for every in tried for p in every]
    return _best(found) if found else None


def _beyond_noise(at: Linearisation) -> float:
    """The share (0…1) of the sum of squares that noise does not explain."""
    left = sum(float(c.sum()) for c in at.costs)
    return max(1.0 - sum(int(s.counted.sum()) for s in at.split.segments) / left, 0.0) if left > 0.0 else 0.0


def _best(found: Sequence[CandidateScore]) -> CandidateScore:
    """The best of one effect's; if not from there, from its probe, or from the best of each other shape."""
    best, *rest = sorted(found, key=lambda f: -f.reduction)
    shape = [f"{best.effect.name}.{p.name}" for p in best.effect.parameters if p.null is None]
    seen, more = {tuple(best.start[key] for key in shape)}, list(best.others)
    for one in rest:
        own = tuple(one.start[key] for key in shape)
        if own not in seen and one.reduction > CRITERIA.starts_as_well * best.reduction:
            seen.add(own)
            more.append(one.start)
    return replace(best, others=tuple(more))


def _predict(at: Linearisation, model: Model, effect: Effect, group: list[Probe]) -> _Prediction | None:
    try:
        # Each with the steps that its own values ask for: the effect's defaults may be those of a larger plant.
        columns = at.changes([Plant.for_fits(model.with_values(p.values)) for p in group])
    except SimulationError:
        return None
    start = dict(group[0].values)
    if observed(effect):
        return _Prediction(CandidateScore(effect, _as_observed(at, columns), start), 0.0)
    own = len(at.parameters)
    normal = at.bordered(columns)
    # What changes nothing by itself, as a damping where there is no spring, begins at its null value.
    size = np.diag(normal.information)[own:]
    usable = np.flatnonzero((size > 1e-12 * max(float(size.max()), 1e-300)) & (size >= 1e-6))
    if not usable.size:
        return None
    group = [group[i] for i in usable]
    normal = normal.subset(np.concatenate((np.arange(own), own + usable)))
    # In units of the probes: 0 is the null value, 1 the probe.
    reach = np.array([_reach(effect, p) for p in group])
    none, one = np.zeros(usable.size), np.ones(usable.size)
    low, high = reach.T
    unlimited = np.inf * one
    units = Parameters(tuple(p.moved for p in group), none, one, low, high, none, unlimited, unlimited, none)
    change = bounded_step(normal, at.parameters + units)
    gain = normal.reduction(change) - at.own_reduction
    for p, amount in zip(group, change[own:].tolist(), strict=True):
        start[p.moved] = between(p.null, p.values[p.moved], amount, _parameter(effect, p).default)
    probed = {**start, **{p.moved: p.values[p.moved] for p in group}}
    change_of_residual = float(size[usable].min()) / max(sum(float(c.sum()) for c in at.costs), 1e-300)
    return _Prediction(CandidateScore(effect, gain, start, () if probed == start else (probed,)), change_of_residual)


def _as_observed(at: Linearisation, change: list[Array]) -> float:
    """What an effect gains whose size the records show: nothing is left to fit, and nothing to differentiate."""
    raw = [p.raw[..., None] + c for p, c in zip(at.point.projections, change, strict=True)]
    after = sum(float(np.sum(r**2)) for r in at.point.beyond(raw))
    return sum(float(c.sum()) for c in at.costs) - after


def _parameter(effect: Effect, probe: Probe) -> Parameter:
    return next(p for p in effect.parameters if f"{effect.name}.{p.name}" == probe.moved)


def _reach(effect: Effect, probe: Probe) -> tuple[float, float]:
    """The parameter's bounds in units of the probe."""
    parameter, value = _parameter(effect, probe), probe.values[probe.moved]
    low, high = parameter.bounds
    if inverse(probe.null, parameter.default):
        return 0.0, value / low
    span = value - probe.null
    first, second = sorted(((low - probe.null) / span, (high - probe.null) / span))
    return first, second
