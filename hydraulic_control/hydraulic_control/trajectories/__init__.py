"""Reference trajectories: each one a small class with `duration` [s] and `at(t)` → position [m] and velocity [m/s].

A new kind is one more file and one more row in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hydraulic_control.errors import ControlError

from ._base import MotionLimits, Trajectory, check_limits
from .minimum_jerk import MinimumJerk
from .playback import Playback
from .sequence import Rest, Sequence, approach
from .sine import Sine
from .staircase import Staircase
from .step import Step
from .trapezoid import Trapezoid
from .triangle import Triangle

KINDS: dict[str, Any] = {
    "step": Step,
    "staircase": Staircase,
    "sine": Sine,
    "triangle": Triangle,
    "trapezoid": Trapezoid,
    "minimum_jerk": MinimumJerk,
    "playback": Playback,
}


def make(kind: str, settings: Mapping[str, Any], limits: MotionLimits) -> Trajectory:
    """The trajectory of that kind, within the limits.

    :param settings: offset [m], amplitude [m], frequency [Hz], cycles, levels, dwell [s], file
    :raises ControlError: an unknown kind, or it would leave the limits.
    """
    if kind not in KINDS:
        raise ControlError(f"reference kind is {kind!r}; allowed are {', '.join(KINDS)}")
    trajectory: Trajectory = KINDS[kind].from_settings(settings, limits)
    check_limits(kind, trajectory, limits)
    return trajectory


__all__ = ["KINDS", "MotionLimits", "Rest", "Sequence", "Trajectory", "approach", "make"]
