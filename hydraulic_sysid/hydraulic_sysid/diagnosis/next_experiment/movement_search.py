"""The search: all movements on all models, the best sequence of them by exchange, then finer numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from hydraulic_node_utils import processors
from hydraulic_sim.errors import SimulationError
from hydraulic_sysid.excitation.amplitude import Limits

from .errors import NextExperimentError
from .evidence import Evidence, Pair, Point, as_record, evidence, pairs
from .movements import Bench, Movement, every
from .reference import Leader, extremes, play, used

_SHORTER = 6  # attempts to bring a movement within the limits
_JUST = 0.97  # of what is allowed, aimed at
_KEPT = 16  # movements that a second search takes over from the first
_PASSES = 4  # through the sequence, each place exchanged for what is best there
_FINER = 10  # trials with other numbers per movement of the sequence
_SPREAD = 1.4  # factor of the first trials

Say = Callable[[str], None]


@dataclass(frozen=True)
class JudgedMovement:
    """A movement within the limits, and what it shows."""

    movement: Movement
    evidence: Evidence
    limited_by: str


@dataclass(frozen=True)
class MovementSearch:
    """Models, limits, noise and bench of one search. ``first``: how many points are the models as fitted."""

    points: Sequence[Point]
    first: int
    limits: Limits
    noise: Mapping[str, float]
    bench: Bench
    length: float

    @property
    def pairs(self) -> list[Pair]:
        """Pairs of models that the experiment is to tell apart."""
        return pairs(self.points, self.first)

    def candidates(self, say: Say) -> list[JudgedMovement]:
        """Every movement that can be made to keep the limits.

        :raises NextExperimentError: there is none.
        """
        allowed: list[tuple[Movement, str]] = []
        found: list[JudgedMovement] = []
        with ThreadPoolExecutor(processors.usable()) as pool:
            say("movements within the limits")
            for one in pool.map(self.within, every()):
                if one is not None and not any(one[0].like(other) for other, _ in allowed):
                    allowed.append(one)
            for number, judged in enumerate(pool.map(lambda a: self.judged(*a), allowed)):
                say(f"movement {number + 1} of {len(allowed)}")
                if judged is not None:
                    found.append(judged)
        if not found:
            raise NextExperimentError(
                "no movement keeps the limits on every model, however small: "
                f"drive {self.limits.drive:g} V, travel {self.limits.travel:g} m, velocity {self.limits.velocity:g} "
                f"m/s, pressures {self.limits.pressure_min:g} to {self.limits.pressure_max:g} Pa"
            )
        return found

    def again(self, found: Sequence[JudgedMovement], say: Say) -> list[JudgedMovement]:
        """The most telling of candidates that were judged at fewer points, judged at all of this search."""
        points = max(i for i in found[0].evidence.information) + 1
        old = replace(self, points=self.points[:points])
        keep = sorted(found, key=lambda c: -old.score([c]))[:_KEPT]
        say("the most telling movements once more")
        with ThreadPoolExecutor(processors.usable()) as pool:
            judged = pool.map(lambda c: self.judged(c.movement, c.limited_by), keep)
            return [one for one in judged if one is not None]

    def within(self, movement: Movement) -> tuple[Movement, str] | None:
        """The movement, smaller where a limit asks for it, and which does; None where no size helps."""
        reason = ""
        for _ in range(_SHORTER):
            try:
                part, limit = self.largest_part(movement)
            except SimulationError:
                part, limit = 2.0, "the model"
            if part <= 1.0:
                return movement, reason
            smaller = movement.scaled(max(_JUST / part, 0.3), limit == "travel")
            if smaller == movement:
                return None
            movement, reason = smaller, limit
        return None

    def largest_part(self, movement: Movement) -> tuple[float, str]:
        """The largest part of a limit that any model uses, and of which.

        :raises SimulationError: a model cannot follow.
        """
        lead = self.points[0]
        played = play(lead.plant, Leader.of(lead.model), [movement], self.bench)
        worst, limit = 0.0, ""
        for point in self.points[: self.first]:
            start = point.plant.initial_state(position=self.bench.centre)
            run = point.plant.simulate(played.drive, 1.0 / self.bench.rate, start)
            rest = (float(run.pressure_a[0]), float(run.pressure_b[0]))
            for name, part in used(self.limits, extremes(point.name, run), rest, self.bench.centre).items():
                if part > worst:
                    worst, limit = part, name
        return worst, limit

    def judged(self, movement: Movement, reason: str = "") -> JudgedMovement | None:
        """What the movement shows; None where a model cannot follow."""
        lead = self.points[0]
        try:
            played = play(lead.plant, Leader.of(lead.model), [movement], self.bench)
            record = as_record(
                movement.kind, played.trajectory, 1.0 / self.bench.rate, list(self.noise),
                lead.model.value("spool_travel"),
            )  # fmt: skip
            return JudgedMovement(movement, evidence(self.points, self.pairs, record, self.noise, self.length), reason)
        except SimulationError:
            return None

    def best(self, found: Sequence[JudgedMovement], places: int) -> list[JudgedMovement]:
        """The best sequence of so many movements: one by one, then each exchanged while that helps."""
        chosen: list[JudgedMovement] = []
        for _ in range(places):
            chosen.append(max(found, key=lambda c: self.score([*chosen, c])))
        for _ in range(_PASSES):
            before = list(chosen)
            for place in range(places):
                others = chosen[:place] + chosen[place + 1 :]
                chosen[place] = max([chosen[place], *found], key=lambda c, rest=others: self.score([*rest, c]))  # type: ignore[misc]
            if chosen == before:
                break
        return chosen

    def refined(self, chosen: list[JudgedMovement], say: Say) -> list[JudgedMovement]:
        """The sequence with finer numbers, place by place (Nelder-Mead in the logarithms)."""
        chosen = list(chosen)
        for place in range(len(chosen)):
            say(f"finer numbers for movement {place + 1} of {len(chosen)}")
            chosen[place] = self._finer(chosen[:place] + chosen[place + 1 :], chosen[place])
        return chosen

    def score(self, chosen: Sequence[JudgedMovement]) -> float:
        """The larger the better; the pair that is closest counts most."""
        total = chosen[0].evidence
        for other in chosen[1:]:
            total = total + other.evidence
        return -sum(1.0 / (1.0 + left) for left in total.left(self.points).values())

    def _finer(self, others: list[JudgedMovement], one: JudgedMovement) -> JudgedMovement:
        family = one.movement.family
        names = [n for n in family.ranges if n != "cycles"]
        signs = {n: math.copysign(1.0, one.movement.numbers[n]) for n in names}
        start = np.array([math.log(abs(one.movement.numbers[n])) for n in names])
        best, most = one, self.score([*others, one])

        def cost(logs: np.ndarray) -> float:
            nonlocal best, most
            moved = {n: signs[n] * math.exp(v) for n, v in zip(names, logs.tolist(), strict=True)}
            if any(not family.ranges[n][0] <= v <= family.ranges[n][1] for n, v in moved.items()):
                return 0.0
            movement = one.movement.moved(moved)
            try:
                part, limit = self.largest_part(movement)
            except SimulationError:
                return 0.0
            trial = self.judged(movement, one.limited_by) if part <= 1.0 else None
            if trial is None:
                return 0.0
            reached = self.score([*others, trial])
            if reached > most:
                best, most = trial, reached
            return reached

        step = math.log(_SPREAD)
        simplex = np.array([start, *(start + step * (np.arange(len(names)) == i) for i in range(len(names)))])
        minimize(
            lambda x: -cost(x), start, method="Nelder-Mead",
            options={"maxfev": _FINER, "initial_simplex": simplex, "xatol": 0.02, "fatol": 0.0},
        )  # fmt: skip
        return best
