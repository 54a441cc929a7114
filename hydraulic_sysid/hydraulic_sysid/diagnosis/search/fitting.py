"""Fits of a model to the segments of a search: from good starts, as far as it pays, judged by the noise they leave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TypeVar

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.errors import SegmentError
from hydraulic_sysid.estimation.fit import Fit, FitPoint, FitSettings, fit_segments
from hydraulic_sysid.estimation.known_starts import KnownStarts
from hydraulic_sysid.estimation.parameters import Parameters, bounded, clocked
from hydraulic_sysid.estimation.refinement import ordinary, refined
from hydraulic_sysid.estimation.segments import Segments, shorter

from .agreement import agreed, sure
from .candidates import observed
from .criteria import CRITERIA
from .data_sheet import priors, significant
from .errors import DiagnosisError
from .frozen_jacobian import refit_rounded
from .holdout import Split, split
from .linearisation import Linearisation
from .misfit import Misfit, material, misfit
from .progress import Progress, Watch
from .search_state import SearchState, loud

Say = Callable[[str], None]
F = TypeVar("F", bound="Fitting")


@dataclass(frozen=True)
class Task:
    """What a search is given: a model and records, cut into segments; ``short`` cuts them a quarter as long."""

    given: Model
    split: Split
    short: Callable[[], Split]
    settings: FitSettings
    say: Progress
    quick: bool = False
    """Whether what only confirms is left out."""


class Fitting:
    """Fits models to one split of records."""

    def __init__(self, task: Task) -> None:
        self.given, self.split, self.short, self.settings = task.given, task.split, task.short, task.settings
        self.say, self.quick = task.say, task.quick
        self.path: list[SearchState] = []
        """The model and what it became with each effect added, as far as the search has come."""
        self.priors = priors(task.given)
        self._starts: dict[frozenset[str], KnownStarts] = {}
        self._first = replace(task.settings, least_gain=CRITERIA.first_gain)
        self._few = replace(task.settings, most_steps=CRITERIA.few_steps, least_gain=CRITERIA.few_gain)
        self._last = replace(task.settings, most_steps=CRITERIA.last_steps, least_gain=CRITERIA.last_gain)

    @classmethod
    def of(
        cls: type[F], model: Model, records: Sequence[Record], validation: Sequence[Record], settings: FitSettings,
        say: Say, within: float | None = None, watch: Watch | None = None, quick: bool = False,
        test: Sequence[Record] = (),
    ) -> F:  # fmt: skip
        """Cut the records; free parameters without bounds get those of a data sheet.

        :param within: seconds after which the search ends with the best so far
        :param watch: takes what is found meanwhile
        :param quick: fewer values, spread over all records, and nothing that only confirms
        :param test: records to test on; by default what is left of long ones
        :raises DiagnosisError: there are no records, or one cannot be cut.
        """
        if not records:
            raise DiagnosisError("there is no record to diagnose")
        model = bounded(model)
        length = settings.seconds(model, [*records, *validation])
        try:
            cuts = split(records, validation, model, length, quick, test)
            quarter = shorter(length, CRITERIA.shorter, [*records, *validation])
            short = cache(partial(split, records, validation, model, quarter, quick))
            progress = Progress(say, within, watch or (lambda _: None))
            return cls(Task(model, cuts, short, replace(settings, length=length), progress, quick))
        except SegmentError as error:
            raise DiagnosisError(str(error)) from None

    def state(self, model: Model, settings: FitSettings | None = None) -> SearchState:
        """Fit a model and linearise it."""
        smooth = differentiable(model)
        segments = self.split.some(CRITERIA.enough_to_fit) if settings is self._first else self.split.to_fit
        done = self.fitted_to(segments, smooth, settings or self.settings)
        starts = KnownStarts(self.starts(smooth))
        self._starts.pop(frozenset(smooth.effects), None)
        starts.keep(segments, done.point.initial_states)
        at = Linearisation.of(smooth.with_values(done.values, source="fitted"), self.split, self.priors, starts)
        left = misfit(self.split, at.costs, at.parameters.prior_cost)
        if left.variance < CRITERIA.far_off:  # else they are bent to what the model lacks
            starts.keep(self.split.segments, at.point.initial_states)
            self._starts[frozenset(smooth.effects)] = starts
        if smooth is model:
            return SearchState(at.model, at, left, at.residual)
        seen = refit_rounded(at, with_fitted_values(model, at.model))
        return SearchState(seen.model, at, misfit(self.split, seen.costs, self.prior_cost(seen.model)), seen.residual)

    def as_it_is(self, model: Model) -> SearchState:
        """A model with the values that it has."""
        at = Linearisation.of(model, self.split, self.priors)
        return SearchState(model, at, misfit(self.split, at.costs, at.parameters.prior_cost), at.residual)

    def fitted_to(self, segments: Sequence[Segments], model: Model, settings: FitSettings) -> Fit:
        """A model, without effects that have no derivative, fitted to these segments."""
        smooth = differentiable(model)
        return fit_segments(
            Plant.for_fits(smooth), segments, smooth.movable_keys(), settings,
            progress=lambda *_: self.say.left(), priors=self.priors, starts=self.starts(smooth),
        )  # fmt: skip

    def with_exact_laws(self, model: Model, split: Split, competing: bool = False) -> Model:
        """A fitted model with the values that fit best where all laws are as they stand.

        A search lets them be off a little, each in each segment on its own, so that their details turn no verdict. What
        the model is used for afterwards has one value for all. One that is ``competing`` may have numbers of the data
        sheet free that say the same, along which a fit goes on for ever: it goes no further than those before.
        """
        smooth, settings = differentiable(model), self._last if competing else self.settings
        try:
            done = self.fitted_to([s.with_exact_laws() for s in split.to_fit], smooth, settings)
        except SimulationError:  # it does not run from where the records show the initial states
            return model
        return with_fitted_values(model, smooth.with_values(done.values))

    def starts(self, smooth: Model) -> KnownStarts | None:
        """Initial states that were fitted with a model's effects, or with the most of them and no others.

        Those of models that are not `Criteria.far_off`.
        """
        effects = frozenset(smooth.effects)
        known = [own for own in self._starts if own <= effects]
        return self._starts[max(known, key=len)] if known else None

    def prior_cost(self, model: Model) -> float:
        """What a model's values cost by what was known of them beforehand."""
        return Parameters.of(model, model.movable_keys(), self.priors).prior_cost

    def judged(self, state: SearchState) -> SearchState:
        """A state, judged by the noise that it shows itself.

        Where something is missing, delays may go to and fro: they are asked again while that lowers what is left.
        """
        back, left = False, np.inf
        for number in range(CRITERIA.most_judged):
            self.say("noise of the records")
            at, before = state.linearisation, self.split
            segments = refined(at.point, at.columns, self._laws(state.model))
            after = before.judged(segments, ordinary(at.point, segments))
            # What is far off says little of the noise, however often it is asked.
            far = state.misfit.variance >= CRITERIA.far_off
            more = len(after) > len(before)  # segments that are back are judged once more
            again = quieter(before, after) or (retimed(before, after) and state.misfit.variance < left)
            if number and not (back or more) and (far or not again):
                break
            self.split, back, left = after, more, state.misfit.variance
            state = self.state(state.model, self._last if state.misfit.variance < CRITERIA.far_off else self._first)
        return state

    def _laws(self, model: Model) -> list[str]:
        """Parameters that stand for a law: the free ones, not the numbers that a data sheet states, nor a clock's."""
        free = [k for k in model.free_keys() if "." in k or self.given.entry(k).free]
        return [k for k in free if not clocked(model, k)]

    def better(self, before: SearchState, after: SearchState) -> bool:
        """Whether what a state explains more than another is more than chance; where little is left, by any noise.

        What the records show by themselves was not found among many.
        """
        if not material(before.misfit, after.misfit):
            return False
        if not before.misfit.little:
            return True
        if without_derivative(after.model) == without_derivative(before.model):
            return agreed(before.residual, after.residual, self.split.fit)
        # What was not fitted has no size of which a share might be there: what segments gain is asked.
        gains = before.misfit.by_segment - after.misfit.by_segment
        return sure(gains, before.misfit.counted, before.misfit.fitted, found=False)

    def nearer(self, model: Model, far: bool) -> SearchState:
        """A model fitted: where it is ``far`` off, to the end only if it comes near.

        A resonance has many local minima. What leaves more than a little begins once more from where short segments
        lead: over few periods a wrong frequency is hardly a wrong phase.
        """
        found = self.state(model, self._first if far else self._last)
        if found.misfit.variance < CRITERIA.little**2:
            return found
        best = found
        with suppress(SimulationError):  # they lead where the plant does not run
            values = self.fitted_to_short_segments(model)
            if self.leads_elsewhere(values, found):
                best = min(found, self.state(values, self._first), key=lambda s: s.misfit.total)
        done = best.misfit.variance >= CRITERIA.far_off or (best is found and not far)
        return best if done else self.state(best.model, self._last)

    def begun_beyond(self, model: Model, keys: Sequence[str]) -> Model:
        """The model, each of these numbers where it leaves short segments least, wherever it may go.

        Between a wrong resonance and the right one there is no way downhill.
        """
        if not keys:
            return model
        smooth, short = differentiable(model), self.short().some(CRITERIA.enough_to_fit)
        for key in keys:
            now = smooth.value(key)
            low, high = smooth.entry(key).bounds or (now, now)
            costs = {}
            for value in [now, *np.linspace(low, high, CRITERIA.beyond_bound).tolist()]:
                try:
                    plant = Plant.for_fits(smooth.with_values({key: value}))
                    costs[value] = FitPoint.begin(plant, short, smooth.movable_keys(), priors=self.priors).cost
                except SimulationError:
                    continue
            smooth = smooth.with_values({key: min(costs, key=lambda v: costs[v], default=now)})
        return model.with_values({key: smooth.value(key) for key in keys})

    def begun_anew(self, state: SearchState) -> SearchState:
        """A state, or where that leaves less, one with the same effects fitted from the values of the model file.

        A model that lacks an effect is bent to imitate it, often up to bounds, and once the effect is there a fit from
        such values may end in a local minimum.
        """
        if state.misfit.at_the_noise:
            return state
        filed = self.with_filed_values(state.model)
        try:
            if not self.leads_elsewhere(filed, state):
                return state
            again = self.state(filed, self._last)
        except SimulationError:
            return state
        return min(state, again, key=lambda s: s.misfit.total)

    def fitted_to_short_segments(self, model: Model) -> Model:
        """The model with what a first fit to segments a quarter as long gives."""
        done = self.fitted_to(self.short().some(CRITERIA.shorter * CRITERIA.enough_to_fit), model, self._first)
        return model.with_values(done.values)

    def leads_elsewhere(self, model: Model, state: SearchState) -> bool:
        """Whether a fit that begins with this model's values leaves a few segments clearly less than a state does.

        That is less by a share of what noise does not explain, and by more than a fit to these segments alone gains.
        """
        before = self.left_on_few(state)
        values = sum(int(s.counted.sum()) for s in self.split.some(CRITERIA.look))
        needed = CRITERIA.significant * max(1.0, before / values) + CRITERIA.same_look * max(before - values, 0.0)
        if before <= needed:
            return False
        return before - self.looked_at(model, CRITERIA.fine_look * needed / before) > needed

    def looked_at(self, model: Model, least_gain: float = 0.0) -> float:
        """What a fit to a few segments leaves of them; it goes on while a step gains that share, or the usual one."""
        settings = replace(self._last, least_gain=max(least_gain, self._last.least_gain))
        return self.fitted_to(self.split.some(CRITERIA.look), model, settings).cost

    def left_on_few(self, state: SearchState) -> float:
        """What a state leaves of the same segments."""
        model = differentiable(state.model)
        few = self.split.some(CRITERIA.look)
        keys = model.movable_keys()
        starts = self.starts(model)
        return FitPoint.begin(Plant.for_fits(model), few, keys, priors=self.priors, starts=starts).at_rest().cost

    def with_filed_values(self, model: Model) -> Model:
        """A model with the values of the model file, where that has them."""
        return model.with_values({k: self.given.value(k) for k in self.given.movable_keys()})

    def _strict(self, base: SearchState) -> bool:
        """Whether the data sheet is as it was given."""
        at, given = base.model.entry, self.given.entry
        return all(
            (at(k).free, at(k).bounds) == (given(k).free, given(k).bounds) for k in self.given.keys() if "." not in k  # noqa: SIM118
        )  # fmt: skip

    def _added(self, model: Model) -> list[str]:
        return [e for e in model.effects if e not in self.given.effects]


