"""The search for what is missing: forward by refits of the best candidates, backward by leaving out.

Forward selection with backward elimination (Efroymson 1960; here as in Draper & Smith, Applied Regression Analysis,
ch. 15), on segments for validation as well as on those that were fitted: an effect that does not lower both is none.
Then every effect added is set against what would take its place, so that a proxy that came first does not stay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.errors import SegmentError
from hydraulic_sysid.estimation.fit import Fit, FitPoint, FitSettings, fit_segments
from hydraulic_sysid.estimation.known_starts import KnownStarts
from hydraulic_sysid.estimation.parallel import results
from hydraulic_sysid.estimation.parameters import Parameters, bounded
from hydraulic_sysid.estimation.refinement import outlying, refined, usable
from hydraulic_sysid.estimation.segments import Segments, shorter

from .agreement import agreed
from .candidate_table import candidate_table
from .candidates import candidates, delays, observed, subsystem
from .data_sheet import (
    Deviation,
    HeldNumbers,
    least_cost,
    priors,
    relaxed,
    restored,
    significant,
    stretched,
    with_error,
)
from .drive_faults import costs_with
from .errors import DiagnosisError
from .frozen_jacobian import refit, refit_rounded
from .holdout import MOST_VALUES, Split, split
from .linearisation import Linearisation
from .misfit import SIGNIFICANT, Misfit, explained, material, misfit
from .progress import OutOfTimeError, Progress, Watch
from .recording_faults import RecordingFault, recording_faults, resized
from .remainder import immaterial, negligible, remainders
from .score_test import CandidateScore, score
from .search_state import CandidateRefit, FaultFit, SearchResult, SearchState, loud
from .set_aside import accidents
from .spectral_lines import record_features
from .uncertainty import parameter_errors
from .worth import (
    EXPLAINED,
    FAR,
    FURTHER,
    MOSTLY,
    NOTHING_LEFT,
    PROMISES,
    Enough,
    anything,
    decisive,
    enough_at_first,
    leaves_most,
    near_competitors,
    superfluous,
    without_competitor,
    worth_adding,
)

PROMISING = 0.04  # of the best predicted reduction, from which a candidate is refitted
MOST_REFITS = 8
LATER_REFITS = 4  # once something was added, …
ALIKE = 2  # … of one subsystem: what its laws left makes all of its effects look promising
FULL = 2  # candidates that are refitted from more than one start, and with all sensitivities taken anew
OTHERS = 3  # candidates of other subsystems, that are set against those where the data sheet is bent to its bounds, …
FEW_STEPS = 6  # … by so many steps of a fit to a few segments, …
FEW_GAIN = 2e-3  # … while each lowers the sum of squares by this share
NEAR = 0.93  # of the best reduction, from which a refit is finished
MOST_EFFECTS = 3
ENOUGH = 60  # segments, spread over all records, that do for a first fit
LOOK = 20  # segments, spread over all records, that show where a fit from other values leads, …
SAME_LOOK = 0.02  # … where it does not leave them less by this share: nowhere else, …
WORSE_LOOK = 0.2  # … and where it leaves them more by this one: to something worse
SHORTER = 4  # times: segments from which a fit that is far off begins once more
FIRST_GAIN = 0.02  # share of the sum of squares that a step must gain while the noise is not known yet
BEYOND = 8  # values of a number that lay at its bound, over all where it may go, from which a fit may begin
SUSPECTS = 2  # numbers of the data sheet that are tried in the place of one
CLEAR = 10.0  # times what names a number, beyond which a fit need not show what keeping it costs
QUIETER = 0.95  # of the noise before: what was judged by that is judged again
RETIMED = 0.03  # sampling intervals by which a channel is less late than before: the same
MOST_FAULTS = 3  # of the recording
UNNOTICED = 0.003  # of the motion in a segment: what leaves less is no disturbance of the drive
MOST_SIZES = 4  # times that the size of a fault is sought again, …
SAME_SIZE = 0.005  # … until it changes by no more than this share: what is left of a gain is an offset
RIVAL = 0.8  # of what the best candidate explains, from which a fault of the recording may be in its place
FAR_OFF = 4.0  # mean square over noise from which a fit need not be finished
ROUNDS = 6  # of estimating noise and delays and fitting again, at most
MOST_SWAPS = 3
PROMISED = 0.5  # of what an effect must explain, or of what a number explains, which must show for a fit to its end
GLIMPSED = 0.25  # the same of a fault of a channel's reading, which is tried before the model is fitted with it
LAST_STEPS = 8  # of a fit that begins where a quick refit ended, at most, …
LAST_GAIN = 5e-5  # … and while a step lowers the sum of squares by this share

Say = Callable[[str], None]


class Search:
    """One search over one split of records."""

    def __init__(
        self,
        model: Model,
        split: Split,
        short: Callable[[], Split],
        settings: FitSettings,
        say: Say,
        within: float | None = None,
        watch: Watch | None = None,
    ) -> None:
        self.given, self.split, self.short, self.settings = model, split, short, settings
        self.say = Progress(say, within, watch or (lambda _: None))
        self.faults: list[RecordingFault] = []
        self.rivals: list[RecordingFault] = []
        """Other faults, that explain about as much as the best candidate."""
        self.path: list[SearchState] = []
        """The model and what it became with each effect added, as far as the search has come …"""
        self.tried: tuple[SearchState | None, list[CandidateRefit]] = (None, [])
        """… and the state that candidates were refitted on last, with these refits."""
        self.as_recorded: SearchState | None = None
        self._scored: tuple[Linearisation, list[CandidateScore]] | None = None
        self._seen: dict[frozenset[str], list[CandidateScore]] = {}
        self._judged_with: set[str] = set()
        self._starts: dict[frozenset[str], KnownStarts] = {}
        self.priors = priors(model)
        self._first = replace(settings, least_gain=FIRST_GAIN)
        self._few = replace(settings, most_steps=FEW_STEPS, least_gain=FEW_GAIN)
        self._last = replace(settings, most_steps=LAST_STEPS, least_gain=LAST_GAIN)

    @classmethod
    def of(
        cls, model: Model, records: Sequence[Record], validation: Sequence[Record], settings: FitSettings, say: Say,
        within: float | None = None, watch: Watch | None = None, most_values: int = MOST_VALUES,
    ) -> Search:  # fmt: skip
        """Cut the records; free parameters without bounds get those of a data sheet.

        :param within: seconds after which the search ends with the best so far
        :param watch: takes what is found meanwhile
        :param most_values: measured values that are used, spread over all records
        :raises DiagnosisError: there are no records, or one cannot be cut.
        """
        if not records:
            raise DiagnosisError("there is no record to diagnose")
        model = bounded(model)
        length = settings.seconds(model, [*records, *validation])
        try:
            cuts = split(records, validation, model, length, most_values)
            quarter = shorter(length, SHORTER, [*records, *validation])
            short = partial(split, records, validation, model, quarter, most_values)
            return cls(model, cuts, short, replace(settings, length=length), say, within, watch)
        except SegmentError as error:
            raise DiagnosisError(str(error)) from None

    def begin(self) -> SearchState:
        """The model, fitted and judged by the noise that it leaves; the data sheet is relaxed where that helps."""
        self.say("fitting the model")
        strict = self.judged(self.state(self.given, self._first))
        self.path = [strict]
        self.say.reached((), strict.misfit)
        return self.loosened(strict)

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
        far = strict.misfit.variance >= FAR_OFF or any(key in at_bound for key in stretched(self.given))
        try:
            # What is far off is bent to imitate what it lacks: the model file's values are nearer to the truth.
            model = relaxed(self.with_filed_values(strict.model) if far else strict.model)
            model = self.begun_beyond(model, stretched(self.given)) if far else model
            loose = self.nearer(model, far)
        except SimulationError:  # it went where the plant does not run
            return None
        helps = self.better(strict, loose) and explained(strict.misfit, loose.misfit) > FURTHER
        return loose if helps else None

    def better(self, before: SearchState, after: SearchState) -> bool:
        """Whether what a state explains more than another is more than chance; where little is left, by any noise."""
        if not material(before.misfit, after.misfit):
            return False
        return not before.misfit.little or agreed(before.residual, after.residual, self.split.fit)

    def nearer(self, model: Model, far: bool) -> SearchState:
        """A model fitted: where it is ``far`` off, to the end only if it comes near.

        A resonance has many local minima. What leaves more than a little begins once more from where short segments
        lead: over few periods a wrong frequency is hardly a wrong phase.
        """
        found = self.state(model, self._first if far else self._last)
        if found.misfit.variance - 1.0 < EXPLAINED:
            return found
        best = found
        with suppress(SimulationError):  # they lead where the plant does not run
            values = self.fitted_to_short_segments(model)
            if self.leads_elsewhere(values, found):
                best = min(found, self.state(values, self._first), key=lambda s: s.misfit.total)
        done = best.misfit.variance >= FAR_OFF or (best is found and not far)
        return best if done else self.state(best.model, self._last)

    def begun_beyond(self, model: Model, keys: Sequence[str]) -> Model:
        """The model, each of these numbers where it leaves short segments least, wherever it may go.

        Between a wrong resonance and the right one there is no way downhill.
        """
        if not keys:
            return model
        smooth, short = self._smooth(model), self.short().some(ENOUGH)
        for key in keys:
            now = smooth.value(key)
            low, high = smooth.entry(key).bounds or (now, now)
            costs = {}
            for value in [now, *np.linspace(low, high, BEYOND).tolist()]:
                try:
                    plant = Plant.for_fits(smooth.with_values({key: value}))
                    costs[value] = FitPoint.begin(plant, short, smooth.movable_keys(), priors=self.priors).cost
                except SimulationError:
                    continue
            smooth = smooth.with_values({key: min(costs, key=lambda v: costs[v], default=now)})
        return model.with_values({key: smooth.value(key) for key in keys})

    def fitted_to_short_segments(self, model: Model) -> Model:
        """The model with what a first fit to segments a quarter as long gives."""
        done = self.fitted_to(self.short().some(SHORTER * ENOUGH), model, self._first)
        return model.with_values(done.values)

    def fitted_to(self, segments: Sequence[Segments], model: Model, settings: FitSettings) -> Fit:
        """A model, without effects that have no derivative, fitted to these segments."""
        smooth = self._smooth(model)
        return fit_segments(
            Plant.for_fits(smooth), segments, smooth.movable_keys(), settings,
            progress=lambda *_: self.say.left(), priors=self.priors, starts=self.starts(smooth),
        )  # fmt: skip

    def judged(self, state: SearchState) -> SearchState:
        """A state, judged by the noise that it shows itself."""
        for number in range(ROUNDS):
            self.say("noise of the records")
            at, before = state.linearisation, self.split
            segments = refined(at.point, at.columns, self._laws(state.model))
            after = before.judged(segments, usable(at.point, segments))
            if number and not quieter(before, after) and not retimed(before, after):
                break
            self.split = after
            state = self.state(state.model, self._last if state.misfit.variance < FAR_OFF else self._first)
        return state

    def recorded(self, base: SearchState) -> SearchState:
        """A state with its candidates explored, and with every fault of the recording that explains more than they."""
        for tried in range(MOST_FAULTS + 1):
            self.path = [base]
            nothing = self.nothing_left(base)
            if not nothing:
                base = self.explore(base)
            if tried == MOST_FAULTS:
                break
            left = remainders(self.split, base.residual)
            self.say("faults of the recording")
            # A disturbance is free enough to take up what laws leave, the reading of a channel is not.
            disturbances = not (nothing or negligible(left, UNNOTICED) or immaterial(base.misfit, left))
            faults = recording_faults(base.linearisation, disturbances)
            if nothing and not any(self.bends(f, base) for f in faults):
                break
            best = base.refits[0].misfit.fit if base.refits else base.misfit.fit
            enough = RIVAL * (base.misfit.fit - best)
            named = [f for f in faults if not base.misfit.little or f.unusual(self.split.interval)]
            self.rivals = [f for f in named if not f.linear and f.reduction >= enough][:FULL]
            # A disturbance acts linearly, so that its evidence is that of a full fit; a delay and a low pass do not.
            least = base.misfit.fit - best - base.misfit.least
            readings = [f for f in faults if not f.linear]
            near = [f for f in readings if f.reduction >= max(NEAR * readings[0].reduction, GLIMPSED * least)][:FULL]
            if faults and faults[0].linear and faults[0].reduction >= least:
                near = faults[:1]
            if not near:
                break
            found = self.plainest(base, [self.with_fault(base, f) for f in near])
            if not material(base.misfit, found.misfit) or explained(base.misfit, found.misfit) < FURTHER:
                break
            if leaves_most(base.misfit, found.misfit) or base.misfit.fit - found.misfit.fit < least:
                break
            # Filters of sound transducers delay by a part of a sampling interval, too: that is known, but not named.
            if not base.misfit.little or found.fault.unusual(self.split.interval):
                self.as_recorded = self.as_recorded or base
                self.faults = together(self.faults, found.fault)
            self.split, self.path = found.split, [found.state]
            base = self.loosened(self.judged(found.state))
        return base if base.scores else self.rounded(base)

    def nothing_left(self, state: SearchState) -> bool:
        """Whether a model leaves the noise alone, and no candidate promises to take anything off it.

        A noise estimated from what the model leaves has the small effects that it lacks in it.
        """
        if state.misfit.variance - 1.0 >= NOTHING_LEFT:
            return False
        self.say("looking for what may pass for noise")
        least = PROMISES * state.misfit.least
        return not any(s.reduction > least and not observed(s.effect) for s in self.scores(state))

    def bends(self, fault: RecordingFault, base: SearchState) -> bool:
        """Whether a fault is why a model leaves nothing only with small delays of all channels, or at bounds."""
        return fault.unusual(self.split.interval) and fault.reduction > PROMISES * base.misfit.least

    def scores(self, state: SearchState) -> list[CandidateScore]:
        """All candidates on a state, the best first."""
        at = state.linearisation
        if self._scored is None or self._scored[0] is not at:
            self._scored = at, score(at, candidates(state.model), record_features(at))
            self._seen[frozenset(state.model.effects)] = self._scored[1]
        return self._scored[1]

    def within_a_sample(self, tried: CandidateRefit) -> bool:
        """Whether an effect only delays, by less than a sampling interval: sound sensors and loggers do so, too."""
        return delays(self.given.library[tried.name], tried.refit.model.value, self.split.interval)

    def rounded(self, base: SearchState) -> SearchState:
        """A state with refits of the effects whose size records show by themselves.

        Such as rounding pass for noise, so that they count even where nothing else is left.
        """
        at = base.linearisation
        scores = score(at, [c for c in candidates(base.model) if observed(c)], record_features(at))
        return replace(base, refits=list(self.refitted(base, scores, full=0)), scores=scores)

    def with_fault(self, base: SearchState, fault: RecordingFault) -> FaultFit:
        """A state fitted to records that are taken to have a fault, again while the fault's best size changes."""
        self.say(f"fitting with: {fault.text}")
        before, tried = self.split, list[tuple[RecordingFault, SearchState, Split]]()
        try:
            for sized in fault.starts(before.interval):
                self.split = replace(before, segments=sized.applied(base.linearisation))
                tried.append((sized, self.begun_anew(self.state(base.model, self._last)), self.split))
                if tried[-1][1].misfit.variance - 1.0 < NOTHING_LEFT:
                    break
            fault, state, self.split = min(tried, key=lambda one: one[1].misfit.total)
            for _ in range(MOST_SIZES):
                new, error = resized(state.linearisation, fault), SAME_SIZE * abs(fault.size)
                if new is fault or abs(new.size - fault.size) < max(error, 2.0 * new.standard_error):
                    break
                fault = replace(new, reduction=fault.reduction)
                self.split = replace(before, segments=fault.on(before.segments))
                state = self.state(state.model, self._last)
            worth = misfit(self.split, costs_with(state.linearisation, base.linearisation), state.misfit.prior)
            return FaultFit(fault, state, self.split, worth)
        finally:
            self.split = before

    def plainest(self, base: SearchState, fits: Sequence[FaultFit]) -> FaultFit:
        """Of fits with different faults the best; of those that explain much alike, with the data sheet as it is.

        One transducer that reads too little is the other one that reads too much, with other areas and another supply.
        """
        best = min(fits, key=lambda f: f.misfit.total)
        worth = NEAR * (base.misfit.total - best.misfit.total)
        alike = [f for f in fits if base.misfit.total - f.misfit.total >= worth]
        if len(alike) < 2 or self._strict(base):
            return best
        before, left = self.split, list[float]()
        try:
            for fit in alike:
                self.split = fit.split
                left.append(self.with_moved(fit.state, ()).misfit.total)
        except SimulationError:  # the data sheet as it is does not run with what was fitted
            return best
        finally:
            self.split = before
        return alike[left.index(min(left))]

    def _laws(self, model: Model) -> list[str]:
        """Parameters that stand for a law: the free ones, not the numbers that a data sheet states."""
        return [k for k in model.free_keys() if "." in k or self.given.entry(k).free]

    def concluded(self, found: SearchResult) -> SearchResult:
        """With the data sheet as it was given, but for the few numbers that the records show to be wrong."""
        base, final = found.base, found.final
        if self._strict(base):
            return found
        strict = replace(self.with_moved(base, ()), refits=base.refits, scores=base.scores)
        done, moved = self.fewest_moved(final, strict if final is base else None)
        if not found.added:  # beside an effect, another in the place of a number is no answer that anybody asks for
            simpler = self.simpler(found, strict, done, moved)
            if simpler is not None:
                return simpler
            places = [self.in_place_of(strict, done, [d], moved) for d in moved]
            every = [(state, i) for i, (_, states) in enumerate(places) for state in states]
            best, place = min(every, key=lambda pair: pair[0].misfit.total, default=(done, 0))
            clear = CLEAR * least_cost(done.misfit.count, done.misfit.variance)
            # All numbers together may do what an effect does, too.
            if min(done.misfit.total, final.misfit.total) - best.misfit.total > clear:
                name = _new(best, strict)
                return replace(
                    found, base=strict, final=best, misfits={name: best.misfit}, competing={name: places[place][0]},
                    moved=tuple(d for i, d in enumerate(moved) if i != place),
                )  # fmt: skip
            moved = [
                replace(d, instead=tuple(_new(s, strict) for s in states))
                for d, (_, states) in zip(moved, places, strict=True)
            ]
        misfits = found.misfits
        if misfits:
            misfits = {**misfits, next(reversed(misfits)): done.misfit}
        return replace(found, base=strict, final=done, misfits=misfits, moved=tuple(moved))

    def simpler(
        self, found: SearchResult, strict: SearchState, done: SearchState, moved: Sequence[Deviation]
    ) -> SearchResult | None:
        """With the one effect that explains what takes several numbers of the data sheet, as BIC has it."""
        if len(moved) < 2 or not _worse(strict.misfit, done.misfit):
            return None
        without, states = self.in_place_of(strict, done, moved, moved)
        best = min(states, key=lambda s: s.misfit.total, default=done)
        spared = (len(moved) - 1) * np.log(done.misfit.count) * done.misfit.variance
        if best is done or best.misfit.total - done.misfit.total > spared or not self.better(strict, best):
            return None
        name = _new(best, strict)
        return replace(
            found, base=strict, final=best, misfits={name: best.misfit}, competing={name: without},
            numbers_instead=tuple(moved),
        )  # fmt: skip

    def fewest_moved(self, final: SearchState, strict: SearchState | None) -> tuple[SearchState, list[Deviation]]:
        """The state in which as few numbers of the data sheet move as explain what all of them do, and these numbers.

        ``final``: all are free; ``strict``: none is, where that is known.
        """
        held = HeldNumbers.of(final.linearisation, self.given)
        enough = least_cost(final.misfit.count, final.misfit.variance)
        # Far from the file's values the quadratic says little: the data sheet as it is comes first, fitted.
        for moved in chain([()], filter(None, held.fewest(enough, CLEAR * enough))):
            done = strict if strict is not None and not moved else self.with_moved(final, moved)
            if done.misfit.total - final.misfit.total <= enough:
                break
        for key in moved:
            # Another number may say the same, or what a fit gained came from the others, which had stopped short.
            deviation = self.deviation(held, key, moved, done)
            if not deviation.sure and deviation.cost < CLEAR * enough:
                others = tuple(k for k in moved if k != key)
                back = self.with_moved(done, others)
                if back.misfit.total - done.misfit.total <= enough:
                    moved, done = others, back
        found = []
        for key in moved:
            same = []
            for tied in held.instead(key, moved, enough)[:SUSPECTS]:
                state = self.with_moved(final, tied)
                if not _worse(state.misfit, done.misfit):
                    same.append(self.deviation(held, tied[-1], tied, state))
            found.append(replace(self.deviation(held, key, moved, done), alternatives=tuple(same)))
        return done, found

    def with_moved(self, state: SearchState, moved: Sequence[str]) -> SearchState:
        """A state with the data sheet as it was given but for the numbers ``moved``."""
        self.say("fitting with the data sheet as it is" + (f", but for {' and '.join(moved)}" if moved else ""))
        return self.state(restored(state.model, self.given, moved), self._last)

    def deviation(self, held: HeldNumbers, key: str, moved: Sequence[str], state: SearchState) -> Deviation:
        """One of the numbers ``moved`` in a state."""
        return with_error(held.deviation(key, moved, state.model.value(key)), parameter_errors(state.linearisation))

    def set_against_faults(self, found: SearchResult) -> SearchResult:
        """With the faults of the recording that explain what the one effect added does.

        One that explains by itself what takes the effect and other numbers of the data sheet is the simpler answer.
        """
        if len(found.added) != 1:
            return found
        model = found.final.model.without_effect(found.added[0])
        same = list[RecordingFault]()
        for fault in self.rivals:
            alone = self.as_good(found, restored(model, self.given, []), fault)
            if alone is not None and found.moved:
                return replace(
                    found, split=alone.split, base=alone.state, final=alone.state, misfits={}, competing={}, moved=(),
                    faults=tuple(together(found.faults, alone.fault)),
                    as_recorded=found.as_recorded or found.base,
                )  # fmt: skip
            # Beside a fault, other numbers may be wrong than beside the effect.
            tied = (
                self.as_good(found, model, fault) or self.as_good(found, relaxed(model), fault)
                if found.moved
                else alone
            )
            same += [tied.fault] if tied is not None else []
        return replace(found, faults_instead=tuple(same))

    def as_good(self, found: SearchResult, model: Model, fault: RecordingFault) -> FaultFit | None:
        """A model with a fault of the recording, if together they explain what was found."""
        try:
            tried = self.with_fault(replace(found.final, model=model), fault)
        except SimulationError:  # with the values that it has beside the effect
            return None
        return None if _worse(tried.state.misfit, found.final.misfit) else tried

    def in_place_of(
        self, strict: SearchState, done: SearchState, taken: Sequence[Deviation], moved: Sequence[Deviation]
    ) -> tuple[SearchState, list[SearchState]]:
        """The state with numbers ``taken`` back, and with effects that explain no less than they do.

        ``strict``: the state with the data sheet as it is; ``done``: with all numbers ``moved``.
        """
        others = [d.key for d in moved if d not in taken]
        without = self.explore(self.with_moved(done, others) if others else strict, LATER_REFITS)
        promising = without.misfit.total - PROMISED * (without.misfit.total - done.misfit.total)
        found, near = [], [r for r in without.refits if r.misfit.total < promising][:FULL]
        most = (1.0 + WORSE_LOOK) * self.left_on_few(done) if near else 0.0
        for r in near:
            try:
                if self.looked_at(r.refit.model) > most:
                    continue
                reached = self.state(r.refit.model, self._last)
            except SimulationError:
                continue
            if not _worse(reached.misfit, done.misfit):
                found.append(reached)
        return without, found

    def state(self, model: Model, settings: FitSettings | None = None) -> SearchState:
        """Fit a model and linearise it."""
        smooth = self._smooth(model)
        segments = self.split.some(ENOUGH) if settings is self._first else self.split.to_fit
        done = self.fitted_to(segments, smooth, settings or self.settings)
        starts = self._starts.pop(frozenset(smooth.effects), KnownStarts())
        starts.keep(segments, done.point.initial_states)
        at = Linearisation.of(smooth.with_values(done.values, source="fitted"), self.split, self.priors, starts)
        left = misfit(self.split, at.costs, at.parameters.prior_cost)
        if left.variance < FAR_OFF:  # else they are bent to what the model lacks
            starts.keep(self.split.segments, at.point.initial_states)
            self._starts[frozenset(smooth.effects)] = starts
        if smooth is model:
            return SearchState(at.model, at, left, at.residual)
        seen = refit_rounded(at, _with_values(model, at.model))
        return SearchState(seen.model, at, misfit(self.split, seen.costs, self.prior_cost(seen.model)), seen.residual)

    def starts(self, smooth: Model) -> KnownStarts | None:
        """Initial states that were fitted with a model's effects, or with the most of them and no others.

        Those of models that are not `FAR_OFF`.
        """
        effects = frozenset(smooth.effects)
        known = [own for own in self._starts if own <= effects]
        return self._starts[max(known, key=len)] if known else None

    def prior_cost(self, model: Model) -> float:
        """What a model's values cost by what was known of them beforehand."""
        return Parameters.of(model, model.movable_keys(), self.priors).prior_cost

    def begun_anew(self, state: SearchState) -> SearchState:
        """A state, or where that leaves less, one with the same effects fitted from the values of the model file.

        A model that lacks an effect is bent to imitate it, often up to bounds, and once the effect is there a fit from
        such values may end in a local minimum.
        """
        if state.misfit.variance - 1.0 < NOTHING_LEFT:
            return state
        filed = self.with_filed_values(state.model)
        try:
            if not self.leads_elsewhere(filed, state):
                return state
            again = self.state(filed, self._last)
        except SimulationError:
            return state
        return min(state, again, key=lambda s: s.misfit.total)

    def leads_elsewhere(self, model: Model, state: SearchState) -> bool:
        """Whether a fit that begins with this model's values leaves a few segments clearly less than a state does."""
        return self.looked_at(model) < (1.0 - SAME_LOOK) * self.left_on_few(state)

    def looked_at(self, model: Model) -> float:
        """What a fit to a few segments leaves of them."""
        return self.fitted_to(self.split.some(LOOK), model, self._last).cost

    def left_on_few(self, state: SearchState) -> float:
        """What a state leaves of the same segments."""
        model = self._smooth(state.model)
        few = self.split.some(LOOK)
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

    def _smooth(self, model: Model) -> Model:
        """Without effects that have no derivative."""
        for name in _observed(model):
            model = model.without_effect(name)
        return model

    def explore(self, base: SearchState, most: int = MOST_REFITS, anew: bool = True) -> SearchState:
        """Score all candidates on a state and refit the best; not ``anew``: by the scores beside the same effects."""
        at = base.linearisation
        known = None if anew else self._seen.get(frozenset(base.model.effects))
        scores = self.scores(base) if known is None else known
        if not scores:
            return base
        least = max(PROMISING * scores[0].reduction, 0.2 * base.misfit.least)
        # What rounding explains shows once the initial states have settled with it.
        worth = [s for s in scores if s.reduction > least or observed(s.effect)]
        best = varied(worth, ALIKE if most < MOST_REFITS else most)[:most]
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

    def _show(self, base: SearchState, scores: Sequence[CandidateScore], refits: Sequence[CandidateRefit]) -> None:
        self.say.watch({"candidates": candidate_table(base, scores, refits, self._added(base.model))})

    def _added(self, model: Model) -> list[str]:
        return [e for e in model.effects if e not in self.given.effects]

    def refitted(
        self, base: SearchState, chosen: Sequence[CandidateScore], full: int = FULL
    ) -> Iterator[CandidateRefit]:
        """Candidates refitted on a state, in their order; the first of them from all of their starts."""
        _ = base.linearisation.columns, base.linearisation.normal  # once, for all that work at the same time
        jobs = results(lambda job: self._refit_from(base, job[1], job[0] < full), enumerate(chosen))
        for one in chosen:
            self.say(f"refitting with {one.effect.name}")
            yield next(jobs)

    def _refit_from(self, base: SearchState, candidate: CandidateScore, others: bool) -> CandidateRefit:
        found = self.refit(base, candidate)
        for start in candidate.others if others else ():
            if found.misfit.excess > (1.0 - NEAR) * base.misfit.excess:
                again = self.refit(base, replace(candidate, start=start))
                found = min(found, again, key=lambda r: r.misfit.total)
        return found

    def refit(self, base: SearchState, candidate: CandidateScore) -> CandidateRefit:
        """A candidate refitted on a state, from where its score is best."""
        at, name = base.linearisation, candidate.effect.name
        done = refit(at, at.model.with_effect(name), candidate.start)
        if _observed(base.model):
            done = refit_rounded(at, _with_values(base.model.with_effect(name), done.model))
        return CandidateRefit(name, done, misfit(self.split, done.costs, self.prior_cost(done.model)))

    def finish(self, base: SearchState, enough: Enough) -> SearchState | None:
        """The best of the refits, fitted to the end; None where none is worth it.

        ``enough(name, misfit, part)``: whether an effect's misfit is a part of the way to being worth it.
        """
        # A quick refit keeps what the model was bent to where the effect acts: the sum alone is asked for.
        least = base.misfit.total - base.misfit.least
        worth = [r for r in base.refits if r.misfit.total < least and enough(r.name, r.misfit.summed, PROMISED)]
        if not worth:
            return None
        top = base.misfit.total - worth[0].misfit.total
        near = [r for r in worth if base.misfit.total - r.misfit.total >= NEAR * top]
        near = [r for r in near if r.misfit.excess <= FAR * worth[0].misfit.excess + r.misfit.least][:FULL]
        found = []
        for tried in self.set_against_other_subsystems(base, near):
            self.say(f"fitting with {tried.name}")
            try:
                state = self.begun_anew(self.state(tried.refit.model, self._last))
            except SimulationError:
                continue
            if self.better(base, state) and enough(tried.name, state.misfit, 1.0):
                found.append(state)
        return min(found, key=lambda s: s.misfit.total, default=None)

    def set_against_other_subsystems(self, base: SearchState, near: Sequence[CandidateRefit]) -> list[CandidateRefit]:
        """The refits to finish: the nearest, or what explains more once all parameters are free.

        A model whose data sheet is bent to its bounds imitates what it lacks, and from there a frozen Jacobian does not
        lead back. The best of every other subsystem is then fitted to a few segments, too, before one is chosen.
        """
        at_bound, library = base.linearisation.parameters.at_bound, base.model.library
        seen, others = {subsystem(library[r.name]) for r in near}, list[CandidateRefit]()
        for r in base.refits:
            if subsystem(library[r.name]) not in seen:
                seen.add(subsystem(library[r.name]))
                others.append(r)
        if not others or not any("." not in key and key in self.priors for key in at_bound):
            return list(near)
        found = []
        for r in [*near, *others[:OTHERS]]:
            self.say(f"setting {r.name} against effects of other subsystems")
            try:
                done = self.fitted_to(self.split.some(ENOUGH), r.refit.model, self._few)
            except SimulationError:
                continue
            fitted = replace(r.refit, model=r.refit.model.with_values(done.values))
            found.append((done.point.cost, replace(r, refit=fitted)))
        found.sort(key=lambda pair: pair[0])
        return [r for _, r in found[:FULL]] or list(near)

    def run(self) -> SearchResult:
        """Search until the noise by which it judged is the noise that its result leaves.

        Where the time is over or the user ends it (Ctrl-C), the best so far; a second Ctrl-C ends that, too.

        :raises OutOfTimeError: before there was anything.
        """
        try:
            found = accidents_named(self.set_against_faults(self.concluded(decisive(self.searched()))))
            if found.added and found.base.scores:  # not those beside the effects that were found last
                self._show(found.base, found.base.scores, found.base.refits)
            return found
        except (OutOfTimeError, KeyboardInterrupt):
            if not self.path:
                raise
            return self.so_far()

    def so_far(self) -> SearchResult:
        """The best so far: effects added, and the best of those that were tried next, fitted."""
        self.say = replace(self.say, within=None)
        path, (on, refits) = list(self.path), self.tried
        self.split = path[-1].linearisation.split  # the end may have come while the records were judged anew
        if on is not None and on.linearisation.split is self.split and on.model.effects == path[-1].model.effects:
            nearest = sorted(refits, key=lambda r: r.misfit.total)[:1]
            better = self.finish(replace(path[-1], refits=nearest), anything)
            path += [better] if better is not None else []
        names = [_new(state, former) for former, state in zip(path, path[1:], strict=False)]
        misfits = {name: state.misfit for name, state in zip(names, path[1:], strict=True)}
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
        """A state judged by the noise and the delays that it shows; None where they are those it was judged by."""
        before, self._judged_with = self.split, set(state.model.effects)
        again = self.judged(state)
        if not quieter(before, self.split) and not retimed(before, self.split):
            self.split = before
            return None
        self.say("searching on: what was taken for noise or small delays was partly what is missing")
        return again

    def onward(self, base: SearchState, model: Model, known: SearchState) -> SearchResult:
        """The search from what is ``known`` on, its ``base`` and what was tried there fitted anew to ``model``."""
        tried = [r.name for r in base.refits[:LATER_REFITS]]
        again = self.state(model, self._last)
        refits = list(self.refitted(again, [s for s in base.scores if s.effect.name in tried], full=0))
        again = replace(again, refits=sorted(refits, key=lambda r: r.misfit.total), scores=base.scores)
        return self.forward(again, known)

    def forward(self, base: SearchState, known: SearchState | None = None) -> SearchResult:
        """Forward from the base or from what is ``known``, backward, and every effect added against its competitors."""
        path, added = [base], list[str]()
        self.path = path
        if known is not None:
            added = [e for e in known.model.effects if e not in base.model.effects]
            path.append(self.explore(known, most=LATER_REFITS) if known.misfit.variance - 1.0 > NOTHING_LEFT else known)
        while len(added) < MOST_EFFECTS:
            better = self.finish(
                path[-1], partial(worth_adding, base, path[-1], added) if added else partial(enough_at_first, base)
            )
            if better is not None and not added:
                # The fit with an effect may have gone on where that without it had stopped.
                plain = self.state(better.model.without_effect(_new(better, base)), self._last)
                if not material(plain.misfit, better.misfit):
                    base = replace(plain, refits=base.refits, scores=base.scores)
                    path, better = [base], None
            # What is left beside an effect may be wrong numbers, which another effect would only imitate.
            doubtful = bool(added) and (better is None or better.misfit.variance - 1.0 >= NOTHING_LEFT)
            loose = self.loose(path[-1]) if doubtful else None
            if loose is not None and (better is None or loose.misfit.total < better.misfit.total):
                loose, model = self.judged(loose), loose.model
                for name in added:
                    model = model.without_effect(name)
                return self.onward(base, model, loose)
            if better is None:
                break
            added.append(_new(better, path[-1]))
            self.path = [*path, better]
            self.say.reached(added, better.misfit)
            nothing = better.misfit.variance - 1.0 < NOTHING_LEFT
            last = len(added) == MOST_EFFECTS and explained(base.misfit, better.misfit) > MOSTLY
            # What was judged by a model that lacked it would ask for further effects.
            again = None if last or better.misfit.variance >= FAR_OFF else self.judged_anew(better)
            if again is not None:
                return self.onward(base, base.model, again)
            path.append(better if nothing or last else self.explore(better, most=LATER_REFITS))
            if nothing:
                break
        final, competing = path[-1], {added[-1]: path[-2]} if added and known is None else {}
        misfits = {name: state.misfit for name, state in zip(added, path[1:], strict=False)}
        if len(added) > 1 or known is not None:
            final, kept, competing = self._reviewed(base, final, added, competing)
            if kept != added or len(misfits) < len(kept):
                misfits = self._misfits(base, final, kept)
        found = SearchResult(self.given, self.split, self.settings, base, final, misfits, competing)
        return replace(found, faults=tuple(self.faults), as_recorded=self.as_recorded)

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
        final = self.judged(self.begun_anew(self.state(tried.refit.model)))
        self.say.reached([name], final.misfit)
        base = replace(self.state(base.model, self._last), refits=[tried], scores=scores)
        found = SearchResult(self.given, self.split, self.settings, base, final, {name: final.misfit}, {})
        return accidents_named(self.concluded(found))

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
            without = self.explore(without, most=LATER_REFITS, anew=False)
            competing = {**competing, name: without}
            # Added last, it may lead on from where the fit had stopped.
            own = [r for r in without.refits if r.name == name and r.misfit.total < state.misfit.total]
            again = self.finish(replace(without, refits=own), anything)
            if again is not None and again.misfit.total < state.misfit.total:
                state = again
            near = near_competitors(base, without, state, name)
            other = self.finish(near, anything) if swaps < MOST_SWAPS else None
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
            try:
                found[name] = self.state(model, self._last).misfit
            except SimulationError:  # with the values that it has beside the others
                found[name] = next(reversed(found.values()), base.misfit)
        return {**found, **{name: final.misfit for name in order[-1:]}}


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


