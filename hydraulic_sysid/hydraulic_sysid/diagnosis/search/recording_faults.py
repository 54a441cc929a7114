"""How the records were made, as an explanation of its own: channels that are late, early or behind a low pass.

Each fault has one size. For every size that is tried the recorded signals are made anew from one simulated run, and the
free parameters follow to first order (variable projection); nothing else is simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.levenberg_marquardt import bounded_step
from hydraulic_sysid.estimation.recording import Timing
from hydraulic_sysid.estimation.segments import Segments

from .linearisation import Linearisation

ENOUGH = 50  # segments that do for a look
MOST = 20.0  # sampling intervals by which a channel may be late
TRIED = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # sampling intervals from which the best size is searched
PRESSURES = ("pressure_a", "pressure_b")


@dataclass(frozen=True)
class Hypothesis:
    """``channels`` recorded late (``way`` 1) or early (−1), or behind a low pass; ``text``: the fault in words."""

    name: str
    channels: tuple[str, ...]
    low_pass: bool
    ways: tuple[int, ...]
    text: str
    remedy: str

    def applied(self, segments: Segments, size: float) -> Segments:
        """Segments whose record is taken to have a fault of this ``size`` [s]."""
        found = list[Timing]()
        for channel, timing in zip(segments.channels, segments.timing, strict=True):
            if channel in self.channels:
                if self.low_pass:
                    timing = replace(timing, lag=max(timing.lag + size, 0.0))
                else:
                    # The small delay that a channel may have without a name is part of the fault.
                    timing = replace(timing, delay=timing.named + size, named=timing.named + size)
            found.append(timing)
        return replace(segments, timing=tuple(found))


# A position that is late, and a valve that is, are physics of the library (sensor_delay, sensor_lag, command_delay).
HYPOTHESES = (
    Hypothesis("pressures", PRESSURES, False, (1, -1), "the pressures were recorded {size} {late}",
               "shift them, or sample all channels at one instant"),
    Hypothesis("pressures_low_pass", PRESSURES, True, (1,), "the pressures went through a low pass of {corner}",
               "take the filter out, or use faster transducers"),
    *(Hypothesis(c, (c,), False, (1, -1), f"{c} was recorded {{size}} {{late}}",
                 "shift it, or sample all channels at one instant") for c in PRESSURES),
    *(Hypothesis(f"{c}_low_pass", (c,), True, (1,), f"{c} went through a low pass of {{corner}}",
                 "take the filter out, or use a faster transducer") for c in PRESSURES),
    Hypothesis("drive", ("position", *PRESSURES), False, (-1,), "the drive was recorded {size} late",
               "record the drive at the instant at which it is put out"),
    Hypothesis("position", ("position",), False, (-1,), "the position was recorded {size} early",
               "shift it, or sample all channels at one instant"),
)  # fmt: skip
UNSEEN_DRIVE = Hypothesis("drive_between_samples", ("drive",), False, (),
                          "the drive changed between the samples of the record",
                          "record as often as the drive is put out")  # fmt: skip
JUMPS = 4  # of the drive in a segment, the largest, whose instant is uncertain by a sample


@dataclass(frozen=True)
class RecordingFault:
    """A fault, its ``size`` [s] ± ``standard_error``, and the ``reduction`` of the sum of squares that it promises."""

    hypothesis: Hypothesis
    size: float
    standard_error: float
    reduction: float

    def applied(self, at: Linearisation) -> list[Segments]:
        """The linearisation's segments, their records taken to have it."""
        segments = at.point.shooting.segments
        if self.hypothesis is UNSEEN_DRIVE:
            return uncertain(at)
        return [self.hypothesis.applied(s, self.size) for s in segments]

    @property
    def text(self) -> str:
        """In words, with its size."""
        late = "late" if self.size > 0.0 else "early"
        corner = f"{1.0 / (2.0 * np.pi * abs(self.size)):.3g} Hz" if self.size else ""
        return self.hypothesis.text.format(size=f"{1e3 * abs(self.size):.3g} ms", late=late, corner=corner)


