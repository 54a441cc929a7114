"""Candidate effects on a fitted model: scored, refitted by a frozen Jacobian, and the nearest fitted to the end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from hydraulic_sim.effect import Effect
from hydraulic_sim.errors import SimulationError
from hydraulic_sysid.estimation.parallel import results

from .candidate_table import candidate_table
from .candidates import candidates, delays, observed, subsystem
from .criteria import CRITERIA
from .fitting import Fitting, Task, differentiable, with_fitted_values, without_derivative
from .frozen_jacobian import Refit, refit, refit_rounded
from .linearisation import Linearisation
from .misfit import explained, material, misfit
from .score_test import CandidateScore, score
from .search_state import CandidateRefit, SearchState, new_effect
from .spectral_lines import record_features
from .worth import Enough

T = TypeVar("T")


class CandidateFits(Fitting):
    """Fits, and what each candidate effect would explain."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.tried: tuple[SearchState | None, list[CandidateRefit]] = (None, [])
        """The state that candidates were refitted on last, with these refits."""
        self._doubted: tuple[SearchState | None, list[SearchState]] = (None, [])
        """The state that candidates were finished on last, with those that explain too little or not everywhere."""
        self._scored: tuple[Linearisation, list[CandidateScore]] | None = None
        self._seen: dict[frozenset[str], list[CandidateScore]] = {}

    def scores(self, state: SearchState) -> list[CandidateScore]:
        """All candidates on a state, the best first."""
        at = state.linearisation
        if self._scored is None or self._scored[0] is not at:
            self._scored = at, score(at, candidates(state.model), record_features(at))
            self._seen[frozenset(state.model.effects)] = self._scored[1]
        return self._scored[1]

    def nothing_left(self, state: SearchState) -> bool:
        """Whether a model leaves the noise alone, and no candidate promises to take anything off it.

        A noise estimated from what the model leaves has the small effects that it lacks in it. A prediction from the
        sensitivities alone often falls far short of what a fit gains (47 of 980, for a little air in the oil), so no
        more is asked than would count at all.
        """
        if not state.misfit.at_the_noise:
            return False
        self.say("looking for what may pass for noise")
        return not any(s.reduction > state.misfit.least and not observed(s.effect) for s in self.scores(state))

    def within_a_sample(self, tried: CandidateRefit) -> bool:
        """Whether an effect only delays, by less than a sampling interval: sound sensors and loggers do so, too."""
        return delays(self.given.library[tried.name], tried.refit.model.value, self.split.interval)

    def explore(self, base: SearchState, most: int | None = None, anew: bool = True) -> SearchState:
        """Score all candidates on a state and refit the best, no more than so many.

        Where nothing was added yet `Criteria.most_refits`; not ``anew``: by the scores beside the same effects.
        """
        at = base.linearisation
        known = None if anew else self._seen.get(frozenset(base.model.effects))
        scores = self.scores(base) if known is None else known
        if not scores:
            return base
        least = max(CRITERIA.promising * scores[0].reduction, CRITERIA.perhaps * base.misfit.least)
        worth = [s for s in scores if s.reduction > least and not observed(s.effect)]
        first = CRITERIA.most_refits
        most = first if most is None else most
        alike = CRITERIA.most_alike if most < first else most
        best = varied(worth, [s.effect for s in worth], alike)[:most]
        # What rounding explains shows once the initial states have settled with it.
        best += [s for s in scores if observed(s.effect)]
        every: list[CandidateRefit] = []
        self.tried = (base, every)
        self._show(base, scores, every)
        for found in self.refitted(base, best):
            every.append(found)
            self.say.reached(self._added(every[-1].refit.model), every[-1].misfit)
            self._show(base, scores, every)
        pairs = zip(every, best, strict=True)
        refits = [r for r, s in pairs if not observed(s.effect) or base.misfit.total - r.misfit.total > least]
        if base.misfit.little:
            refits = [r for r in refits if not self.within_a_sample(r)]
        refits.sort(key=lambda r: r.misfit.total)
        return replace(base, linearisation=at.slim(), refits=refits, scores=scores)

    def tried_with(self, base: SearchState, effects: Sequence[Effect], full: int | None = None) -> SearchState:
        """A state with refits of these candidates, the best first; ``full`` as `refitted` takes it."""
        scores = score(base.linearisation, effects, record_features(base.linearisation))
        refits = sorted(self.refitted(base, scores, full), key=lambda r: r.misfit.total)
        return replace(base, refits=refits, scores=scores)

    def rounded(self, base: SearchState) -> SearchState:
        """A state with refits of the effects whose size records show by themselves.

        Such as rounding pass for noise, so that they count even where nothing else is left.
        """
        return self.tried_with(base, [c for c in candidates(base.model) if observed(c)], full=0)

    def _show(self, base: SearchState, scores: Sequence[CandidateScore], refits: Sequence[CandidateRefit]) -> None:
        self.say.watch({"candidates": candidate_table(base, scores, refits, self._added(base.model))})

    def refitted(
        self, base: SearchState, chosen: Sequence[CandidateScore], full: int | None = None
    ) -> Iterator[CandidateRefit]:
        """Candidates refitted on a state, in their order; the first of them, ``full``, from all of their starts."""
        full = CRITERIA.most_finished if full is None else full
        _ = base.linearisation.columns, base.linearisation.normal  # once, for all that work at the same time
        jobs = results(lambda job: self._refit_from(base, job[1], job[0] < full), enumerate(chosen))
        for one in chosen:
            self.say(f"refitting with {one.effect.name}")
            yield next(jobs)

    def _refit_from(self, base: SearchState, candidate: CandidateScore, others: bool) -> CandidateRefit:
        found = self.refit(base, candidate)
        for start in candidate.others if others else ():
            if found.misfit.excess > (1.0 - CRITERIA.near) * base.misfit.excess:
                again = self.refit(base, replace(candidate, start=start))
                found = min(found, again, key=lambda r: r.misfit.total)
        return found

    def refit(self, base: SearchState, candidate: CandidateScore) -> CandidateRefit:
        """A candidate refitted on a state, from where its score is best."""
        at, name = base.linearisation, candidate.effect.name
        done = refit(at, at.model.with_effect(name), candidate.start)
        if without_derivative(base.model):
            done = refit_rounded(at, with_fitted_values(base.model.with_effect(name), done.model))
        return CandidateRefit(name, done, misfit(self.split, done.costs, self.prior_cost(done.model)))

    def finish(self, base: SearchState, enough: Enough, promised: float | None = None) -> SearchState | None:
        """The best of the refits, fitted to the end; None where none is worth it.

        ``enough(name, misfit, part)``: whether an effect's misfit is a part of the way to being worth it.

        :param promised: the part that a quick refit must show to be finished, usually `Criteria.promised`
        """
        promised = CRITERIA.promised if promised is None else promised
        # A quick refit keeps what the model was bent to where the effect acts: the sum alone is asked for.
        least = base.misfit.total - base.misfit.least
        worth = [r for r in base.refits if r.misfit.total < least and enough(r.name, r.misfit.summed, promised)]
        doubted: list[SearchState] = []
        self._doubted = base, doubted
        if not worth:
            return None
        top = base.misfit.total - worth[0].misfit.total
        near = [r for r in worth if base.misfit.total - r.misfit.total >= CRITERIA.near * top]
        near = [r for r in near if r.misfit.excess <= CRITERIA.far * worth[0].misfit.excess + r.misfit.least]
        near = near[: CRITERIA.most_finished + CRITERIA.most_others]
        found = []
        for tried in self.set_against_others(base, near):
            self.say(f"fitting with {tried.name}")
            try:
                state = self.begun_anew(self.state(tried.refit.model, self._last))
            except SimulationError:
                continue
            # What it is set against in the end is what it leaves at its best.
            best = [at_best(r, state) if r.name == tried.name else r for r in base.refits]
            base.refits[:] = sorted(best, key=lambda r: r.misfit.total)
            if enough(tried.name, state.misfit, 1.0) and self.better(base, state):
                found.append(state)
            elif material(base.misfit, state.misfit):
                doubted.append(state)
        return min(found, key=self.with_freedom, default=None)

    def finish_two(self, base: SearchState, enough: Enough, proxy: SearchState | None = None) -> list[SearchState]:
        """A state with one more effect and its candidates, and one with two, that nearly all is explained by together.

        Each of two may hide what the other explains, so that neither explains a part alone, or segments do not agree on
        either. Beside the other each must be more than chance. Else there is none; a quick search leaves that out.

        :param proxy: a state with one that explains a part, but less than something of any shape would
        """
        on, doubted = self._doubted if proxy is None else (base, [proxy])
        # Rounding shows only once all else is right.
        doubted = [s for s in doubted if without_derivative(s.model) == without_derivative(base.model)]
        if self.quick or on is not base or not doubted:
            return []
        first = min(doubted, key=lambda s: s.misfit.total)
        name = new_effect(first, base)
        self.say(f"what may hide beside {name}")
        first = self.explore(first, most=CRITERIA.later_refits)
        both = self.finish(first, enough)
        if both is None or explained(base.misfit, both.misfit) < CRITERIA.nearly:
            return []
        with suppress(SimulationError):  # it does not run without it
            other = self.state(both.model.without_effect(name), self._last)
            if self.better(other, both):
                return [first, both]
        return []

    def with_freedom(self, state: SearchState) -> float:
        """What a state leaves and what its free parameters are worth: of two that leave the same the simpler is taken.

        A parameter is worth what BIC gives it, or what the laws of effects found before may leave for others.
        """
        found = max(self.path[0].misfit.total - self.path[-1].misfit.total, 0.0) if self.path else 0.0
        each = max(state.misfit.freedom, CRITERIA.law_elsewhere * found)
        return state.misfit.total + len(state.linearisation.parameters) * each

    def set_against_others(self, base: SearchState, near: Sequence[CandidateRefit]) -> list[CandidateRefit]:
        """The refits to finish: the nearest, or what explains more once all parameters are free.

        A model whose data sheet is bent to its bounds imitates what it lacks, and from there a frozen Jacobian does not
        lead back; nor does it lead to the end where even the nearest leaves a good part. Others, no more than a few of
        one subsystem, are then set against them, and where the model is far off, those that promise most beside the
        values of its file. They, and more that are near than can be finished, are fitted to a few segments first.
        """
        bent = any("." not in key and key in self.priors for key in base.linearisation.parameters.at_bound)
        every = list(near)
        if bent or near[0].misfit.excess > (1.0 - CRITERIA.near) * base.misfit.excess:
            names = {r.name for r in near}
            others = [*near, *(r for r in base.refits if r.name not in names)]
            others = varied(others, [base.model.library[r.name] for r in others], CRITERIA.most_alike)
            every += [r for r in others if r.name not in names][: CRITERIA.most_others]
            every += self.beside_filed_values(base) if base.misfit.variance >= CRITERIA.far_off else []
        if len(every) <= CRITERIA.most_finished and len(every) == len(near):
            return every
        # What the records show by themselves has nothing to be fitted.
        seen = [r for r in near if observed(base.model.library[r.name])]
        every = [r for r in every if not observed(base.model.library[r.name])]
        found, few = [], self.split.some(CRITERIA.enough_to_fit)
        for r in every:
            self.say(f"setting {r.name} against others")
            try:
                done = self.fitted_to(few, r.refit.model, self._few)
            except SimulationError:
                continue
            fitted = replace(r.refit, model=r.refit.model.with_values(done.values))
            found.append((done.point.cost, replace(r, refit=fitted)))
        best: dict[str, tuple[float, CandidateRefit]] = {}
        for cost, r in sorted(found, key=lambda pair: pair[0]):
            best.setdefault(r.name, (cost, r))
        ranked = list(best.values())[: CRITERIA.most_finished]
        noise = sum(int(s.counted.sum()) for s in few)
        excess = [max(cost - noise, 0.0) for cost, _ in ranked]
        most = CRITERIA.far * excess[0] + base.misfit.least
        near = [r for own, (_, r) in zip(excess, ranked, strict=True) if own <= most]
        return [*seen, *near] or every[: CRITERIA.most_finished]

    def beside_filed_values(self, base: SearchState) -> list[CandidateRefit]:
        """The best candidates on the model as its file has it, not refitted yet."""
        filed = self.with_filed_values(base.model)
        try:
            at = Linearisation.of(differentiable(filed), self.split, self.priors)
        except SimulationError:  # what was added beside it does not run with them
            return []
        scores = [s for s in score(at, candidates(filed), record_features(at)) if not observed(s.effect)]
        best = varied(scores, [s.effect for s in scores], CRITERIA.most_alike)[: CRITERIA.most_others]
        models = [filed.with_effect(s.effect.name).with_values(s.start) for s in best]
        return [CandidateRefit(s.effect.name, Refit(m, []), base.misfit) for s, m in zip(best, models, strict=True)]


def at_best(tried: CandidateRefit, state: SearchState) -> CandidateRefit:
    """A refit, or where a fit to the end has left less, what that left."""
    if tried.misfit.total <= state.misfit.total:
        return replace(tried, finished=True)
    return replace(tried, refit=replace(tried.refit, model=state.model), misfit=state.misfit, finished=True)


def varied(found: Sequence[T], effects: Sequence[Effect], most: int) -> list[T]:
    """What was ``found``, in its order, no more than so many whose ``effects`` belong to one subsystem."""
    places = [subsystem(e) for e in effects]
    return [f for i, f in enumerate(found) if places[:i].count(places[i]) < most]
