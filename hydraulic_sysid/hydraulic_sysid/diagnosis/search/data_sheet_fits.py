"""The data sheet in a search: relaxed where that helps.

In the end only those numbers are others that the records contradict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain

import numpy as np

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model

from .candidate_fits import CandidateFits
from .candidates import candidates
from .criteria import CRITERIA
from .data_sheet import Deviation, HeldNumbers, least_cost, relaxed, restored, stretched, with_error
from .fitting import worse
from .misfit import explained, reduction
from .search_state import SearchResult, SearchState, new_effect
from .spectral_lines import record_features
from .stand_ins import StandIns
from .uncertainty import parameter_errors
from .worth import borrowed, leaves_most, nothing_gained

NO_STARTS: Mapping[str, Mapping[str, float]] = {}


class DataSheetFits(CandidateFits):
    """Fits with candidates, and with numbers of the data sheet that are others than it says."""

    def loosened(self, strict: SearchState) -> SearchState:
        """A state with the data sheet relaxed, where that helps, judged by the noise that it shows."""
        loose = self.loose(strict)
        return strict if loose is None else self.judged(loose)

    def loose(self, strict: SearchState) -> SearchState | None:
        """A state with the data sheet relaxed, where that helps."""
        if not self._strict(strict) or self.nothing_left(strict):
            return None
        self.say("fitting the model within the tolerances of its data sheet")
        # What lies at its bound may be far beyond it, and where much is left so may be what stopped short of it.
        at_bound = strict.linearisation.parameters.at_bound
        far = strict.misfit.variance >= CRITERIA.far_off or any(key in at_bound for key in stretched(self.given))
        try:
            # What is far off is bent to imitate what it lacks: the model file's values are nearer to the truth.
            model = relaxed(self.with_filed_values(strict.model) if far else strict.model)
            model = self.begun_beyond(model, stretched(self.given)) if far else model
            loose = self.nearer(model, far)
        except SimulationError:  # it went where the plant does not run
            return None
        helps = self.better(strict, loose) and explained(strict.misfit, loose.misfit) > CRITERIA.further
        return loose if helps else None

    def concluded(self, found: SearchResult, others: bool = True) -> SearchResult:
        """With the data sheet as it was given, but for the few numbers that the records show to be wrong.

        ``others``: whether an effect may take the place of several numbers.
        """
        base, final = found.base, found.final
        if self._strict(base):
            return found
        strict = replace(self.with_moved(base, ()), refits=base.refits, scores=base.scores)
        shown = not found.added and not strict.misfit.little
        if shown and leaves_most(strict.misfit, final.misfit, strict.immaterial):  # that is how far laws are off
            return replace(found, base=strict, final=strict)
        done, moved = self.fewest_moved(final, strict if final is base else None)
        stand_ins = self.stand_ins(done, moved) if moved and (others or not found.added) else None
        tried = stand_ins.sets(done.misfit.freedom)[: CRITERIA.most_sets] if stand_ins is not None and others else []
        for keys in tried:
            simpler = self.simpler(found, strict, done, moved, keys, stand_ins)
            if simpler is not None:
                return simpler
        places = [self.standing_in(None if found.added else strict, done, d, moved, stand_ins) for d in moved]
        if found.added:
            moved = [replace(d, instead=_names(states, done)) for d, (_, states) in zip(moved, places, strict=True)]
        else:
            every = [(state, i) for i, (_, states) in enumerate(places) for state in states]
            best, place = min(every, key=lambda pair: pair[0].misfit.total, default=(done, 0))
            # All numbers together may do what an effect does, too.
            nearest = min((done, final), key=lambda s: s.misfit.total)
            clear = nearest.misfit.total - best.misfit.total > CRITERIA.promises * nearest.misfit.least
            if clear and self.better(nearest, best) and not nothing_gained(nearest.misfit, best.misfit):
                name = new_effect(best, strict)
                return replace(
                    found, base=strict, final=best, misfits={name: best.misfit},
                    competing={name: self.explore(places[place][0], CRITERIA.later_refits)},
                    moved=tuple(d for i, d in enumerate(moved) if i != place),
                )  # fmt: skip
            moved = [
                replace(d, instead=_names(states, strict)) for d, (_, states) in zip(moved, places, strict=True)
            ]
            shared = [tuple(d.key for d in moved if name in d.instead) for one in moved for name in one.instead]
            for keys in dict.fromkeys(shared):
                simpler = None if keys in tried else self.simpler(found, strict, done, moved, keys, stand_ins)
                if simpler is not None:
                    return simpler
        misfits = found.misfits
        if misfits:
            misfits = {**misfits, next(reversed(misfits)): done.misfit}
        return replace(found, base=strict, final=done, misfits=misfits, moved=tuple(moved))

    def stand_ins(self, done: SearchState, moved: Sequence[Deviation]) -> StandIns:
        """What the library's effects may stand for of the numbers ``moved``."""
        self.say("looking for effects that do what wrong numbers do")
        return StandIns.of(done.linearisation, {d.key: d.nominal for d in moved}, record_features(done.linearisation))

    def simpler(
        self,
        found: SearchResult,
        strict: SearchState,
        done: SearchState,
        moved: Sequence[Deviation],
        keys: Sequence[str],
        stand_ins: StandIns | None,
    ) -> SearchResult | None:
        """With the one effect that does what several of the numbers ``moved``, those of ``keys``, do, as BIC has it."""
        taken = [d for d in moved if d.key in keys]
        if len(taken) < 2:
            return None
        try:
            starts = {} if stand_ins is None else stand_ins.for_set(keys)
            without, states = self.in_place_of(None if found.added else strict, done, taken, moved, starts=starts)
        except SimulationError:  # with these numbers back the effects that were found do not run
            return None
        best = min(states, key=lambda s: s.misfit.total, default=done)
        if best is done:
            return None
        name = new_effect(best, done)
        spared = len(taken) - sum(p.free for p in best.model.library[name].parameters)
        lost = reduction(best.misfit, done.misfit)
        if spared < 1 or lost > spared * done.misfit.freedom or not self.better(without, best):
            return None
        return replace(
            found, base=strict, final=best, misfits={**found.misfits, name: best.misfit},
            competing={**found.competing, name: without}, moved=tuple(d for d in moved if d not in taken),
            numbers_instead=tuple(taken),
        )  # fmt: skip

    def fewest_moved(
        self, final: SearchState, strict: SearchState | None, enough: float = 0.0
    ) -> tuple[SearchState, list[Deviation]]:
        """The state in which as few numbers of the data sheet move as explain what all of them do, and these numbers.

        ``final``: all are free; ``strict``: none is, where that is known; ``enough``: of the sum of squares, that they
        may explain less, at least what counts.
        """
        held = HeldNumbers.of(final.linearisation, self.given)
        enough = max(enough, least_cost(final.misfit.count, final.misfit.variance))
        # Far from the file's values the quadratic says little: the data sheet as it is comes first, fitted.
        for moved in chain([()], filter(None, held.fewest(enough, CRITERIA.clear * enough))):
            done = strict if strict is not None and not moved else self.with_moved(final, moved)
            if done.misfit.total - final.misfit.total <= enough:
                break
        for key in moved:
            # Another number may say the same, or what a fit gained came from the others, which had stopped short.
            if held.deviation(key, moved, done.model.value(key)).cost < CRITERIA.clear * enough:
                others = tuple(k for k in moved if k != key)
                back = self.with_moved(done, others)
                if back.misfit.total - done.misfit.total <= enough:
                    moved, done = others, back
        found, most = [], CRITERIA.most_suspects if len(moved) <= CRITERIA.guessed else 0
        for key in moved:
            same = []
            for tied in held.instead(key, moved, enough)[:most]:
                state = self.with_moved(final, tied)
                if not worse(state.misfit, done.misfit):
                    same.append(self.deviation(held, tied[-1], tied, state))
            found.append(replace(self.deviation(held, key, moved, done), alternatives=tuple(same)))
        return done, found

    def with_moved(self, state: SearchState, moved: Sequence[str]) -> SearchState:
        """A state with the data sheet as it was given but for the numbers ``moved``."""
        self.say("fitting with the data sheet as it is" + (f", but for {' and '.join(moved)}" if moved else ""))
        return self.state(restored(state.model, self.given, moved), self._last)

    def sheet_instead(self, base: SearchState, better: SearchState, loose: SearchState) -> bool:
        """Whether other numbers of the data sheet leave less than one more effect does.

        Where both leave the same, but for what counts or what laws found before are right to, no more of them than that
        effect has.
        """
        free = [k for k in better.model.movable_keys() if k not in loose.model.movable_keys()]
        found = base.misfit.total - loose.misfit.total
        spared = max(CRITERIA.law_elsewhere * found, better.misfit.least)
        behind = loose.misfit.total - better.misfit.total
        if spared <= behind < CRITERIA.rough * found:  # it may have stopped short
            loose = min(loose, self.state(loose.model, self._last), key=lambda s: s.misfit.total)
            behind = loose.misfit.total - better.misfit.total
        if abs(behind) >= spared:
            return behind < 0.0
        return len(self.fewest_moved(loose, None, spared)[1]) <= len(free)

    def deviation(self, held: HeldNumbers, key: str, moved: Sequence[str], state: SearchState) -> Deviation:
        """One of the numbers ``moved`` in a state."""
        return with_error(held.deviation(key, moved, state.model.value(key)), parameter_errors(state.linearisation))

    def standing_in(
        self,
        strict: SearchState | None,
        done: SearchState,
        number: Deviation,
        moved: Sequence[Deviation],
        stand_ins: StandIns | None,
    ) -> tuple[SearchState, list[SearchState]]:
        """As `in_place_of`, of one number, by the effects that stand in for it to first order; else none does.

        What hardly shows may be imitated by what is far from it: there all candidates are tried, but not in a quick
        search, nor beside effects (without a ``strict`` state).
        """
        if stand_ins is None:
            return done, []
        enough = least_cost(done.misfit.count, done.misfit.variance)
        if stand_ins.alone(number.key) < CRITERIA.clear * enough and strict is not None and not self.quick:
            return self.in_place_of(strict, done, [number], moved)
        names = stand_ins.for_number(number.key, enough)
        return self.in_place_of(strict, done, [number], moved, names) if names else (done, [])

    def in_place_of(
        self,
        strict: SearchState | None,
        done: SearchState,
        taken: Sequence[Deviation],
        moved: Sequence[Deviation],
        names: Sequence[str] = (),
        starts: Mapping[str, Mapping[str, float]] = NO_STARTS,
    ) -> tuple[SearchState, list[SearchState]]:
        """The state with numbers ``taken`` back, and with effects that explain no less than they do.

        ``done``: with all numbers ``moved``; ``strict``: with none, where that is known; ``names``: of the effects, the
        likeliest first (default: those that promise most); ``starts``: of some, where a fit beside ``done`` begins.
        """
        others = [d.key for d in moved if d not in taken]

        def unbent(name: str, values: Mapping[str, float]) -> Model:
            """Without the numbers the other values were bent to imitate them."""
            return restored(done.model, self.given, others).with_effect(name, values)

        back = self.with_moved(done, others) if others or strict is None else strict
        likeliest = [e for e in candidates(back.model) if e.name in names[: CRITERIA.most_finished]]
        without = self.tried_with(back, likeliest) if likeliest else self.explore(back, CRITERIA.later_refits)
        promising = without.misfit.total - CRITERIA.promised * (without.misfit.total - done.misfit.total)
        near = [r for r in without.refits if r.misfit.total < promising][: CRITERIA.most_finished]
        tried = {r.name: [r.refit.model, unbent(r.name, _own(r.refit.model, r.name))] for r in near}
        for name, values in list(starts.items())[: CRITERIA.most_finished]:
            tried.setdefault(name, []).append(unbent(name, values))
        most, found = (1.0 + CRITERIA.worse_look) * self.left_on_few(done) if tried else 0.0, list[SearchState]()
        for name, models in tried.items():
            self.say(f"{name} in the place of {' and '.join(d.key for d in taken) or 'a fault'}")
            looks = []
            for model in models:
                with suppress(SimulationError):
                    looks.append((self.looked_at(model), model))
            left, model = min(looks, key=lambda look: look[0], default=(np.inf, done.model))
            if left > most:
                continue
            with suppress(SimulationError):
                reached = self.state(model, self._last)
                if not (worse(reached.misfit, done.misfit) or borrowed(without, reached, name)):
                    found.append(reached)
        return without, found


def _own(model: Model, name: str) -> dict[str, float]:
    """An effect's parameters [SI] by their names."""
    return {p.name: model.value(f"{name}.{p.name}") for p in model.library[name].parameters}


def _names(states: Sequence[SearchState], before: SearchState) -> tuple[str, ...]:
    return tuple(new_effect(state, before) for state in states)