def quieter(before: Split, after: Split) -> bool:
    """Whether the noise of any channel has turned out to be clearly smaller, in all of a record or in parts of it."""
    return any(
        n < CRITERIA.quieter * o
        for new, old in zip(after.segments, before.segments, strict=True)
        for n, o in zip(loud(new), loud(old), strict=True)
    )


def spiked(before: Split, after: Split, residual: Sequence[Array]) -> float:
    """What samples that have turned out to be spikes had left of a ``residual`` (S, m) per record: sum of squares."""
    return sum(
        float(np.sum(old.by_channel(left)[new.outliers & ~old.outliers] ** 2))
        for new, old, left in zip(after.segments, before.segments, residual, strict=True)
        if len(new) == len(old)
    )


def retimed(before: Split, after: Split) -> bool:
    """Whether the small delay of any channel has turned out to be another: an effect may only have undone it.

    It must change more of what is recorded than the noise hides.
    """
    changed = dict.fromkeys(after.channels, 0.0)
    for new, old in zip(after.segments, before.segments, strict=True):
        for c, (n, o) in enumerate(zip(new.readings, old.readings, strict=True)):
            if abs(n.delay - o.delay) > CRITERIA.same_delay * new.record.dt:
                changed[new.channels[c]] += (n.delay - o.delay) ** 2 * float(new.timing[c])
    return any(c > CRITERIA.significant for c in changed.values())


def without_derivative(model: Model) -> list[str]:
    """Effects of a model whose size the records show by themselves."""
    return [name for name in model.effects if observed(model.library[name])]


def differentiable(model: Model) -> Model:
    """A model without those."""
    for name in without_derivative(model):
        model = model.without_effect(name)
    return model


def with_fitted_values(model: Model, fitted: Model) -> Model:
    """The model with what was fitted in one that lacks some of its effects."""
    return model.with_values({k: fitted.value(k) for k in fitted.movable_keys()}, source="fitted")


def worse(misfit: Misfit, best: Misfit) -> bool:
    """Whether a model is significantly worse than another."""
    return significant(misfit.total - best.total, misfit.count, misfit.variance)
