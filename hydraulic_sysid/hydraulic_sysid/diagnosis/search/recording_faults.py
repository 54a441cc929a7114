"""How the records were made, as an explanation of its own: channels that are late, early, behind a low pass or scaled.

Each fault has one size. For every size that is tried the recorded signals are made anew from one simulated run, and the
free parameters follow to first order (variable projection); nothing else is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize_scalar

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.display import percent
from hydraulic_sysid.data.records.channels import CHAMBERS
from hydraulic_sysid.estimation.levenberg_marquardt import bounded_step
from hydraulic_sysid.estimation.parallel import results
from hydraulic_sysid.estimation.recording import Reading
from hydraulic_sysid.estimation.segments import Segments

from .criteria import CRITERIA
from .drive_faults import DRIVE_HYPOTHESES, DriveHypothesis, disturbed, freedom
from .linearisation import Linearisation

MOST = 64.0  # sampling intervals by which a channel may be late, or per cent by which its gain may be off
TRIED = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # of these, from which the best size is searched
PER_CENT = 0.01


@dataclass(frozen=True)
class Hypothesis:
    """``channels`` whose `Reading` is off in ``what``, to these ``ways`` (±1); ``text``: the fault in words."""

    name: str
    channels: tuple[str, ...]
    what: Literal["delay", "lag", "gain"]
    ways: tuple[int, ...]
    text: str
    remedy: str

    @property
    def unit(self) -> str:
        """Of its size."""
        return "1" if self.what == "gain" else "s"

    def step(self, dt: float) -> float:
        """What sizes are counted in: sampling intervals ``dt`` [s], or per cent."""
        return PER_CENT if self.what == "gain" else dt

    def shown_by(self, channels: AbstractSet[str]) -> bool:
        """Whether records with these channels in all show it: no other hypothesis says the same of them."""
        seen = channels & set(self.channels)
        return len(seen) == len(self.channels) or (len(seen) > 1 and "position" in seen)

    def applied(self, segments: Segments, size: float) -> Segments:
        """Segments whose record is taken to have a fault of this ``size`` [``unit``]."""
        found = list[Reading]()
        for channel, reading in zip(segments.channels, segments.readings, strict=True):
            if channel in self.channels:
                if self.what == "lag":
                    reading = replace(reading, lag=max(reading.lag + size, 0.0))
                elif self.what == "gain":
                    reading = replace(reading, gain=reading.gain + size)
                else:
                    # The small delay that a channel may have without a name is part of the fault.
                    reading = replace(reading, delay=reading.named + size, named=reading.named + size)
            found.append(reading)
        return replace(segments, readings=tuple(found))


# A position that is late or scaled, a valve that is late and pressures with an offset are physics of the library
# (sensor_delay, sensor_lag, sensor_scale, command_delay, pressure_offset); one scale of both pressures is that of the
# supply and the areas.
HYPOTHESES = (
    Hypothesis("pressures", CHAMBERS, "delay", (1, -1), "the pressures were recorded {size} {late}",
               "shift them, or sample all channels at one instant"),
    Hypothesis("pressures_low_pass", CHAMBERS, "lag", (1,), "the pressures went through a low pass of {corner}",
               "take the filter out, or use faster transducers"),
    *(Hypothesis(c, (c,), "delay", (1, -1), f"{c} was recorded {{size}} {{late}}",
                 "shift it, or sample all channels at one instant") for c in CHAMBERS),
    *(Hypothesis(f"{c}_low_pass", (c,), "lag", (1,), f"{c} went through a low pass of {{corner}}",
                 "take the filter out, or use a faster transducer") for c in CHAMBERS),
    *(Hypothesis(f"{c}_gain", (c,), "gain", (1, -1), f"{c} reads {{size}} too {{much}}",
                 "calibrate the transducer and its amplifier, or correct scale in the column map") for c in CHAMBERS),
    Hypothesis("drive", ("position", *CHAMBERS), "delay", (-1,), "the drive was recorded {size} late",
               "record the drive at the instant at which it is put out"),
    Hypothesis("position", ("position",), "delay", (-1,), "the position was recorded {size} early",
               "shift it, or sample all channels at one instant"),
)  # fmt: skip


@dataclass(frozen=True)
class RecordingFault:
    """A fault, its ``size`` ± ``standard_error`` [``unit``], and by how much it lowers the sum of squares.

    ``alternatives``: other faults, and ``instead``: effects, that would explain the same.
    """

    hypothesis: Hypothesis | DriveHypothesis
    size: float
    standard_error: float
    reduction: float
    alternatives: tuple[RecordingFault, ...] = ()
    instead: tuple[str, ...] = ()

    def applied(self, at: Linearisation) -> list[Segments]:
        """The linearisation's segments, their records taken to have it."""
        if isinstance(self.hypothesis, DriveHypothesis):
            return disturbed(at.point.shooting.segments, self.hypothesis.responses(at))
        return self.on(at.point.shooting.segments)

    def on(self, segments: Sequence[Segments]) -> list[Segments]:
        """Segments, their channels taken to have it; those of a fault of the drive are as they are.

        Small delays without a name, which may have hidden a part of one, are forgotten: noise is judged anew after it.
        """
        if isinstance(self.hypothesis, DriveHypothesis):
            return list(segments)
        return [self.hypothesis.applied(s, self.size) for s in _begun(self.hypothesis, segments)]

    def starts(self, dt: float) -> list[RecordingFault]:
        """It, and a delay by whole sampling intervals [s] before it: loggers are late by a cycle, not by a part."""
        if isinstance(self.hypothesis, DriveHypothesis) or self.hypothesis.what != "delay":
            return [self]
        whole = math.copysign(max(round(abs(self.size) / dt), 1) * dt, self.size)
        return [self] if abs(self.size - whole) < CRITERIA.same_delay * dt else [replace(self, size=whole), self]

    @property
    def linear(self) -> bool:
        """Whether it is a disturbance of the drive rather than another reading of a channel."""
        return isinstance(self.hypothesis, DriveHypothesis)

    def unusual(self, dt: float) -> bool:
        """Whether it is larger than what sound transducers and loggers with this sampling interval [s] do, too."""
        if isinstance(self.hypothesis, DriveHypothesis):
            return True
        usual = CRITERIA.conversion_order if 1 not in self.hypothesis.ways else CRITERIA.filtered
        return abs(self.size) >= usual * self.hypothesis.step(dt)

    @property
    def unit(self) -> str:
        """Of the size."""
        return self.hypothesis.unit

    @property
    def text(self) -> str:
        """In words, with its size, and with what may be in its place."""
        late, much = ("late", "much") if self.size > 0.0 else ("early", "little")
        corner = f"{1.0 / (2.0 * np.pi * abs(self.size)):.3g} Hz" if self.unit == "s" and self.size else ""
        size = percent(abs(self.size)) if self.unit == "1" else f"{1e3 * abs(self.size):.3g} m{self.unit}"
        own = self.hypothesis.text.format(size=size, late=late, much=much, corner=corner)
        others = [*(one.text for one in self.alternatives), *(f"{name} is missing" for name in self.instead)]
        same = ", or ".join(others)
        return f"{own} (or {same}, which these data cannot distinguish)" if same else own