def recording_faults(at: Linearisation) -> list[RecordingFault]:
    """All that lower the sum of squares, the most promising first; sums are those of all segments for fitting."""
    part, share = at.sample(ENOUGH)
    point = part.point
    runs = point.shooting.simulated(point.plant, point.initial_states)
    before = _cost(part, [p.raw for p in point.projections])
    found = []
    for hypothesis in HYPOTHESES:
        if not any(set(hypothesis.channels) <= set(s.channels) for s in point.shooting.segments):
            continue
        fault = _best(part, runs, hypothesis, before, share)
        found += [fault] if fault is not None else []
    if not any(s.disturbance.shape[-1] for s in point.shooting.segments):
        lower = before - _cost_between(part)
        dt = part.split.segments[0].record.dt
        found += [RecordingFault(UNSEEN_DRIVE, dt, 0.0, lower / share)] if lower > 0.0 else []
    return sorted(found, key=lambda f: -f.reduction)


def resized(at: Linearisation, fault: RecordingFault) -> RecordingFault:
    """The same fault with the size that fits best now; the linearisation's segments have it already."""
    if fault.hypothesis is UNSEEN_DRIVE:
        return fault
    part, share = at.sample(ENOUGH)
    segments = [fault.hypothesis.applied(s, -fault.size) for s in part.point.shooting.segments]
    point = replace(part.point, shooting=replace(part.point.shooting, segments=segments))
    part = replace(part, point=point)
    runs = point.shooting.simulated(point.plant, point.initial_states)
    return _best(part, runs, fault.hypothesis, np.inf, share, fault.size) or fault


def uncertain(at: Linearisation) -> list[Segments]:
    """Segments whose drive may have jumped anywhere between two samples, at its largest jumps in each."""
    point, plant = at.point, at.point.plant
    found = []
    for i, (segments, states) in enumerate(zip(point.shooting.segments, point.initial_states, strict=True)):
        drive = segments.record["drive"]
        jump = np.append(np.diff(drive), 0.0)
        inside = jump[segments.first[:, None] + np.arange(segments.samples - 1)]
        largest = np.argsort(-np.abs(inside), axis=1)[:, :JUMPS] + segments.first[:, None]
        base = segments.recorded(point.shooting.driven(plant, i, states, drive))
        columns = []
        for place in largest.T:
            moved = drive.copy()
            moved[place] += 0.5 * jump[place]
            columns.append(segments.recorded(point.shooting.driven(plant, i, states, moved)) - base)
        disturbance = np.stack(columns, axis=-1)
        nuisance = np.concatenate((segments.nuisance, segments.whitened(disturbance)), axis=-1)
        found.append(replace(segments, disturbance=disturbance, nuisance=nuisance))
    return found


def _cost_between(part: Linearisation) -> float:
    """As `_cost`, for segments whose drive is `uncertain`."""
    shooting = replace(part.point.shooting, segments=uncertain(part))
    projections = shooting.projections(part.point.plant, part.point.initial_states)
    point = replace(part.point, shooting=shooting, projections=projections)
    beyond = [p.beyond(b) for p, b in zip(projections, part.beyond, strict=True)]
    return _cost(replace(part, point=point, beyond=beyond), [p.raw for p in projections])


def _best(
    part: Linearisation,
    runs: Sequence[Array],
    hypothesis: Hypothesis,
    before: float,
    share: float,
    begin: float | None = None,
) -> RecordingFault | None:
    dt = min(s.record.dt for s in part.split.segments)

    def cost(size: float) -> float:
        changed = [hypothesis.applied(s, size * dt) for s in part.point.shooting.segments]
        every = zip(changed, runs, part.point.projections, strict=True)
        return _cost(part, [segments.deviation(run, p.raw) for segments, run, p in every])

    sizes = [way * size for way in hypothesis.ways for size in TRIED] if begin is None else [begin / dt]
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
    return RecordingFault(hypothesis, size * dt, error * dt, (before - lowest) / share)


def _cost(part: Linearisation, raw: Sequence[Array]) -> float:
    """Sum of squares of these residuals (S, m), initial states and free parameters where they fit best."""
    residual = [r[..., 0] for r in part.point.beyond([r[..., None] for r in raw])]
    empty = [np.zeros((*r.shape, 0)) for r in residual]
    normal = part.bordered(empty, residual)
    change = bounded_step(normal, part.parameters)
    return float(sum(np.sum(r**2) for r in residual)) - normal.reduction(change)
