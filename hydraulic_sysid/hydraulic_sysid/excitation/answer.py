"""What a plan answers a measured position with, and which position ends it: the same on the bench and in a rehearsal.

Rehearsals play it with a plant in one compiled loop, some fifteen times as fast as sample by sample from Python. That
is kept on disk, and made anew where this file has changed: what the loop calls must stand here, too. The plant is a
pointer to its own compiled code, whatever its effects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.embedded import POSITION
from hydraulic_sysid.excitation.plan import Plan

DONE, LOST, STRAYED = range(3)
"""How a rehearsal ends: as planned, with a plant that cannot be followed, or where its piston may not be."""


class Answers(NamedTuple):
    """What the answers of a plan rest on. SI, V; one value per sample in ``open_loop`` and ``envelope``."""

    open_loop: Sequence[float] | Array
    envelope: Sequence[float] | Array
    approach: int  # samples
    approach_gain: float
    approach_limit: float
    centre: float
    centring_gain: float
    centring_limit: float
    amplitude_limit: float
    travel_limit: float

    @classmethod
    def of(cls, plan: Plan) -> Answers:
        """Those of a plan."""
        return cls(
            plan.open_loop, plan.envelope, round(plan.approach * plan.rate), float(plan.approach_gain),
            float(plan.approach_limit), float(plan.centre), float(plan.centring_gain), float(plan.centring_limit),
            float(plan.amplitude_limit), float(plan.travel_limit),
        )  # fmt: skip


def answer(plan: Answers, index: int, position: float) -> float:
    """The drive [V] of sample ``index`` with the piston at ``position`` [m]: see `ExcitationRun`."""
    off = position - plan.centre
    if index < plan.approach:
        return min(max(-plan.approach_gain * off, -plan.approach_limit), plan.approach_limit)
    pull = min(max(-plan.centring_gain * off, -plan.centring_limit), plan.centring_limit)
    drive = plan.open_loop[index] + plan.envelope[index] * pull
    return min(max(drive, -plan.amplitude_limit), plan.amplitude_limit)


def strays(plan: Answers, before: int, position: float) -> bool:
    """Whether a ``position`` [m] seen after sample ``before`` ends the run: no number, or beyond the travel limit."""
    return not math.isfinite(position) or (before >= plan.approach and abs(position - plan.centre) > plan.travel_limit)


def why(plan: Answers, position: float) -> str:
    """Why such a ``position`` [m] ends the run."""
    if not math.isfinite(position):
        return f"the position is {position}"
    low, high = 1e3 * (plan.centre - plan.travel_limit), 1e3 * (plan.centre + plan.travel_limit)
    return f"the piston is at {1e3 * position:.1f} mm (allowed: {low:.1f} … {high:.1f} mm)"


def play(run, longest, turn, on, parameters, hydraulic, x, memory, plan, dt, limit, seen, resolution, out, drive):
    """From the state (x, memory), which moves on; ``limit`` of the drive [V], ``resolution`` of the position [m].

    The first six are of `hydraulic_sim.embedded.Embedded`. ``seen`` (N,) has the position's noise and takes its
    readings, ``out`` (N, outputs) and ``drive`` (N,) what the plant did. As on the bench, a drive answers a state and
    acts from the next one on. Returns how many samples were played, and how that ended.
    """
    u, failure = np.zeros(1), np.zeros(2)
    for i in range(len(drive)):
        drive[i] = min(max(u[0], -limit), limit)
        u[0] = drive[i]
        now = out[i : i + 1]
        if run(u, dt, i * dt, now, 0, longest, turn, on, parameters, hydraulic, x, memory, now, failure) < 1:
            return i, LOST
        position = now[0, POSITION] + seen[i]
        if resolution > 0.0:
            position = np.rint(position / resolution) * resolution
        seen[i] = position
        if strays(plan, i - 1, position):
            return i + 1, STRAYED
        u[0] = answer(plan, i, position)
    return len(drive), DONE


@lru_cache(maxsize=1)
def compiled_play() -> Callable[..., tuple[int, int]]:
    """`play`, compiled; its arguments are of exactly these types."""
    from numba import njit, types  # a bench that rehearses nothing needs none of it
    from numba.extending import register_jitable

    from hydraulic_sim.compiled import RUN

    for called in (answer, strays):
        register_jitable(called)
    real, reals = types.float64, types.float64[::1]
    plan = types.NamedTuple([reals, reals, types.int64, *[real] * 7], Answers)
    plant = types.FunctionType(RUN), real, real, types.uint8[::1], reals, types.uint8, reals, reals
    signature = types.UniTuple(types.int64, 2)(*plant, plan, real, real, reals, real, types.float64[:, ::1], reals)
    function: Callable[..., tuple[int, int]] = njit(signature, cache=True, nogil=True, error_model="numpy")(play)
    return function
