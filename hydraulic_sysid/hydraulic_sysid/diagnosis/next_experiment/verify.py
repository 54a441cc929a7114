"""The designed experiment tried before anything moves: played on every model, every model refitted to every other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from hydraulic_node_utils import processors
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.fit import Fit, FitSettings, fit_segments
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.amplitude import Limits
from hydraulic_sysid.excitation.simulated_run import SimulatedRun, simulate_plan

from .evidence import Pair, Point, segments
from .reference import used

_MOST_STEPS = 12  # of a refit; what later ones gain is small beside what distinguishes models


@dataclass(frozen=True)
class CrossFit:
    """Model ``pair[1]`` refitted to what model ``pair[0]`` does.

    ``left``: the sum of squares over the noise that no change of its parameters takes away, beyond what the true one
    itself leaves (initial states are read from a record and never quite exact); ``series`` (N, C): the difference
    over the noise; ``values`` [SI]: the parameters it ended at.
    """

    pair: Pair
    left: float
    values: dict[str, float]
    converged: bool
    channels: tuple[str, ...]
    times: Array
    series: Array

    @property
    def separation(self) -> float:
        """Mean over standard deviation of the difference of the two sums of squares: √λ/2.

        With normal noise e of unit variance and a difference d, ‖d + e‖² − ‖e‖² = λ + 2·d'e is distributed as N(λ, 4λ).
        """
        return 0.5 * math.sqrt(self.left)

    @property
    def misclassification(self) -> float:
        """The probability that noise makes the wrong one fit better."""
        return float(norm.sf(self.separation))

    @property
    def channel_shares(self) -> dict[str, float]:
        """Which part of what is left lies in which channel."""
        squares = np.sum(self.series**2, axis=0)
        return dict(zip(self.channels, (squares / max(float(squares.sum()), 1e-300)).tolist(), strict=True))


def simulated_runs(
    plan: Plan, points: Sequence[Point], limits: Limits, centre: float
) -> tuple[list[SimulatedRun], float, str]:
    """The plan played on every model by the code that plays it on the bench.

    :return: the runs, the largest part of a limit that is used, and of which limit
    :raises SimulationError: a model cannot follow.
    """
    found, worst, limit = [], 0.0, ""
    for point in points:
        seen = simulate_plan(plan, point.plant)
        rest = (float(seen.record["pressure_a"][0]), float(seen.record["pressure_b"][0]))
        parts = used(limits, seen.extremes, rest, centre)
        if seen.aborted and max(parts.values()) <= 1.0:
            parts = {"travel": 2.0}
        for name, part in parts.items():
            if part > worst:
                worst, limit = part, name
        found.append(seen)
    return found, worst, limit


def refits(
    points: Sequence[Point],
    chosen: Sequence[Pair],
    seen: Sequence[SimulatedRun],
    plan: Plan,
    noise: Mapping[str, float],
    length: float,
) -> list[CrossFit]:
    """Every pair of ``chosen``, the first of it by its simulated run in ``seen``.

    :raises HydraulicError: as a calibration.
    """
    records = [_played(s.record, plan, list(noise)) for s in seen]

    def fitted(number: int, record: Record, keys: Sequence[str]) -> Fit:
        point = points[number]
        cuts = [segments(record, point.model.kind, length, noise)]
        return fit_segments(point.plant, cuts, keys, FitSettings(length=length, most_steps=_MOST_STEPS))

    own = {t: fitted(t, records[t], ()).cost for t in {t for t, _ in chosen}}
    with ThreadPoolExecutor(processors.usable()) as pool:
        done = list(pool.map(lambda pair: fitted(pair[1], records[pair[0]], points[pair[1]].parameters.keys), chosen))
    return [_refit(pair, fit, own[pair[0]], records[pair[0]]) for pair, fit in zip(chosen, done, strict=True)]


def _refit(pair: Pair, done: Fit, own: float, record: Record) -> CrossFit:
    cut = done.point.shooting.segments[0]
    residual = cut.by_channel(done.point.projections[0].residual)
    index = cut.first[:, None] + np.arange(cut.samples - 1)
    return CrossFit(
        pair,
        max(done.cost - own, 0.0),
        done.values,
        done.converged,
        cut.channels,
        record.time[index.ravel()],
        residual[:, :-1].reshape(-1, len(cut.channels)),
    )


def _played(record: Record, plan: Plan, channels: Sequence[str]) -> Record:
    """The part of a simulated run in which the signal plays, with the channels that are measured."""
    part = record.window(plan.signal_start, plan.signal_start + plan.active_time)
    return Record.sampled(record.name, part.dt, {c: part[c] for c in ("drive", *channels)})
