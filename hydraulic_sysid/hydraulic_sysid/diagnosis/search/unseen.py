"""What models leave of test data, which no fit has seen and no choice either."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sysid.data.display import quantity
from hydraulic_sysid.estimation.noise_model import ChannelNoise
from hydraulic_sysid.estimation.refinement import with_hum, without_outliers
from hydraulic_sysid.estimation.segments import Segments

from .criteria import CRITERIA
from .fitting import differentiable
from .frozen_jacobian import left_rounded
from .holdout import Split
from .linearisation import Linearisation
from .search_state import SearchResult

NOTHING_LEFT = "Nothing was left to test on: all data were fitted, or chose what was added."


@dataclass(frozen=True)
class TriedOut:
    """In words; residual over noise ``before`` and ``after`` on ``seconds`` of these ``records``, if there are any."""

    text: str
    records: tuple[str, ...] = ()
    seconds: float = 0.0
    before: float = 0.0
    after: float = 0.0


def tried_out(result: SearchResult, laws: Callable[[Model], Collection[str]]) -> TriedOut | None:
    """The model as it was before anything was explained, and the final one, on test data.

    None where the search was ended, where one of them does not run there, and where residuals say little: an effect was
    named by its force, or the recorded drive is not what the valve got.

    :param laws: of a model, which may be off a little in each segment
    """
    split, first = result.split, result.as_recorded or result.base
    if result.stopped or result.by_force is not None or any(f.linear for f in result.faults):
        return None
    if not split.to_test:
        return TriedOut(NOTHING_LEFT)
    judged = judged_alike(split.to_test, split.segments)
    changed = bool(result.added or result.moved or result.faults)
    # Over the noise of the end, the channels read as they were taken to be read then.
    readings = [s.readings for s in judged_alike(split.to_test, first.linearisation.split.segments)]
    try:
        judged = with_laws(result.final.model, judged, laws)
        costs = costs_of(result.final.model, judged)
        after = over_noise(judged, costs)
        as_recorded = [replace(s, readings=r) for s, r in zip(judged, readings, strict=True)]
        before = over_noise(judged, costs_of(first.model, as_recorded)) if changed else after
    except SimulationError:
        return None
    names = tuple(dict.fromkeys(s.record.name for s in judged))
    seconds = sum(len(s) * s.samples * s.record.dt for s in judged)
    shown = names[0] if len(names) == 1 else f"{len(names)} records"
    how = "falls" if after < before else "goes"
    fell = f"{how} from {before:.3g} to {after:.3g}" if changed else f"is {after:.3g}"
    text = f"On unseen data ({quantity(seconds, 's', 3)} of {shown}) the residual {fell} × noise."
    seen = result.final.misfit.rms_validation
    if after**2 - seen**2 > CRITERIA.lopsided_beyond:
        text += f" That is more than the {seen:.3g} × of what was validated on, most of all in {_worst(judged, costs)}:"
        text += " something acts there that was hardly seen; let such motion be fitted, too."
    return TriedOut(text, names, seconds, before, after)


def _worst(segments: Sequence[Segments], costs: Sequence[Array]) -> str:
    """Where most is left per value."""
    left = [c / s.counted for s, c in zip(segments, costs, strict=True)]
    own, worst = max(zip(segments, left, strict=True), key=lambda pair: float(pair[1].max()))
    first = own.first[np.argmax(worst)]
    return f"{own.record.name} from {quantity(first * own.record.dt, 's', 4)} on"


def judged_alike(segments: Sequence[Segments], known: Sequence[Segments]) -> list[Segments]:
    """Segments with noise, readings and hum of those that are ``known``: of their record, or else of one like it.

    At another rate noise has another colour: it is taken for white, and as strong.
    """
    found = []
    for s in segments:
        alike = [k for k in known if k.channels == s.channels]
        if alike:
            own = min(alike, key=lambda k: (k.record.name != s.record.name, not np.isclose(k.record.dt, s.record.dt)))
            same = np.isclose(own.record.dt, s.record.dt)
            noise = own.noise if same else [ChannelNoise.white(n.std) for n in own.noise]
            s = with_hum(replace(s.with_noise(noise), readings=own.readings, hum=own.hum))
        found.append(s)
    return found


def with_laws(
    model: Model, segments: Sequence[Segments], laws: Callable[[Model], Collection[str]]
) -> list[Segments]:
    """Segments without outliers that let the laws of a model be off a little, each in each on its own, as in a search.

    :raises SimulationError: the model does not run.
    """
    smooth = differentiable(model)
    at = Linearisation.of(smooth, all_fitted(segments))
    return without_outliers(at.point, at.columns, laws(smooth))


def costs_of(model: Model, segments: Sequence[Segments]) -> list[Array]:
    """What a model leaves with the values that it has, (S_i,) per record; only initial states are fitted.

    :raises SimulationError: it does not run.
    """
    smooth = differentiable(model)
    at = Linearisation.of(smooth, all_fitted(segments))
    return at.costs if smooth is model else left_rounded(at, model)


def over_noise(segments: Sequence[Segments], costs: Sequence[Array]) -> float:
    """Residual over noise."""
    left, count = sum(float(c.sum()) for c in costs), sum(int(s.counted.sum()) for s in segments)
    return float(np.sqrt(left / max(count, 1)))


def all_fitted(segments: Sequence[Segments]) -> Split:
    """Segments that all have one role."""
    return Split(list(segments), [np.ones(len(s), dtype=bool) for s in segments])
