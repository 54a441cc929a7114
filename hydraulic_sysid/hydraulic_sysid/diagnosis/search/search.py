"""The search for what is missing: forward by refits of what the screen promises, backward by leaving out.

Forward selection with backward elimination (Efroymson 1960; here as in Draper & Smith, Applied Regression Analysis,
ch. 15), on pieces that were held out as well as on those that were fitted: an effect that does not lower both is none.
Then every member is set against what would take its place, so that a stand-in that came first does not stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sysid.estimation.estimate import Settings

from .anchor import Anchor, anchor, fitted, keys_of
from .candidates import Hints, candidates, observed, subsystem
from .chord import Refit, as_it_is, refit
from .levels import Level, level, material, repaired
from .pieces import Split
from .screen import Prospect, screen

PROMISING = 0.04  # of the best predicted gain, from which a candidate is refitted
MOST_REFITS = 8
LATER_REFITS = 4  # once something was added, …
ALIKE = 2  # … of one subsystem: what its laws left makes all of its effects look promising
FULL = 2  # candidates whose refit is finished with all sensitivities taken anew
NEAR = 0.93  # of the best gain, from which a refit is finished, …
FAR = 5.0  # … if it leaves no more than so many times what the best leaves
MOST_EFFECTS = 3
FURTHER = 0.25  # of what is left, which a further effect must repair, unless it repairs a good part of all
NEEDED = 0.02  # of all that was repaired, which an effect must repair beside the others to stay
LAW = 0.0025  # of all that was repaired: what a law that is right to a twentieth leaves for others of its subsystem …
ELSEWHERE = 0.0005  # … and for those of other subsystems
DISTANT = 0.02  # of what an effect repairs, by which a quick refit in its place may lie above, to be finished
SETTLED = 0.006  # mean square beyond the noise below which nothing more is looked for
EXPLAINED = 0.05  # mean square beyond the noise up to which little is left to ask
MOST_SWAPS = 3
MOSTLY = 0.9  # of what noise does not explain: where more is repaired, nobody asks what else might be nearest
ALONE = 0.5  # of what the best candidate repairs at first, below which all others leave it without a rival
HOPELESS = 0.6  # of what noise does not explain: where less is repaired, exchanging effects will not do either
PROMISED = 0.5  # of what an effect must repair, which its quick refit must show for it to be fitted to the end
LAST_STEPS = 8  # of a fit that begins where a quick refit ended, at most, …
LAST_GAIN = 5e-5  # … and while a step lowers the sum of squares by this share

Say = Callable[[str], None]
Enough = Callable[[str, Level, float], bool]


@dataclass(frozen=True)
class Trial:
    """A candidate, refitted beside the effects that are on."""

    name: str
    predicted: float
    refit: Refit
    level: Level


@dataclass(frozen=True)
class Stage:
    """A model with some effects, fitted, and the candidates tried on top of it, best first.

    ``anchor`` has no effects that records show by themselves: such as rounding have no derivative, and `model` and
    ``level`` are with them, the parameters as they are without; ``residual`` (S, m) per record is what `model` leaves.
    """

    model: Model
    anchor: Anchor
    level: Level
    residual: list[NDArray[np.float64]]
    trials: list[Trial] = field(default_factory=list)
    prospects: list[Prospect] = field(default_factory=list)


@dataclass(frozen=True)
class Found:
    """Where a search ended. ``rivals[name]``: the stage without that effect, with what was tried in its place."""

    base: Stage
    final: Stage
    added: list[str]
    steps: list[tuple[str, Level]]
    rivals: dict[str, Stage]


class Search:
    """One search over one split of records."""

    def __init__(self, split: Split, settings: Settings, say: Say, hints: Callable[[Anchor], Hints]) -> None:
        self.split, self.settings, self.say, self._hints = split, settings, say, hints
        self._last = replace(settings, most_steps=LAST_STEPS, least_gain=LAST_GAIN)

    def stage(self, model: Model, settings: Settings | None = None) -> Stage:
        """Fit a model and linearise it."""
        smooth, seen = model, _observed(model)
        for name in seen:
            smooth = smooth.without_effect(name)
        there = anchor(fitted(smooth, self.split, settings or self.settings), self.split)
        whole = _with_values(model, there.model)
        if not seen:
            return Stage(whole, there, level(self.split, there), there.residual)
        rounded = as_it_is(there, whole)
        return Stage(whole, there, level(self.split, rounded), rounded.raw)

    def explore(self, base: Stage, exclude: Sequence[str] = (), most: int = MOST_REFITS) -> Stage:
        """Screen all candidates on a stage and refit the best."""
        point = base.anchor
        found = screen(point, [e for e in candidates(base.model) if e.name not in exclude], self._hints(point))
        if not found:
            return base
        floor = max(PROMISING * found[0].gain, 0.2 * base.level.least)
        trials = []
        for prospect in _varied([p for p in found if p.gain > floor], ALIKE if most < MOST_REFITS else most)[:most]:
            self.say(f"refitting with {prospect.effect.name}")
            trials.append(self.trial(base, prospect))
        trials.sort(key=lambda t: t.level.total)
        return replace(base, anchor=point.slim(), trials=trials, prospects=found)

    def trial(self, base: Stage, prospect: Prospect) -> Trial:
        """A candidate refitted on a stage, from where the screen saw it."""
        point, name = base.anchor, prospect.effect.name
        done = refit(point, point.model.with_effect(name), prospect.start)
        if _observed(base.model):
            done = as_it_is(point, _with_values(base.model.with_effect(name), done.model))
        return Trial(name, prospect.gain, done, level(self.split, done))

    def finish(self, base: Stage, enough: Enough) -> Stage | None:
        """The best of the trials, fitted to the end; None where none is worth it.

        ``enough(name, level, part)``: whether an effect's level is a part of the way to being worth it.
        """
        worth = [t for t in base.trials if material(base.level, t.level) and enough(t.name, t.level, PROMISED)]
        if not worth:
            return None
        top = base.level.total - worth[0].level.total
        found = []
        near = [t for t in worth if base.level.total - t.level.total >= NEAR * top]
        for trial in [t for t in near if t.level.excess <= FAR * worth[0].level.excess + t.level.least][:FULL]:
            self.say(f"fitting with {trial.name}")
            try:
                found.append(self.stage(trial.refit.model, self._last))
            except SimulationError:
                continue
        found = [f for f in found if material(base.level, f.level) and enough(_new(f, base), f.level, 1.0)]
        return min(found, key=lambda f: f.level.total, default=None)

    def run(self, model: Model) -> Found:
        """Forward, backward, and every member against its rivals."""
        self.say("fitting the model as it is")
        base = stage = self.explore(self.stage(model))
        added: list[str] = []
        path = [stage]
        while len(added) < MOST_EFFECTS:
            better = self.finish(path[-1], partial(_worth, base, path[-1], added) if added else _anything)
            if better is None:
                break
            added.append(_new(better, path[-1]))
            nothing = better.level.variance - 1.0 < SETTLED
            last = len(added) == MOST_EFFECTS and repaired(base.level, better.level) > MOSTLY
            path.append(better if nothing or last else self.explore(better, most=LATER_REFITS))
            if nothing:
                break
        rivals = {added[-1]: path[-2]} if added else {}
        if len(added) <= 1:
            return Found(base, path[-1], added, [(name, path[-1].level) for name in added], rivals)
        final, kept, rivals = self._review(base, path[-1], added, rivals)
        if kept == added:
            return Found(base, final, added, [(n, p.level) for n, p in zip(added, path[1:], strict=True)], rivals)
        return Found(base, final, kept, self._steps(base, final, kept), rivals)

    def _review(
        self, base: Stage, stage: Stage, added: list[str], rivals: dict[str, Stage]
    ) -> tuple[Stage, list[str], dict[str, Stage]]:
        """Leave out what the others make superfluous; put in an effect's place what fits better there.

        ``rivals``: of the effect that came last, known already; it, too, may be superfluous, where it was only what
        brought the fit of the others out of a local minimum.
        """
        added, rivals, swaps = list(added), dict(rivals), 0
        queue = list(added)
        while queue and len(added) > 0:
            name = queue.pop(0)
            if name not in added:
                continue
            if len(added) == 1:
                rivals[name] = base
                break
            if _unrivalled(base, stage, name):
                rivals[name] = base
                continue
            without = self.stage(stage.model.without_effect(name), self._last)
            lost = without.level.total - stage.level.total
            part = repaired(without.level, stage.level)
            others = [a for a in added if a != name]
            if (
                not material(without.level, stage.level)
                or _mends_a_law(base, without, others, name, stage.level)
                or (part < FURTHER and lost < NEEDED * (base.level.total - stage.level.total))
            ):
                self.say(f"leaving out {name}")
                added.remove(name)
                stage, rivals, queue = without, {}, list(added)
                continue
            if name in rivals:
                continue
            without = self.explore(without, most=LATER_REFITS)
            rivals[name] = without
            left = stage.level.excess + DISTANT * (without.level.total - stage.level.total)
            close = [t for t in without.trials if t.name != name and t.level.excess < left]
            if not close or repaired(base.level, stage.level) < HOPELESS:
                continue
            without = replace(without, trials=close)
            other = self.finish(without, _anything)
            if (
                other is not None
                and name not in other.model.effects
                and swaps < MOST_SWAPS
                and (stage.level.total - other.level.total > stage.level.least)
            ):
                new = _new(other, without)
                self.say(f"{new} in the place of {name}")
                added[added.index(name)] = new
                stage, swaps = other, swaps + 1
                rivals, queue = {new: without}, [a for a in added if a != new]
        return stage, added, rivals

    def _steps(self, base: Stage, final: Stage, added: list[str]) -> list[tuple[str, Level]]:
        """The level after each effect, in the order of how much it repairs: the largest first."""
        if len(added) <= 1:
            return [(name, final.level) for name in added]
        single = {}
        for name in added:
            trial = next((t for t in base.trials if t.name == name), None)
            single[name] = trial.level if trial is not None else None
        order = sorted(added, key=lambda n: single[n].total if single[n] is not None else float("inf"))  # type: ignore[union-attr]
        steps: list[tuple[str, Level]] = []
        model = base.model
        for i, name in enumerate(order):
            if i == len(order) - 1:
                steps.append((name, final.level))
                break
            own = [k for k in final.model.keys() if k.startswith(f"{name}.")]  # noqa: SIM118, a method of the model
            model = model.with_effect(name, {k.split(".", 1)[1]: final.model.value(k) for k in own})
            steps.append((name, self.stage(model).level))
        added[:] = order
        return steps


def _observed(model: Model) -> list[str]:
    """Effects of a model whose size the records show by themselves."""
    return [name for name in model.effects if observed(model.library[name])]


def _with_values(model: Model, fitted: Model) -> Model:
    """The model with what was fitted in one that lacks some of its effects."""
    return model.with_values({k: fitted.value(k) for k in keys_of(fitted)}, source="fitted")


def _worth(base: Stage, before: Stage, added: Sequence[str], name: str, after: Level, part: float) -> bool:
    """Whether a further effect repairs enough (times ``part``): a good part of what is left, or something of what there
    was, where the others repair most of it. What repairs little where most is left would be a stand-in."""
    if _mends_a_law(base, before, added, name, after, part):
        return False
    if repaired(before.level, after) >= part * FURTHER:
        return True
    most = repaired(base.level, before.level) >= HOPELESS
    return most and repaired(base.level, after) - repaired(base.level, before.level) >= part * NEEDED


def _mends_a_law(base: Stage, before: Stage, others: Sequence[str], name: str, after: Level, part: float = 1.0) -> bool:
    """Whether an effect repairs so little of all that it may be what the laws of the others leave.

    One of another subsystem that repairs most of what is left is believed.
    """
    library = base.model.library
    alike = any(subsystem(library[name]) == subsystem(library[other]) for other in others)
    if not alike and repaired(before.level, after) >= part * HOPELESS:
        return False
    least = part * (LAW if alike else ELSEWHERE)
    return before.level.total - after.total < least * (base.level.total - after.total)


def _anything(name: str, after: Level, part: float) -> bool:
    """No more is asked than that a gain is one."""
    return True


def _varied(found: Sequence[Prospect], most: int) -> list[Prospect]:
    """In their order, and no more than so many of one subsystem."""
    places = [subsystem(p.effect) for p in found]
    return [p for i, p in enumerate(found) if places[:i].count(places[i]) < most]


def _unrivalled(base: Stage, final: Stage, name: str) -> bool:
    """Whether an effect repairs by itself most of what is off, and no other candidate comes near it: by what they
    repair or, where in the end all is explained, by what they leave."""
    found = {t.name: t.level for t in base.trials}
    if name not in found or base.level.total - found[name].total < MOSTLY * base.level.excess:
        return False
    others = [at for other, at in found.items() if other != name]
    alone = all(base.level.total - at.total < ALONE * (base.level.total - found[name].total) for at in others)
    explained = final.level.variance - 1.0 < EXPLAINED
    return alone or (explained and all(at.excess > FAR * (found[name].excess + at.least) for at in others))


def _new(stage: Stage, before: Stage) -> str:
    """The effect that a stage has beyond another."""
    return next(e for e in stage.model.effects if e not in before.model.effects)
