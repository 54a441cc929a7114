"""What a plan answers a measured position with, and which position ends it: the same on the bench and in a rehearsal.

Plain functions of numbers, so that numba compiles them, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.plan import Plan


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