def other_gains(fault: RecordingFault, channels: AbstractSet[str]) -> list[RecordingFault]:
    """Gains of the other readings that would make up for a gain; ``channels``: of all records."""
    others = [h for h in HYPOTHESES if h.what == "gain" and h is not fault.hypothesis and h.shown_by(channels)]
    return [replace(fault, hypothesis=h, size=-fault.size, alternatives=()) for h in others]


def _begun(hypothesis: Hypothesis, segments: Sequence[Segments]) -> list[Segments]:
    """Segments to which a fault may be applied."""
    return list(segments) if hypothesis.what == "gain" else [without_small_delays(s) for s in segments]


def without_small_delays(segments: Segments) -> Segments:
    """Segments, their channels taken to be no later than what was named says."""
    return replace(segments, readings=tuple(replace(r, delay=r.named) for r in segments.readings))


def recording_faults(at: Linearisation, disturbances: bool = True) -> list[RecordingFault]:
    """All that lower the sum of squares, the most promising first; sums are those of all segments for fitting.

    ``disturbances``: whether those of the drive are tried, too.
    """
    part, share = at.sample(CRITERIA.enough_to_score)
    point = part.point
    runs = point.shooting.simulated(point.plant, point.initial_states)
    before = _cost(part, [p.raw for p in point.projections])
    # Of one pressure in each record, A or B, both together may be late just as well.
    channels = {c for s in point.shooting.segments for c in s.channels}
    shown = [h for h in HYPOTHESES if h.shown_by(channels)]
    found = [f for f in results(lambda h: _best(part, runs, h, before, share), shown) if f is not None]
    if disturbances and not any(s.disturbance.shape[-1] for s in point.shooting.segments):
        for one in DRIVE_HYPOTHESES:
            size = float(np.median([one.size(s) for s in at.split.segments]))
            if not size > 0.0:
                continue
            responses = one.responses(part)
            lower = before - _cost_disturbed(part, responses)
            if one.exact and lower < before - _cost_disturbed(part, [0.5 * r for r in responses]):
                continue  # disturbances of that size would show more than there is
            found += [RecordingFault(one, size, 0.0, lower / share)] if lower > 0.0 else []
    return sorted(found, key=lambda f: -f.reduction)