def _worse(misfit: Misfit, best: Misfit) -> bool:
    """Whether a model is significantly worse than another."""
    return significant(misfit.total - best.total, misfit.count, misfit.variance)


def together(faults: Sequence[RecordingFault], found: RecordingFault) -> list[RecordingFault]:
    """Faults with one more, which is more of the same where the same fault of a channel's reading was found before."""
    same = [f for f in faults if f.hypothesis is found.hypothesis and not f.linear]
    more = [replace(found, size=f.size + found.size, reduction=f.reduction + found.reduction) for f in same]
    return [*(f for f in faults if f not in same), *(more or [found])]


def _observed(model: Model) -> list[str]:
    """Effects of a model whose size the records show by themselves."""
    return [name for name in model.effects if observed(model.library[name])]


def _with_values(model: Model, fitted: Model) -> Model:
    """The model with what was fitted in one that lacks some of its effects."""
    return model.with_values({k: fitted.value(k) for k in fitted.movable_keys()}, source="fitted")


def quieter(before: Split, after: Split) -> bool:
    """Whether the noise of any channel has turned out to be clearly smaller, in all of a record or in parts of it."""
    return any(
        n < QUIETER * o
        for new, old in zip(after.segments, before.segments, strict=True)
        for n, o in zip(loud(new), loud(old), strict=True)
    )


def retimed(before: Split, after: Split) -> bool:
    """Whether the small delay of any channel has turned out to be another: an effect may only have undone it.

    It must change more of what is recorded than the noise hides.
    """
    changed = dict.fromkeys(after.channels, 0.0)
    for new, old in zip(after.segments, before.segments, strict=True):
        for c, (n, o) in enumerate(zip(new.readings, old.readings, strict=True)):
            if abs(n.delay - o.delay) > RETIMED * new.record.dt:
                changed[new.channels[c]] += (n.delay - o.delay) ** 2 * float(new.timing[c])
    return max(changed.values()) > SIGNIFICANT


def varied(found: Sequence[CandidateScore], most: int) -> list[CandidateScore]:
    """In their order, and no more than so many of one subsystem."""
    places = [subsystem(f.effect) for f in found]
    return [f for i, f in enumerate(found) if places[:i].count(places[i]) < most]


def _new(state: SearchState, before: SearchState) -> str:
    """The effect that a state has beyond another."""
    return next(e for e in state.model.effects if e not in before.model.effects)
