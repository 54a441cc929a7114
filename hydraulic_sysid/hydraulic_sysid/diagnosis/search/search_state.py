"""Where a search stands, what was tried on top of it, and where it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model import Model
from hydraulic_sysid.estimation.fit import FitSettings
from hydraulic_sysid.estimation.segments import Segments

from .data_sheet import Deviation
from .drift import Drift
from .force_balance import ForceShare
from .frozen_jacobian import Refit
from .holdout import Split
from .linearisation import Linearisation
from .misfit import Misfit, unexplained_share
from .recording_faults import RecordingFault
from .remainder import Remainder, Spikes, immaterial, remainders, spikes
from .score_test import CandidateScore
from .whiteness import Whiteness, whiteness


@dataclass(frozen=True)
class CandidateRefit:
    """A candidate, refitted beside the effects that are on.

    ``finished``: not by sensitivities that are held, which may stop short, but to the end.
    """

    name: str
    refit: Refit
    misfit: Misfit
    finished: bool = False


@dataclass(frozen=True)
class SearchState:
    """A model with some effects, fitted, and the candidates refitted on top of it, best first.

    ``linearisation`` has no effects that records show by themselves: such as rounding have no derivative, and ``model``
    and ``misfit`` are with them, fitted with its sensitivities; ``residual`` (S, m) per record: what ``model`` leaves.
    """

    model: Model
    linearisation: Linearisation
    misfit: Misfit
    residual: Sequence[Array]
    refits: list[CandidateRefit] = field(default_factory=list)
    scores: list[CandidateScore] = field(default_factory=list)

    @cached_property
    def remainders(self) -> list[Remainder]:
        """What is left, in the units of the sensors."""
        return remainders(self.linearisation.split, self.residual)

    @cached_property
    def immaterial(self) -> bool:
        """Whether that is nothing to anybody."""
        return immaterial(self.misfit, self.remainders)

    def others(self, name: str) -> list[CandidateRefit]:
        """The refits with another effect than this one."""
        return [r for r in self.refits if r.name != name]


@dataclass(frozen=True)
class FaultFit:
    """A state on records that are taken to have a fault, and its misfit with what the fault's freedom is worth."""

    fault: RecordingFault
    state: SearchState
    split: Split
    misfit: Misfit


@dataclass(frozen=True)
class Together:
    """Faults of the recording and numbers of the data sheet that explain something only all together."""

    faults: Sequence[RecordingFault] = ()
    numbers: Sequence[Deviation] = ()


@dataclass(frozen=True)
class SearchResult:
    """Where a search ended.

    ``model``: as it was given; ``misfits``: after each effect that was added, the one that explains most first;
    ``competing[name]``: the state without that effect, with what was tried in its place; ``as_recorded``: the state
    before any fault of the recording was assumed; ``drift``: of the final model along the records; ``faults_instead``:
    that explain what the one effect added does, each by itself; ``together_instead``: that do it together;
    ``numbers_instead``: what the effect added last does, only together.
    """

    model: Model
    split: Split
    settings: FitSettings
    base: SearchState
    final: SearchState
    misfits: dict[str, Misfit]
    competing: dict[str, SearchState]
    moved: Sequence[Deviation] = ()
    faults: Sequence[RecordingFault] = ()
    faults_instead: Sequence[RecordingFault] = ()
    together_instead: Together = Together()
    numbers_instead: Sequence[Deviation] = ()
    as_recorded: SearchState | None = None
    drift: Drift | None = None
    by_force: ForceShare | None = None
    """What the one effect added explains of the force that was left; where that, not the residual, has named it."""
    stopped: bool = False
    """Whether it ended before it was done: then ``final`` is the best so far, the data sheet still loose."""

    @property
    def before(self) -> Misfit:
        """What the model left before anything was explained."""
        return (self.as_recorded or self.base).misfit

    @property
    def before_over_noise(self) -> Misfit:
        """The same over the noise that the end is judged by: with a fault of the recording noise is estimated anew."""
        if self.as_recorded is None:
            return self.before
        ratio = noise_ratio(self.as_recorded.linearisation.split, self.split)
        return self.before.times(ratio)

    @property
    def before_laws(self) -> Misfit:
        """The same, or the end where only numbers of the data sheet are others: they have no law that may be off."""
        return self.before_over_noise if self.added or self.faults else self.final.misfit

    @property
    def unexplained_share(self) -> float:
        """What is left in the end, of what was there before anything was explained (0…1); of the force, if by that."""
        if self.by_force is not None:
            return 1.0 - self.by_force.share
        return unexplained_share(self.before_over_noise, self.final.misfit)

    @property
    def added(self) -> list[str]:
        """Effects, the one that explains most first."""
        return list(self.misfits)

    @property
    def named(self) -> list[str]:
        """Keys of what is said to be there: how large the effects added are, not their shapes; numbers of the sheet."""
        library = self.final.model.library
        own = [f"{name}.{p.name}" for name in self.added for p in library[name].parameters if p.null is not None]
        return [*own, *(d.key for d in self.moved)]

    @cached_property
    def remainders(self) -> list[Remainder]:
        """What is left in the end, in the units of the sensors."""
        return remainders(self.split, self.final.residual)

    @cached_property
    def whiteness(self) -> list[Whiteness]:
        """Of what is left in the end."""
        return whiteness(self.split, self.final.residual)

    @cached_property
    def spikes(self) -> list[Spikes]:
        """Samples that do not count."""
        return spikes(self.split)


def noise_ratio(one: Split, other: Split) -> float:
    """Noise power of one split over that of another of the same records, mean over records and channels (1: none)."""
    ratios = [np.mean((loud(a) / loud(b)) ** 2) for a, b in zip(one.segments, other.segments, strict=True)]
    return float(np.mean(ratios)) if ratios else 1.0


def loud(segments: Segments) -> Array:
    """(C,) root mean square over the segments of what is new in each sample's noise [SI]."""
    innovation = np.array([n.innovation for n in segments.noise])
    return np.asarray(innovation * np.sqrt(np.mean(segments.loudness**2, axis=0)))


def new_effect(state: SearchState, before: SearchState) -> str:
    """The effect that a state has beyond another."""
    return new_effects(state, before)[0]


def new_effects(state: SearchState, before: SearchState) -> list[str]:
    """All effects that a state has beyond another."""
    return [e for e in state.model.effects if e not in before.model.effects]
