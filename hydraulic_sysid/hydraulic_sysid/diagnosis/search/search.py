"""The search for what is missing: forward by refits of the best candidates, backward by leaving out.

Forward selection with backward elimination (Efroymson 1960; here as in Draper & Smith, Applied Regression Analysis,
ch. 15), on segments for validation as well as on those that were fitted: an effect that does not lower both is none.
Then every effect added is set against what would take its place, so that a proxy that came first does not stay. What
it builds on stands in layers: `fitting`, `candidate_fits`, `data_sheet_fits`, `recording_fits`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial

import numpy as np

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.fit import FitPoint, fit_from
from hydraulic_sysid.estimation.refinement import outlying

from .candidate_fits import at_best
from .candidates import candidates
from .competing_models import competing_models, nearest, told_apart
from .criteria import CRITERIA
from .data_sheet import restored, tolerances
from .drift import drift
from .errors import DiagnosisError
from .fitting import Task, quieter, retimed, spiked
from .force_balance import drives_by_force, force_shares
from .force_curves import Forces
from .frozen_jacobian import Refit
from .linearisation import Linearisation
from .misfit import Misfit, explained, material
from .nonparametric_curves import NonparametricCurve, nonparametric_curves
from .profile_likelihood import with_profiles
from .progress import OutOfTimeError
from .recording_fits import RecordingFits
from .score_test import CandidateScore, score
from .search_state import CandidateRefit, SearchResult, SearchState, new_effect, new_effects
from .set_aside import accidents
from .spectral_lines import record_features
from .uncertainty import Known, parameter_errors
from .unseen import TriedOut, tried_out
from .worth import (
    anything,
    borrowed,
    decisive,
    enough_at_first,
    near_competitors,
    superfluous,
    without_competitor,
    worth_adding,
)


class Search(RecordingFits):
    """One search over one split of records."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._judged_with: set[str] = set()
        self._shared_beside = False
        """Whether segments were shared out anew for what is left beside an effect."""
        self._in_time = task.say.within is not None
        self._curves: tuple[Linearisation, list[NonparametricCurve]] | None = None

    def begin(self) -> SearchState:
        """The model, fitted and judged by the noise that it leaves; the data sheet is relaxed where that helps."""
        self.say("fitting the model")
        strict = self.judged(self.state(self.given, self._first))
        strict = self.judged(self.state(strict.model, self._first)) if self.shared_out(strict) else strict
        self.path = [strict]
        self.say.reached((), strict.misfit)
        loose = self.loosened(strict)
        # Numbers of the data sheet may do all that is missing where it was fitted, and so show where it was not.
        if loose is strict or not self.shared_out(loose):
            return loose
        strict = self.judged(self.state(strict.model, self._first))
        self.path = [strict]
        return self.loosened(strict)

    def shared_out(self, state: SearchState) -> bool:
        """Whether what a state leaves was nearly all of one role; now it is of both."""
        shared = self.split.shared_out([np.mean(r**2, axis=1) for r in state.residual])
        if shared is self.split:
            return False
        self.say("what is missing shows in a few segments: these are shared out anew to be fitted and to validate")
        self.split = shared
        return True

    def run(self) -> SearchResult:
        """Search until the noise by which it judged is the noise that its result leaves.

        Where the time is over or the user ends it (Ctrl-C), the best so far; a second Ctrl-C ends that, too.

        :raises OutOfTimeError: before there was anything.
        """
        try:
            searched = self.rivals_begun_anew(decisive(self.searched()))
            concluded = self.rivals_as_filed(self.concluded(searched))
            concluded = concluded if self.quick else self.rivals_finished(concluded)
            concluded = self.set_against_effect(self.set_against_faults(concluded))
            found = accidents_named(self.by_force(self.with_other_gains(concluded)))
            if found.added and found.base.scores:  # not those beside the effects that were found last
                self._show(found.base, found.base.scores, found.base.refits)
            return self.with_drift(found)
        except (OutOfTimeError, KeyboardInterrupt):
            if not self.path:
                raise
            return self.so_far()

    def rivals_begun_anew(self, found: SearchResult) -> SearchResult:
        """With rivals that change the same as an effect that was added, and yet left far more, begun where that ended.

        Their quick refits began where the model was bent to what it lacked, and from there may have led nowhere.
        """
        competing = dict(found.competing)
        for name, without in found.competing.items():
            rivals = competing_models(name, without, found.final.misfit)
            stuck = {c.name for c in rivals if c.distinguishable and c.collinearity > CRITERIA.nearly}
            if not stuck:
                continue
            with suppress(SimulationError):  # it does not run without the effect
                bare = self.as_it_is(found.final.linearisation.model.without_effect(name))
                at = bare.linearisation
                effects = [e for e in candidates(bare.model) if e.name in stuck]
                scores = score(at, effects, record_features(at))
                again = [self._begun_at(bare, s) for s in scores[: CRITERIA.most_stuck]]
                best = {r.name: r for r in without.refits}
                for r in again:
                    best[r.name] = min(best[r.name], r, key=lambda one: one.misfit.total)
                refits = sorted(best.values(), key=lambda r: r.misfit.total)
                competing[name] = replace(without, refits=refits)
        return replace(found, competing=competing)

    def rivals_as_filed(self, found: SearchResult) -> SearchResult:
        """With rivals that seem as good as an effect and change nothing alike looked for anew, the data sheet as it is.

        While that was loose its numbers did what the effect does, and anything beside them left as little.
        """
        competing, base = dict(found.competing), found.base
        for name, without in found.competing.items():
            rivals = competing_models(name, without, found.final.misfit)
            other = [c for c in rivals if not c.distinguishable and c.collinearity < CRITERIA.other_change]
            if self._strict(without) or not other:
                continue
            bare = restored(found.final.model.without_effect(name), self.given, [d.key for d in found.moved])
            with suppress(SimulationError):  # it does not run without the effect
                again = self.explore(self.state(bare, self._last), most=CRITERIA.later_refits)
                competing[name] = again
                base = replace(base, refits=again.refits, scores=again.scores) if len(found.added) == 1 else base
        return replace(found, competing=competing, base=base)

    def rivals_finished(self, found: SearchResult) -> SearchResult:
        """With every rival fitted to the end that a quick refit does not rule out by far.

        That is where it explains at least half of what the effect does, and yet leaves what would tell it apart.
        """
        competing, final = dict(found.competing), found.final.misfit
        for name, without in found.competing.items():
            least = CRITERIA.most_of * (without.misfit.total - final.total)
            best = {r.name: r for r in without.refits}
            for r in nearest(name, without):
                near = without.misfit.total - r.misfit.total >= least
                if near and told_apart(final, r.misfit) and not r.finished:
                    self.say(f"fitting with {r.name}, to tell it from {name}")
                    with suppress(SimulationError):
                        best[r.name] = at_best(r, self.state(r.refit.model, self._last))
            competing[name] = replace(without, refits=sorted(best.values(), key=lambda r: r.misfit.total))
        return replace(found, competing=competing)

    def _begun_at(self, bare: SearchState, candidate: CandidateScore) -> CandidateRefit:
        """A candidate fitted to the end, from where its score is best on this state."""
        name = candidate.effect.name
        self.say(f"fitting with {name} once more")
        state = self.state(bare.model.with_effect(name).with_values(candidate.start), self._last)
        return CandidateRefit(name, Refit(state.model, state.linearisation.costs), state.misfit, finished=True)

    def by_force(self, found: SearchResult) -> SearchResult:
        """With the effect that explains the force which is left, where a sensor shows more than any law is right to.

        One that explains a good part of it, by far the most.
        """
        if found.added or not judged_by_force(found.final):
            return found
        try:
            return self.with_force(found, found.final.model, self.scores(found.final))
        except SimulationError:  # with one of them
            return found

    def with_force(self, found: SearchResult, model: Model, scores: Sequence[CandidateScore]) -> SearchResult:
        """As `by_force`, by these candidates alone beside a model; all values are what the forces ask for."""
        self.say("the force that the motion asks for beyond the model")
        shares = force_shares(model, self.split.records(), scores)
        if not shares or shares[0].share < CRITERIA.further:
            return found
        best, *others = shares
        if any(s.share > CRITERIA.nearly * best.share for s in others):
            return found
        base, state = self.as_it_is(best.without), self.as_it_is(best.model)
        self.say.reached([best.name], state.misfit)
        return replace(found, base=base, final=state, misfits={best.name: state.misfit}, by_force=best)

    def with_drift(self, found: SearchResult) -> SearchResult:
        """With the parameter of its final model that changes along the records, if there is one."""
        self.say("whether any parameter changes along the records")
        with suppress(SimulationError):  # a parameter cannot be moved
            return replace(found, drift=drift(found.final.linearisation, CRITERIA.promises * found.final.misfit.least))
        return found

    def with_final_values(self, found: SearchResult) -> SearchResult:
        """With values of the final model that are to be used, not only compared (`with_exact_laws`).

        The search is done: its time may be over meanwhile, as a part was kept for this.
        """
        self.say = replace(self.say, within=None)
        if found.stopped or found.by_force is not None:
            return found
        self.say("the values of the model")
        model = self.with_exact_laws(found.final.model, found.split)
        moved = tuple(replace(d, value=model.value(d.key)) for d in found.moved)
        return replace(found, final=replace(found.final, model=model), moved=moved)

    def known_of(self, found: SearchResult, named: Collection[str]) -> dict[str, Known]:
        """How well the parameters of the final model are known; those that are ``named`` by what they cost elsewhere.

        The search is done: its time may be over meanwhile. One that is to be quick, or done in time, or that was ended,
        leaves these fits out.
        """
        self.say = replace(self.say, within=None)
        at, sheet = found.final.linearisation, tolerances(found.model)
        known = parameter_errors(at, sheet)
        fitted = partial(self.held, at)
        least = cache(lambda: fitted(None))

        def cost(key: str, value: float) -> float:
            self.say(f"the interval of {key}")
            return fitted((key, value)) - least()

        hurried = self.quick or self._in_time or found.stopped
        return with_profiles(at, known, () if hurried else named, cost, sheet)

    def tested(self, found: SearchResult) -> TriedOut | None:
        """What was found on test data; a quick search leaves that out."""
        if self.quick:
            return None
        self.say("test data")
        return tried_out(found, self._laws)

    def held(self, at: Linearisation, number: tuple[str, float] | None) -> float:
        """What is left of the segments for fitting, a parameter held at a value [SI], all others fitted anew.

        Infinite where it does not run.
        """
        begin, prior = at.point.with_columns_kept().subset(at.split.fit), 0.0
        with suppress(SimulationError):
            if number is not None:
                key, value = number
                mean, std = self.priors.get(key, (value, 1.0))
                begin, prior = begin.holding(key, value), ((value - mean) / std) ** 2
            return fit_from(begin, self._last, progress=lambda *_: self.say.left()).cost + prior
        return math.inf

    def so_far(self) -> SearchResult:
        """The best so far: effects added, and the best of those that were tried next, fitted."""
        self.say = replace(self.say, within=None)
        path, (on, refits) = list(self.path), self.tried
        self.split = path[-1].linearisation.split  # the end may have come while the records were judged anew
        if on is not None and on.linearisation.split is self.split and on.model.effects == path[-1].model.effects:
            nearest = sorted(refits, key=lambda r: r.misfit.total)[:1]
            better = self.finish(replace(path[-1], refits=nearest), anything)
            path += [better] if better is not None else []
        steps = zip(path, path[1:], strict=False)
        misfits = {name: state.misfit for former, state in steps for name in new_effects(state, former)}
        found = SearchResult(self.given, self.split, self.settings, path[0], path[-1], misfits, {}, stopped=True)
        return accidents_named(replace(found, faults=tuple(self.faults), as_recorded=self.as_recorded))

    def searched(self) -> SearchResult:
        """The search itself, the data sheet as loose as it was taken."""
        found = self.forward(self.recorded(self.begin()))
        if not decisive(found).added or set(found.final.model.effects) == self._judged_with:
            return found
        again = self.judged_anew(self.state(found.final.model, self._last))
        return found if again is None else self.onward(found.base, found.base.model, again)

    def judged_anew(self, state: SearchState) -> SearchState | None:
        """A state judged by the noise, spikes and delays that it shows; None where they are those it was judged by."""
        before, self._judged_with = self.split, set(state.model.effects)
        again = self.judged(state)
        spikes = spiked(before, self.split, state.residual) > state.misfit.least
        if not (spikes or quieter(before, self.split) or retimed(before, self.split)):
            self.split = before
            return None
        self.say("searching on: what was taken for noise or small delays was partly what is missing")
        return again

    def onward(self, base: SearchState, model: Model, known: SearchState) -> SearchResult:
        """The search from what is ``known`` on, its ``base`` and what was tried there fitted anew to ``model``."""
        tried = [r.name for r in base.refits[: CRITERIA.later_refits]]
        again = self.state(model, self._last)
        refits = list(self.refitted(again, [s for s in base.scores if s.effect.name in tried], full=0))
        again = replace(again, refits=sorted(refits, key=lambda r: r.misfit.total), scores=base.scores)
        return self.forward(again, known)

    def forward(self, base: SearchState, known: SearchState | None = None) -> SearchResult:
        """Forward from the base or from what is ``known``, backward, and every effect added against its competitors."""
        path = [base] if known is None else [base, known]
        added, self.path = new_effects(path[-1], base), path
        if known is not None and not known.misfit.at_the_noise:
            path[-1] = self.explore(known, most=CRITERIA.later_refits)
        while len(added) < CRITERIA.most_effects:
            states = self.step(base, path[-1], added)
            if not isinstance(states, list):
                return states
            if not states:
                break
            for state in states:
                added.append(new_effect(state, path[-1]))
                path.append(state)
            self.path, better = list(path), path[-1]
            self.say.reached(added, better.misfit)
            last = len(added) == CRITERIA.most_effects and explained(base.misfit, better.misfit) > CRITERIA.nearly
            # What was judged by a model that lacked it would ask for further effects.
            again = None if last or better.misfit.variance >= CRITERIA.far_off else self.judged_anew(better)
            if again is not None:
                return self.onward(base, base.model, again)
            if self.nothing_left(better):
                break
            path[-1] = better if last else self.explore(better, most=CRITERIA.later_refits)
        final, competing = path[-1], {added[-1]: path[-2]} if added and known is None else {}
        misfits = {name: state.misfit for name, state in zip(added, path[1:], strict=False)}
        if len(added) > 1 or known is not None:
            final, kept, competing = self.reviewed(base, final, added, competing)
            if kept != added or len(misfits) < len(kept):
                misfits = self._misfits(base, final, kept, competing)
        found = SearchResult(self.given, self.split, self.settings, base, final, misfits, competing)
        return replace(found, faults=tuple(self.faults), as_recorded=self.as_recorded)

    def step(self, base: SearchState, state: SearchState, added: Sequence[str]) -> SearchResult | list[SearchState]:
        """What comes after a ``state``: one with a further effect, or two of which each hides the other, or none.

        Where something else explains what is left, the search anew from there.
        """
        enough = partial(worth_adding, base, state, added) if added else partial(enough_at_first, base)
        better = self.finish(state, enough) if added else self.first_effect(base)
        if better is not None:
            alone = not borrowed(state, better, new_effect(better, state))
            elsewhere = self.begun_elsewhere(base, state, better, alone)
            if elsewhere is not None:
                return elsewhere
            better = better if alone else None
        states, needed, proxy = [better] if better is not None else [], 0.0, None
        if better is not None and added:
            needed = CRITERIA.nearly * self.share_of_a_curve(state, better)
            if explained(state.misfit, better.misfit) < needed:
                states, proxy = [], better
        if not states and len(added) + 1 < CRITERIA.most_effects:
            states = self.finish_two(state, enough, proxy)
        otherwise = self.otherwise(base, state, states[-1] if states else None, needed) if added else None
        return states if otherwise is None else otherwise

    def otherwise(
        self, base: SearchState, state: SearchState, better: SearchState | None, needed: float
    ) -> SearchResult | None:
        """The search anew from a ``state`` with other numbers, or a fault, that explain what a ``better`` one does.

        ``needed``: share of what is left, that a fault must explain.
        """
        # What is left beside an effect may be wrong numbers, which another effect would only imitate.
        loose = self.loose(state)
        if loose is not None and (better is None or self.sheet_instead(base, better, loose)):
            loose, model = self.judged(loose), loose.model
            for name in new_effects(state, base):
                model = model.without_effect(name)
            return self.onward(base, model, loose)
        mended = self.fault_beside(base, state, better, needed)
        return None if mended is None else self.onward(base, base.model, mended)

    def begun_elsewhere(
        self, base: SearchState, before: SearchState, better: SearchState, alone: bool
    ) -> SearchResult | None:
        """The search anew, where what a ``better`` state shows asks for that: from another model, or with other roles.

        ``alone``: whether the gain of its effect over the state ``before`` is its own.
        """
        first = not new_effects(before, base)
        plain = self.led_on(base, better, alone) if first else None
        if plain is not None:
            return self.forward(self.recorded(plain))
        # What is left beside an effect may be nearly all where nothing was fitted.
        shares = alone and not (better.misfit.at_the_noise or self._shared_beside)
        if not shares or not self.shared_out(better):
            return None
        self._shared_beside = True
        known = self.state(better.model if first else before.model, self._last)
        return self.onward(base, base.model, self.judged_anew(known) or known)

    def led_on(self, base: SearchState, better: SearchState, alone: bool) -> SearchState | None:
        """The model without the effect of a ``better`` state, where that only led its fit out of a local minimum."""
        without = better.model.without_effect(new_effect(better, base))
        plain = self.state(without, self._last) if not alone or self.leads_elsewhere(without, base) else base
        less = material(base.misfit, plain.misfit)
        return plain if less and not (alone and material(plain.misfit, better.misfit)) else None

    def curves(self, state: SearchState, say: Callable[[str], None]) -> list[NonparametricCurve]:
        """The curves of what a state leaves, the one that explains most first; those asked for last are kept."""
        at = state.linearisation
        if self._curves is None or self._curves[0] is not at:
            self._curves = at, nonparametric_curves(at, say)
        return self._curves[1]

    def share_of_a_curve(self, before: SearchState, after: SearchState) -> float:
        """What share of what is left a curve without a law behind it explains, where that may be more than an effect.

        It is asked where more is left than the noise. Then what is left is the shape of a law, of one that was found or
        of one that the library lacks, and one effect after the other would only imitate it. What is missing explains
        more, fitted, than a curve does to first order. A curve over the time is the shape of none.
        """
        most = explained(before.misfit, after.misfit) >= CRITERIA.nearly
        if most or before.misfit.variance < CRITERIA.more_than_noise:
            return 0.0
        return max((c.share for c in self.curves(before, self.say) if c.variable != "time"), default=0.0)

    def add(self, name: str) -> SearchResult:
        """One effect on top of the model, whatever it explains.

        :raises DiagnosisError: the records do not excite it.
        """
        base = self.begin()
        self.say(f"looking where {name} begins")
        at = base.linearisation
        scores = score(at, [self.given.library[name]], record_features(at))
        if not scores:
            raise DiagnosisError(f"{name} changes nothing in these records: they do not excite it")
        self.say(f"refitting with {name}")
        starts = [scores[0].start]
        if not self.given.library.is_builtin(name):  # a file of the user's own may have been made for these records
            starts.append({f"{name}.{p.name}": p.default for p in self.given.library[name].parameters})
        tried = min((self.refit(base, replace(scores[0], start=s)) for s in starts), key=lambda r: r.misfit.total)
        self.say.reached([name], tried.misfit)
        self.say(f"fitting with {name}")
        # What the model without it left was no sure guide to noise and delays.
        states = [self.state(tried.refit.model), *self.begun_by_force(base, name)]
        final = self.judged(self.begun_anew(min(states, key=lambda s: s.misfit.total)))
        self.say.reached([name], final.misfit)
        base = replace(self.state(base.model, self._last), refits=[tried], scores=scores)
        found = SearchResult(self.given, self.split, self.settings, base, final, {name: final.misfit}, {})
        found = self.concluded(found, others=False)
        return accidents_named(self.with_force(found, base.model, scores) if judged_by_force(base) else found)

    def begun_by_force(self, base: SearchState, name: str) -> list[SearchState]:
        """With an effect as its file has it, from the values that forces ask for beside it, where they say any.

        What friction was without the effect is often far from what it is beside it.
        """
        model = base.linearisation.model.with_effect(name)
        forces = Forces.of(model, base.linearisation.parameters, self.split.segments)
        with suppress(SimulationError):  # it does not run with these values
            return [] if forces is None else [self.state(model.with_values(forces.values))]
        return []

    def reviewed(
        self, base: SearchState, state: SearchState, added: list[str], competing: dict[str, SearchState]
    ) -> tuple[SearchState, list[str], dict[str, SearchState]]:
        """Leave out what the others make superfluous; put in an effect's place what fits better there.

        ``competing``: of the effect that came last, known already; it, too, may be superfluous, where it was only what
        brought the fit of the others out of a local minimum.
        """
        swaps, queue = 0, added
        while queue:
            name, queue = queue[0], queue[1:]
            if len(added) == 1 or without_competitor(base, state, name):
                competing = {**competing, name: base}
                continue
            others = [a for a in added if a != name]
            try:
                without = self.begun_anew(self.state(state.model.without_effect(name), self._last))
            except SimulationError:  # with these values the model does not run without it
                continue
            if superfluous(base, without, state, name, others):
                self.say(f"leaving out {name}")
                added, state, competing, queue = others, without, {}, others
                continue
            if name in competing:
                continue
            without = self.explore(without, most=CRITERIA.later_refits, anew=False)
            competing = {**competing, name: without}
            # Added last, it may lead on from where the fit had stopped.
            for own in (r for r in without.refits if r.name == name and r.misfit.total < state.misfit.total):
                self.say(f"fitting with {name}")
                with suppress(SimulationError):
                    again = self.begun_anew(self.state(own.refit.model, self._last))
                    state = min(state, again, key=lambda s: s.misfit.total)
            near = near_competitors(base, without, state, name)
            other = self.finish(near, anything) if swaps < CRITERIA.most_swaps else None
            if other is not None and self.with_freedom(state) - self.with_freedom(other) > state.misfit.least:
                new = new_effect(other, without)
                self.say(f"{new} in the place of {name}")
                added = [new if a == name else a for a in added]
                state, swaps, competing, queue = other, swaps + 1, {new: near}, others
        return state, added, competing

    def _misfits(
        self, base: SearchState, final: SearchState, added: Sequence[str], competing: Mapping[str, SearchState]
    ) -> dict[str, Misfit]:
        """The misfit after each effect, in the order of how much it explains by itself: the largest first."""
        alone = {r.name: r.misfit.total for r in base.refits}
        known = {frozenset(s.model.effects): s.misfit for s in competing.values()}
        order = sorted(added, key=lambda name: alone.get(name, float("inf")))
        found: dict[str, Misfit] = {}
        model = base.model
        for name in order[:-1]:
            own = [p.name for p in model.library[name].parameters]
            model = model.with_effect(name, {p: final.model.value(f"{name}.{p}") for p in own})
            have = frozenset(model.effects)
            try:
                found[name] = known[have] if have in known else self.state(model, self._last).misfit
            except SimulationError:  # with the values that it has beside the others
                found[name] = next(reversed(found.values()), base.misfit)
        return {**found, **{name: final.misfit for name in order[-1:]}}


def judged_by_force(base: SearchState) -> bool:
    """Whether what a state leaves is nothing to anybody, but by the sensor's noise much, and its drive is the force."""
    return base.immaterial and base.misfit.usual > CRITERIA.small and drives_by_force(base.model)


def accidents_named(found: SearchResult) -> SearchResult:
    """With the segments set aside that were left out as far off, and still are with what was found."""
    at, final = found.final.linearisation, found.final.misfit
    if not found.split.far_off:
        return found
    try:
        again = FitPoint.begin(Plant.for_fits(at.model), found.split.far_off, ()).at_rest()
        squares = [np.sum(p.residual**2, axis=1) for p in again.projections]
    except SimulationError:  # it does not run there
        squares = [np.full(len(s), np.inf) for s in found.split.far_off]
    usual = final.by_segment / final.counted
    named = [
        one
        for s, own in zip(found.split.far_off, squares, strict=True)
        for one in accidents(s, outlying(own / s.counted, usual))
    ]
    return replace(found, split=replace(found.split, set_aside=[*found.split.set_aside, *named]))