def resized(at: Linearisation, fault: RecordingFault) -> RecordingFault:
    """The same fault with the size that fits best now; the linearisation's segments have it already."""
    if isinstance(fault.hypothesis, DriveHypothesis):
        return fault
    part, share = at.sample(CRITERIA.enough_to_score)
    segments = [fault.hypothesis.applied(s, -fault.size) for s in part.point.shooting.segments]
    point = replace(part.point, shooting=replace(part.point.shooting, segments=segments))
    part = replace(part, point=point)
    runs = point.shooting.simulated(point.plant, point.initial_states)
    return _best(part, runs, fault.hypothesis, np.inf, share, fault.size) or fault


def _cost_disturbed(part: Linearisation, responses: Sequence[Array]) -> float:
    """As `_cost`, with disturbances that do this to the channels, and with what their freedom is worth."""
    shooting = replace(part.point.shooting, segments=disturbed(part.point.shooting.segments, responses))
    projections = shooting.projections(part.point.plant, part.point.initial_states)
    point = replace(part.point, shooting=shooting, projections=projections)
    beyond = [p.beyond(b) for p, b in zip(projections, part.beyond, strict=True)]
    worth = sum(float(f.sum()) for f in freedom(projections, part.point.projections))
    return _cost(replace(part, point=point, known=beyond), [p.raw for p in projections]) + worth


def _best(
    part: Linearisation,
    runs: Sequence[Array],
    hypothesis: Hypothesis,
    before: float,
    share: float,
    begin: float | None = None,
) -> RecordingFault | None:
    unit, begun = hypothesis.step(part.split.interval), _begun(hypothesis, part.point.shooting.segments)

    def cost(size: float) -> float:
        changed = [hypothesis.applied(s, size * unit) for s in begun]
        every = zip(changed, runs, part.point.projections, strict=True)
        return _cost(part, [segments.deviation(run, p.raw) for segments, run, p in every])

    sizes = [way * size for way in hypothesis.ways for size in TRIED] if begin is None else [begin / unit]
    tried = {size: cost(size) for size in sizes}
    start = min(tried, key=lambda size: tried[size])
    if tried[start] >= before:
        return None
    near = sorted((0.5 * start, min(2.0, MOST / abs(start)) * start))
    done = minimize_scalar(cost, bounds=near, method="bounded", options={"xatol": 0.02})
    size, lowest = (float(done.x), float(done.fun)) if done.fun < tried[start] else (start, tried[start])
    step = max(0.05, 0.05 * abs(size))
    curvature = max((cost(size + step) - 2.0 * lowest + cost(size - step)) / step**2, 1e-12)
    variance = max(1.0, lowest / max(sum(int(s.counted.sum()) for s in part.split.segments), 1))
    error = float(np.sqrt(2.0 * variance * share / curvature))
    return RecordingFault(hypothesis, size * unit, error * unit, (before - lowest) / share)


def _cost(part: Linearisation, raw: Sequence[Array]) -> float:
    """Sum of squares of these residuals (S, m), initial states and free parameters where they fit best."""
    residual = [r[..., 0] for r in part.point.beyond([r[..., None] for r in raw])]
    empty = [np.zeros((*r.shape, 0)) for r in residual]
    normal = part.bordered(empty, residual)
    change = bounded_step(normal, part.parameters)
    return float(sum(np.sum(r**2) for r in residual)) - normal.reduction(change)
