"""Design the experiment on which competing models disagree most, after each has been refitted as well as it can."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sysid.estimation.segments import MEASURED
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.amplitude import Limits
from hydraulic_sysid.excitation.plan import Prediction
from hydraulic_sysid.excitation.simulated_run import SimulatedRun

from . import plan_file
from .document import CLEAR, Design, document
from .errors import NextExperimentError
from .evidence import Point
from .movement_search import JudgedMovement, MovementSearch
from .movements import Bench, Movement
from .reference import Leader, Played, play
from .verify import CrossFit, refits, simulated_runs

_MOVEMENT_S = 5.0  # about the time of one movement
_MOST_MOVEMENTS = 6
_SHORTEST_S, _LONGEST_S = 2.0, 600.0
_ROUNDS = 2  # of the search, each at what the refits of the one before ended at
_OPTIMISTIC = 0.5  # of what the sensitivities promise: below, the refits are searched around as well
_PLENTY = 2.0  # times what is clear, from which on nothing better is searched for
_MOST_REFITS = 8  # pairs of models, the closest ones
_SMALLER = 8  # attempts to bring the whole within the limits

Say = Callable[[str], None]


@dataclass(frozen=True)
class Proposal:
    """The experiment as a plan, and everything that is known about it before it is run (docs/report-json.md)."""

    plan: Plan
    document: dict[str, Any]

    def save(self, folder: Path) -> Path:
        """Write plan file and drive (CSV) side by side. Returns the plan file.

        :raises NextExperimentError: one of them exists.
        """
        return plan_file.save(self.plan, folder)


@dataclass(frozen=True)
class _Tried:
    """A sequence of movements, played on and fitted by every model."""

    chosen: list[JudgedMovement]
    played: Played
    plan: Plan
    seen: list[SimulatedRun]
    limited_by: str
    refits: list[CrossFit]

    @property
    def separation(self) -> float:
        """Of the closest pair."""
        return min(r.separation for r in self.refits)


def limits_of(models: Mapping[str, Model], centre: float = 0.0) -> Limits:
    """The tightest limits of all models (see `Limits.of`)."""
    every = [Limits.of(model, centre) for model in models.values()]
    return Limits(
        drive=min(one.drive for one in every),
        travel=min(one.travel for one in every),
        velocity=min(one.velocity for one in every),
        pressure_min=max(one.pressure_min for one in every),
        pressure_max=min(one.pressure_max for one in every),
    )


def next_experiment(
    models: Mapping[str, Model],
    limits: Limits,
    noise: Mapping[str, float],
    seconds: float = 20.0,
    progress: Say | None = None,
    *,
    centre: float = 0.0,
    rate: float = 1000.0,
    segment_length: float = 0.5,
) -> Proposal:
    """The experiment of about ``seconds`` that best distinguishes ``models`` (name → fitted model).

    It is made of movements (`movements.FAMILIES`), each of which is tried on every model; those are taken that leave
    most between the two closest models after a refit (see `evidence`). ``limits`` are kept by every model with a tenth
    to spare; ``noise``: standard deviation of each measured channel [m, Pa]; ``centre`` [m]: where the piston starts;
    ``rate`` [Hz]; ``segment_length`` [s]: of the segments in which the models are fitted afterwards.

    :raises NextExperimentError: fewer than two models, no movement within the limits, values that make no sense.
    """
    _check(models, noise, seconds)
    say = progress or (lambda _: None)
    places = min(max(1, round(seconds / _MOVEMENT_S)), _MOST_MOVEMENTS)
    time = round(seconds / places * rate) / rate
    bench = Bench((1.0 - plan_file.TRACKING) * limits.drive, limits.travel, centre, time, rate)
    points = [Point(name, model) for name, model in models.items()]
    first, best = len(points), None
    found: list[JudgedMovement] = []
    for number in range(_ROUNDS):
        search = MovementSearch(points, first, limits, noise, bench, segment_length)
        found = search.again(found, say) if found else search.candidates(say)
        chosen = search.refined(search.best(found, places), say)
        say("playing it on every model")
        tried = _try(search, chosen, say)
        if best is None or tried.separation > best[0].separation:
            best = (tried, search, found)
        promised = _total(chosen).left(points)
        further = [
            Point(points[r.pair[1]].name, points[r.pair[1]].model.with_values(r.values))
            for r in tried.refits
            if r.left < _OPTIMISTIC * promised[r.pair]
        ]
        if not further or tried.separation > _PLENTY * CLEAR or number == _ROUNDS - 1:
            break
        points = [*points, *further]
    tried, search, found = best  # type: ignore[misc]
    plan = replace(tried.plan, prediction=_over_all(tried, list(models)))
    design = Design(models, search, found, tried.chosen, tried.played, plan, tried.seen, tried.limited_by, tried.refits)
    return Proposal(plan, document(design))


def _try(search: MovementSearch, chosen: list[JudgedMovement], say: Say) -> _Tried:
    """The sequence as a plan that every model can play within the limits, smaller where needed, and all refits."""
    lead, bench = search.points[0], search.bench
    models = search.points[: search.first]
    leader = Leader.of(lead.model)
    movements: list[Movement] = [c.movement for c in chosen]
    part, limit, reason = 0.0, "", ""
    with TemporaryDirectory() as folder:
        for _ in range(_SMALLER):
            try:
                played = play(lead.plant, leader, movements, bench)
                plan = plan_file.make(played, search.limits, bench.centre, bench.rate, Path(folder), _words(movements))
                seen, part, limit = simulated_runs(plan, models, search.limits, bench.centre)
            except SimulationError:
                part, limit = 2.0, "the model"
            if part <= 1.0:
                break
            movements = [m.scaled(max(0.97 / part, 0.5), limit == "travel") for m in movements]
            reason = limit
        else:
            raise NextExperimentError(f"the movements one after the other keep no limits: {limit} breaks")
    say("refitting every model to every other")
    promised = _total(chosen).left(search.points)
    original = sorted((p for p in search.pairs if p[1] < search.first), key=lambda p: promised[p])[:_MOST_REFITS]
    done = refits(search.points, original, seen, plan, search.noise, search.length)
    chosen = [replace(c, movement=m) for c, m in zip(chosen, movements, strict=True)]
    return _Tried(chosen, played, plan, seen, reason or _first(chosen), done)


def _first(chosen: Sequence[JudgedMovement]) -> str:
    """What made any of the movements smaller."""
    return ", ".join(dict.fromkeys(c.limited_by for c in chosen if c.limited_by))


def _total(chosen: Sequence[JudgedMovement]) -> Any:
    total = chosen[0].evidence
    for other in chosen[1:]:
        total = total + other.evidence
    return total


def _over_all(tried: _Tried, names: Sequence[str]) -> Prediction:
    """The extremes over all models."""
    every = [s.extremes for s in tried.seen]
    return replace(
        every[0],
        model=", ".join(names),
        drive_peak=max(e.drive_peak for e in every),
        position_min=min(e.position_min for e in every),
        position_max=max(e.position_max for e in every),
        velocity_peak=max(e.velocity_peak for e in every),
        pressure_min=min(e.pressure_min for e in every),
        pressure_max=max(e.pressure_max for e in every),
        limited_by=tried.limited_by,
    )


def _words(movements: Sequence[Movement]) -> str:
    return "; ".join(m.family.words for m in movements)


def _check(models: Mapping[str, Model], noise: Mapping[str, float], seconds: float) -> None:
    if len(models) < 2:
        raise NextExperimentError(f"{len(models)} model given; an experiment distinguishes at least two")
    kinds = {model.kind for model in models.values()}
    if len(kinds) > 1:
        raise NextExperimentError(f"the models are of different kinds of plant: {', '.join(sorted(kinds))}")
    allowed = MEASURED if kinds == {"hydraulic"} else ("position",)
    if "position" not in noise:
        raise NextExperimentError(f"noise is given for {', '.join(noise) or 'nothing'}; the position's is needed")
    for channel, sigma in noise.items():
        if channel not in allowed:
            raise NextExperimentError(f"noise of {channel!r}: models are compared by {', '.join(allowed)}")
        if not (math.isfinite(sigma) and sigma > 0.0):
            raise NextExperimentError(f"noise of {channel} is {sigma:g}; allowed: a positive standard deviation")
    if not _SHORTEST_S <= seconds <= _LONGEST_S:
        raise NextExperimentError(f"seconds is {seconds:g}; allowed: {_SHORTEST_S:g} to {_LONGEST_S:g}")
