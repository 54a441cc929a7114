"""Faults of the recording in a search: found, sized again while they change, and set against effects."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model

from .criteria import CRITERIA
from .data_sheet import relaxed, restored
from .data_sheet_fits import DataSheetFits
from .drive_faults import costs_with
from .fitting import Task, worse
from .holdout import Split
from .misfit import explained, material, misfit
from .recording_faults import RecordingFault, other_gains, recording_faults, resized
from .remainder import negligible
from .search_state import FaultFit, SearchResult, SearchState, Together, new_effect
from .worth import enough_at_first, leaves_most


class RecordingFits(DataSheetFits):
    """Fits with candidates and other numbers, and to records that are taken to have a fault."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.faults: list[RecordingFault] = []
        self.rivals: list[RecordingFault] = []
        """Other faults, that explain about as much as the best candidate."""
        self._first_effect: tuple[SearchState | None, SearchState | None] = (None, None)
        self.as_recorded: SearchState | None = None
        """Before any fault was assumed, …"""
        self._beaten: SearchState | None = None
        """… and with the effect that explained less than the first fault, the data sheet as loose as it was."""
        self._assumed = 0
        """How many faults were, named or not."""

    def recorded(self, base: SearchState) -> SearchState:
        """A state with its candidates explored, and with every fault of the recording that explains more than they."""
        while True:
            self.path = [base]
            nothing = self.nothing_left(base)
            if not nothing:
                base = self.explore(base)
            if self._assumed == CRITERIA.most_faults:
                break
            self.say("faults of the recording")
            # A disturbance is free enough to take up what laws leave, the reading of a channel is not.
            disturbances = not (nothing or negligible(base.remainders, CRITERIA.unnoticed) or base.immaterial)
            faults = recording_faults(base.linearisation, disturbances)
            if nothing and not any(self.bends(f, base) for f in faults):
                break
            best = base.refits[0].misfit.fit if base.refits else base.misfit.fit
            enough = CRITERIA.nearly * (base.misfit.fit - best)
            named = [f for f in faults if not base.misfit.little or f.unusual(self.split.interval)]
            self.rivals = [f for f in named if not f.linear and f.reduction >= enough][: CRITERIA.most_finished]
            least = base.misfit.fit - best - base.misfit.least
            found = self.fault(base, faults, least)
            if found is None or leaves_most(base.misfit, found.misfit) or base.misfit.fit - found.misfit.fit < least:
                break
            # A quick refit falls short of what an effect explains; the fault has been fitted to the end.
            effect = self.first_effect(base)
            if effect is not None and effect.misfit.total < found.misfit.total:
                self._first_effect = base, effect
                break
            if self.as_recorded is None:
                self._beaten = effect
            self.assume(found, base, base)
            self.path = [found.state]
            base = self.loosened(self.judged(found.state))
        return base if base.scores else self.rounded(base)

    def fault(self, base: SearchState, faults: list[RecordingFault], least: float) -> FaultFit | None:
        """The best of these faults, fitted; None where none is worth it, or promises to explain ``least``."""
        # A disturbance acts linearly, so that its evidence is that of a full fit; a delay and a low pass do not.
        readings = [f for f in faults if not f.linear]
        enough = max(CRITERIA.near * readings[0].reduction, CRITERIA.glimpsed * least) if readings else 0.0
        near = [f for f in readings if f.reduction >= enough][: CRITERIA.most_finished]
        if faults and faults[0].linear and faults[0].reduction >= least:
            near = faults[:1]
        if not near:
            return None
        found = self.plainest(base, [self.with_fault(base, f, CRITERIA.promised * least) for f in near])
        worth = material(base.misfit, found.misfit) and explained(base.misfit, found.misfit) >= CRITERIA.further
        return found if worth else None

    def assume(self, found: FaultFit, beside: SearchState, base: SearchState) -> None:
        """Take the records to have the fault that was found ``beside`` a state.

        Filters of sound transducers delay by a part of a sampling interval, too: that is known, but not named.
        """
        if not beside.misfit.little or found.fault.unusual(self.split.interval):
            self.as_recorded = self.as_recorded or base
            self.faults = together(self.faults, found.fault)
        self.split = found.split
        self._assumed += 1

    def fault_beside(
        self, base: SearchState, state: SearchState, further: SearchState | None, share: float
    ) -> SearchState | None:
        """A ``state`` with effects on records with a fault that explains more than a ``further`` effect, if any does.

        What hides a small delay of the pressures may itself be much larger.

        :param share: of what is left, that it must explain
        """
        nothing = further is None and state.misfit.at_the_noise
        if nothing or self._assumed == CRITERIA.most_faults:
            return None
        self.say("faults of the recording")
        best = state.misfit.fit if further is None else further.misfit.fit
        readings = [f for f in recording_faults(state.linearisation, disturbances=False) if not f.linear]
        found = self.fault(state, readings, state.misfit.fit - best)
        if found is None or explained(state.misfit, found.misfit) < share:
            return None
        sound = not found.fault.unusual(self.split.interval)
        if further is not None and _plainer(further, state, found, sound):
            return None
        self.assume(found, state, base)
        return self.judged(found.state)

    def first_effect(self, base: SearchState) -> SearchState | None:
        """A state with the effect that explains most of what it leaves, fitted to the end; None where none is worth it.

        Where a fault was set against it, it is known. A model that is far off is so bent that quick refits may show
        next to nothing of what a fit explains: then they need not.
        """
        (known, effect), self._first_effect = self._first_effect, (None, None)
        promised = 0.0 if base.misfit.variance >= CRITERIA.far_off else CRITERIA.promised
        return effect if known is base else self.finish(base, partial(enough_at_first, base), promised)

    def bends(self, fault: RecordingFault, base: SearchState) -> bool:
        """Whether a fault is why a model leaves nothing only with small delays of all channels, or at bounds."""
        return fault.unusual(self.split.interval) and fault.reduction > CRITERIA.promises * base.misfit.least

    def with_fault(self, base: SearchState, fault: RecordingFault, least: float = 0.0) -> FaultFit:
        """A state fitted to records that are taken to have a fault, again while the fault's best size changes.

        :param least: reduction of the sum of squares that the first fit must show to be gone on with
        """
        self.say(f"fitting with: {fault.text}")
        before, tried = self.split, list[tuple[RecordingFault, SearchState, Split]]()
        try:
            for sized in fault.starts(before.interval):
                self.split = replace(before, segments=sized.applied(base.linearisation))
                state = self.state(base.model, self._last)
                if base.misfit.fit - state.misfit.fit >= least:
                    state = self.begun_anew(state)
                tried.append((sized, state, self.split))
                if state.misfit.at_the_noise:
                    break
            fault, state, self.split = min(tried, key=lambda one: one[1].misfit.total)
            for _ in range(CRITERIA.most_sizes if base.misfit.fit - state.misfit.fit >= least else 0):
                new, error = resized(state.linearisation, fault), CRITERIA.same_size * abs(fault.size)
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
        """Of fits with different faults the best; of gains that explain much alike, with the data sheet as it is.

        One transducer that reads too little is the other one that reads too much, with other areas and another supply.
        Nothing on a data sheet makes a delay look like a low pass.
        """
        best = min(fits, key=lambda f: f.misfit.total)
        worth = CRITERIA.near * (base.misfit.total - best.misfit.total)
        gains = [f for f in fits if f.fault.unit == best.fault.unit == "1"]
        alike = [f for f in gains if base.misfit.total - f.misfit.total >= worth]
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

    def set_against_effect(self, found: SearchResult) -> SearchResult:
        """With the one effect that explains by itself what a fault and other numbers of the data sheet do.

        With all of the data sheet within its tolerance a fault may have explained more than it. One cause is simpler
        than several that happen to come together.
        """
        base, effect = found.as_recorded, self._beaten
        if found.added or not (found.faults and found.moved) or base is None or effect is None:
            return found
        name, causes = new_effect(effect, base), len(found.faults) + len(found.moved)
        if sum(p.free for p in effect.model.library[name].parameters) > causes:
            return found
        before, self.split = self.split, base.linearisation.split
        try:
            alone = self.with_moved(effect, ())
            if not worse(alone.misfit, found.final.misfit):
                strict = self.explore(base if self._strict(base) else self.with_moved(base, ()), CRITERIA.later_refits)
                return replace(
                    found, split=self.split, base=strict, final=alone, misfits={name: alone.misfit},
                    competing={name: strict}, moved=(), faults=(), as_recorded=None,
                    together_instead=Together(found.faults, found.moved),
                )  # fmt: skip
        except SimulationError:  # the data sheet as it is does not run with what was fitted
            pass
        self.split = before
        return found

    def with_other_gains(self, found: SearchResult) -> SearchResult:
        """With the gains of other readings, and the effects, that say the same as a gain, beside as many other numbers.

        Where the data sheet is in doubt anyway, one transducer that reads too much is the other one that reads too
        little, with other areas and another supply; or both have an offset.
        """
        if not found.moved:
            return found
        faults, before = list(found.faults), self.split
        for i, fault in enumerate(faults):
            if fault.unit != "1":
                continue
            same, instead = list[RecordingFault](), list[str]()
            undone = replace(fault, size=-fault.size).on(before.segments)
            for other in other_gains(fault, set(before.channels)):
                self.say(f"fitting with: {other.text}")
                self.split = replace(before, segments=other.on(undone))
                with suppress(SimulationError):
                    state = self.state(relaxed(found.final.model), self._last)
                    done, moved = self.fewest_moved(state, None)
                    if len(moved) <= len(found.moved) and not worse(done.misfit, found.final.misfit):
                        same.append(resized(done.linearisation, other))
            self.split = replace(before, segments=undone)
            with suppress(SimulationError):
                states = self.in_place_of(None, found.final, (), found.moved)[1]
                instead = [new_effect(state, found.final) for state in states]
            faults[i] = replace(fault, alternatives=tuple(same), instead=tuple(instead))
        self.split = before
        return replace(found, faults=tuple(faults))

    def as_good(self, found: SearchResult, model: Model, fault: RecordingFault) -> FaultFit | None:
        """A model with a fault of the recording, if together they explain what was found."""
        try:
            tried = self.with_fault(replace(found.final, model=model), fault)
        except SimulationError:  # with the values that it has beside the effect
            return None
        return None if worse(tried.state.misfit, found.final.misfit) else tried


def _plainer(further: SearchState, state: SearchState, fault: FaultFit, sound: bool) -> bool:
    """Whether a further effect beside a ``state`` explains more than a fault, as BIC counts what it has free.

    It must explain clearly more where ``sound`` sensors have such a fault, too.
    """
    more = len(further.linearisation.parameters) - len(state.linearisation.parameters) - 1
    needed = more * state.misfit.freedom + (further.misfit.least if sound else 0.0)
    return further.misfit.total + needed < fault.misfit.total


def together(faults: Sequence[RecordingFault], found: RecordingFault) -> list[RecordingFault]:
    """Faults with one more, which is more of the same where the same fault of a channel's reading was found before."""
    same = [f for f in faults if f.hypothesis is found.hypothesis and not f.linear]
    more = [replace(found, size=f.size + found.size, reduction=f.reduction + found.reduction) for f in same]
    return [*(f for f in faults if f not in same), *(more or [found])]
