"""The search for what is missing: forward by refits of the best candidates, backward by leaving out.

Forward selection with backward elimination (Efroymson 1960; here as in Draper & Smith, Applied Regression Analysis,
ch. 15), on segments for validation as well as on those that were fitted: an effect that does not lower both is none.
Then every effect added is set against what would take its place, so that a proxy that came first does not stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.errors import SegmentError
from hydraulic_sysid.estimation.fit import FitSettings, fit_segments
from hydraulic_sysid.estimation.parameters import bounded

from .candidates import candidates, observed, subsystem
from .errors import DiagnosisError
from .frozen_jacobian import Refit, as_it_is, refit
from .holdout import Split, split
from .linearisation import Linearisation
from .misfit import Misfit, explained, material, misfit
from .score_test import CandidateScore, score
from .spectral_lines import record_features

PROMISING = 0.04  # of the best predicted reduction, from which a candidate is refitted
MOST_REFITS = 8
LATER_REFITS = 4  # once something was added, …
ALIKE = 2  # … of one subsystem: what its laws left makes all of its effects look promising
FULL = 2  # candidates whose refit is finished with all sensitivities taken anew
NEAR = 0.93  # of the best reduction, from which a refit is finished, …
FAR = 5.0  # … if it leaves no more than so many times what the best leaves
MOST_EFFECTS = 3
FURTHER = 0.25  # of what is left, which a further effect must explain, unless it explains a good part of all
NEEDED = 0.02  # of all that was explained, which an effect must explain beside the others to stay
LAW = 0.0025  # of all that was explained: what a law that is right to a twentieth leaves for others of its subsystem …
ELSEWHERE = 0.0005  # … and for those of other subsystems
DISTANT = 0.02  # of what an effect explains, by which a quick refit in its place may lie above, to be finished
NOTHING_LEFT = 0.006  # mean square beyond the noise below which nothing more is looked for
EXPLAINED = 0.05  # mean square beyond the noise up to which little is left to ask
MOST_SWAPS = 3
MOSTLY = 0.9  # of what noise does not explain: where more is explained, nobody asks what else might be nearest
ALONE = 0.5  # of what the best candidate explains at first, below which all others leave it without a competitor
HOPELESS = 0.6  # of what noise does not explain: where less is explained, exchanging effects will not do either
PROMISED = 0.5  # of what an effect must explain, which its quick refit must show for it to be fitted to the end
LAST_STEPS = 8  # of a fit that begins where a quick refit ended, at most, …
LAST_GAIN = 5e-5  # … and while a step lowers the sum of squares by this share

Say = Callable[[str], None]
Enough = Callable[[str, Misfit, float], bool]


@dataclass(frozen=True)
class CandidateRefit:
    """A candidate, refitted beside the effects that are on."""

    name: str
    refit: Refit
    misfit: Misfit


@dataclass(frozen=True)
class SearchState:
    """A model with some effects, fitted, and the candidates refitted on top of it, best first.

    ``linearisation`` has no effects that records show by themselves: such as rounding have no derivative, and ``model``
    and ``misfit`` are with them, the parameters as they are without; ``residual`` (S, m) per record is what ``model``
    leaves.
    """

    model: Model
    linearisation: Linearisation
    misfit: Misfit
    residual: Sequence[Array]
    refits: list[CandidateRefit] = field(default_factory=list)
    scores: list[CandidateScore] = field(default_factory=list)

    def others(self, name: str) -> list[CandidateRefit]:
        """The refits with another effect than this one."""
        return [r for r in self.refits if r.name != name]


@dataclass(frozen=True)
class SearchResult:
    """Where a search ended.

    ``model``: as it was given; ``misfits``: after each effect that was added, the one that explains most first;
    ``competing[name]``: the state without that effect, with what was tried in its place.
    """

    model: Model
    split: Split
    settings: FitSettings
    base: SearchState
    final: SearchState
    misfits: dict[str, Misfit]
    competing: dict[str, SearchState]

    @property
    def added(self) -> list[str]:
        """Effects, the one that explains most first."""
        return list(self.misfits)


class Search:
    """One search over one split of records."""

    def __init__(self, model: Model, split: Split, settings: FitSettings, say: Say) -> None:
        self.given, self.split, self.settings, self.say = model, split, settings, say
        self._last = replace(settings, most_steps=LAST_STEPS, least_gain=LAST_GAIN)

    @classmethod
    def of(
        cls, model: Model, records: Sequence[Record], validation: Sequence[Record], settings: FitSettings, say: Say
    ) -> Search:
        """Cut the records; free parameters without bounds get those of a data sheet.

        :raises DiagnosisError: there are no records, or one cannot be cut.
        """
        if not records:
            raise DiagnosisError("there is no record to diagnose")
        model = bounded(model)
        try:
            return cls(model, split(records, validation, model.kind, settings.length), settings, say)
        except SegmentError as error:
            raise DiagnosisError(str(error)) from None

    def begin(self) -> SearchState:
        """The model as it was given, fitted."""
        self.say("fitting the model as it is")
        return self.state(self.given)

    def state(self, model: Model, settings: FitSettings | None = None) -> SearchState:
        """Fit a model and linearise it."""
        smooth, seen = model, _observed(model)
        for name in seen:
            smooth = smooth.without_effect(name)
        done = fit_segments(Plant(smooth), self.split.to_fit, smooth.movable_keys(), settings or self.settings)
        at = Linearisation.of(smooth.with_values(done.values, source="fitted"), self.split)
        if not seen:
            return SearchState(at.model, at, misfit(self.split, at.costs), at.residual)
        rounded = as_it_is(at, _with_values(model, at.model))
        return SearchState(rounded.model, at, misfit(self.split, rounded.costs), rounded.residual)

    def explore(self, base: SearchState, most: int = MOST_REFITS) -> SearchState:
        """Score all candidates on a state and refit the best."""
        at = base.linearisation
        scores = score(at, candidates(base.model), record_features(at))
        if not scores:
            return base
        least = max(PROMISING * scores[0].reduction, 0.2 * base.misfit.least)
        best = varied([s for s in scores if s.reduction > least], ALIKE if most < MOST_REFITS else most)[:most]
        refits = sorted((self.refit(base, s) for s in best), key=lambda r: r.misfit.total)
        return replace(base, linearisation=at.slim(), refits=refits, scores=scores)

    def refit(self, base: SearchState, candidate: CandidateScore) -> CandidateRefit:
        """A candidate refitted on a state, from where its score is best."""
        at, name = base.linearisation, candidate.effect.name
        self.say(f"refitting with {name}")
        done = refit(at, at.model.with_effect(name), candidate.start)
        if _observed(base.model):
            done = as_it_is(at, _with_values(base.model.with_effect(name), done.model))
        return CandidateRefit(name, done, misfit(self.split, done.costs))

    def finish(self, base: SearchState, enough: Enough) -> SearchState | None:
        """The best of the refits, fitted to the end; None where none is worth it.

        ``enough(name, misfit, part)``: whether an effect's misfit is a part of the way to being worth it.
        """
        worth = [r for r in base.refits if material(base.misfit, r.misfit) and enough(r.name, r.misfit, PROMISED)]
        if not worth:
            return None
        top = base.misfit.total - worth[0].misfit.total
        near = [r for r in worth if base.misfit.total - r.misfit.total >= NEAR * top]
        found = []
        for tried in [r for r in near if r.misfit.excess <= FAR * worth[0].misfit.excess + r.misfit.least][:FULL]:
            self.say(f"fitting with {tried.name}")
            try:
                state = self.state(tried.refit.model, self._last)
            except SimulationError:
                continue
            if material(base.misfit, state.misfit) and enough(tried.name, state.misfit, 1.0):
                found.append(state)
        return min(found, key=lambda s: s.misfit.total, default=None)

    def run(self) -> SearchResult:
        """Forward, backward, and every effect added against its competitors."""
        base = self.explore(self.begin())
        path, added = [base], list[str]()
        while len(added) < MOST_EFFECTS:
            better = self.finish(path[-1], partial(_worth, base, path[-1], added) if added else _anything)
            if better is not None and not added:
                # The fit with an effect may have gone on where that without it had stopped.
                plain = self.state(better.model.without_effect(_new(better, base)), self._last)
                if not material(plain.misfit, better.misfit):
                    base = replace(plain, refits=base.refits, scores=base.scores)
                    path, better = [base], None
            if better is None:
                break
            added.append(_new(better, path[-1]))
            nothing = better.misfit.variance - 1.0 < NOTHING_LEFT
            last = len(added) == MOST_EFFECTS and explained(base.misfit, better.misfit) > MOSTLY
            path.append(better if nothing or last else self.explore(better, most=LATER_REFITS))
            if nothing:
                break
        misfits = {name: state.misfit for name, state in zip(added, path[1:], strict=True)}
        final, competing = path[-1], {added[-1]: path[-2]} if added else {}
        if len(added) > 1:
            final, kept, competing = self._reviewed(base, final, added, competing)
            if kept != added:
                misfits = self._misfits(base, final, kept)
        return SearchResult(self.given, self.split, self.settings, base, final, misfits, competing)

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
        tried = self.refit(base, scores[0])
        self.say(f"fitting with {name}")
        final = self.state(tried.refit.model)
        base = replace(base, refits=[tried], scores=scores)
        return SearchResult(self.given, self.split, self.settings, base, final, {name: final.misfit}, {})

    def _reviewed(
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
            without = self.state(state.model.without_effect(name), self._last)
            others = [a for a in added if a != name]
            if _superfluous(base, without, state, name, others):
                self.say(f"leaving out {name}")
                added, state, competing, queue = others, without, {}, others
                continue
            if name in competing:
                continue
            without = self.explore(without, most=LATER_REFITS)
            competing = {**competing, name: without}
            near = _near(base, without, state, name)
            other = self.finish(near, _anything) if swaps < MOST_SWAPS else None
            if other is not None and state.misfit.total - other.misfit.total > state.misfit.least:
                new = _new(other, without)
                self.say(f"{new} in the place of {name}")
                added = [new if a == name else a for a in added]
                state, swaps, competing, queue = other, swaps + 1, {new: near}, others
        return state, added, competing

    def _misfits(self, base: SearchState, final: SearchState, added: Sequence[str]) -> dict[str, Misfit]:
        """The misfit after each effect, in the order of how much it explains by itself: the largest first."""
        alone = {r.name: r.misfit.total for r in base.refits}
        order = sorted(added, key=lambda name: alone.get(name, float("inf")))
        found: dict[str, Misfit] = {}
        model = base.model
        for name in order[:-1]:
            own = [p.name for p in model.library[name].parameters]
            model = model.with_effect(name, {p: final.model.value(f"{name}.{p}") for p in own})
            found[name] = self.state(model).misfit
        return {**found, **{name: final.misfit for name in order[-1:]}}


def _observed(model: Model) -> list[str]:
    """Effects of a model whose size the records show by themselves."""
    return [name for name in model.effects if observed(model.library[name])]


def _with_values(model: Model, fitted: Model) -> Model:
    """The model with what was fitted in one that lacks some of its effects."""
    return model.with_values({k: fitted.value(k) for k in fitted.movable_keys()}, source="fitted")


def _worth(base: SearchState, before: SearchState, added: Sequence[str], name: str, after: Misfit, part: float) -> bool:
    """Whether a further effect explains enough (times ``part``).

    That is a good part of what is left, or something of what there was, where the others explain most of it. What
    explains little where most is left would be a proxy.
    """
    if absorbs_discrepancy(base, before, added, name, after, part):
        return False
    if explained(before.misfit, after) >= part * FURTHER:
        return True
    most = explained(base.misfit, before.misfit) >= HOPELESS
    return most and explained(base.misfit, after) - explained(base.misfit, before.misfit) >= part * NEEDED


def absorbs_discrepancy(
    base: SearchState, before: SearchState, others: Sequence[str], name: str, after: Misfit, part: float = 1.0
) -> bool:
    """Whether an effect explains so little of all that it may only absorb the discrepancy of the others' laws.

    One of another subsystem that explains most of what is left is believed.
    """
    library = base.model.library
    alike = any(subsystem(library[name]) == subsystem(library[other]) for other in others)
    if not alike and explained(before.misfit, after) >= part * HOPELESS:
        return False
    least = part * (LAW if alike else ELSEWHERE)
    return before.misfit.total - after.total < least * (base.misfit.total - after.total)


def _superfluous(base: SearchState, without: SearchState, state: SearchState, name: str, others: Sequence[str]) -> bool:
    """Whether ``state`` is hardly better than ``without`` the effect."""
    if not material(without.misfit, state.misfit) or absorbs_discrepancy(base, without, others, name, state.misfit):
        return True
    lost = without.misfit.total - state.misfit.total
    needed = NEEDED * (base.misfit.total - state.misfit.total)
    return explained(without.misfit, state.misfit) < FURTHER and lost < needed


def _near(base: SearchState, without: SearchState, state: SearchState, name: str) -> SearchState:
    """The state ``without`` an effect, and of its refits those that come near the state with it."""
    left = state.misfit.excess + DISTANT * (without.misfit.total - state.misfit.total)
    if explained(base.misfit, state.misfit) < HOPELESS:
        return replace(without, refits=[])
    return replace(without, refits=[r for r in without.others(name) if r.misfit.excess < left])


def _anything(name: str, after: Misfit, part: float) -> bool:
    """No more is asked than that a reduction is one."""
    return True


def varied(found: Sequence[CandidateScore], most: int) -> list[CandidateScore]:
    """In their order, and no more than so many of one subsystem."""
    places = [subsystem(f.effect) for f in found]
    return [f for i, f in enumerate(found) if places[:i].count(places[i]) < most]


def without_competitor(base: SearchState, final: SearchState, name: str) -> bool:
    """Whether an effect explains by itself most of what is off, and no other candidate comes near it.

    That is judged by what they explain or, where in the end all is explained, by what they leave.
    """
    own = next((r.misfit for r in base.refits if r.name == name), None)
    if own is None or base.misfit.total - own.total < MOSTLY * base.misfit.excess:
        return False
    others = [r.misfit for r in base.others(name)]
    alone = all(base.misfit.total - at.total < ALONE * (base.misfit.total - own.total) for at in others)
    little = final.misfit.variance - 1.0 < EXPLAINED
    return alone or (little and all(at.excess > FAR * (own.excess + at.least) for at in others))


def _new(state: SearchState, before: SearchState) -> str:
    """The effect that a state has beyond another."""
    return next(e for e in state.model.effects if e not in before.model.effects)
