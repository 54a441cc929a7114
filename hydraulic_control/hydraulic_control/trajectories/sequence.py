"""One trajectory after another."""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import dataclass
from typing import ClassVar

from ._base import MotionLimits, Trajectory
from .minimum_jerk import MinimumJerk, shortest_time

_SETTLE_S = 0.5


@dataclass(frozen=True)
class Rest:
    """Stay at ``position`` [m] for ``duration`` [s]."""

    position: float
    duration: float
    jumps: ClassVar[bool] = False

    def at(self, t: float) -> tuple[float, float]:
        return self.position, 0.0


class Sequence:
    """Trajectories one after another."""

    def __init__(self, parts: Several[Trajectory]) -> None:
        self._parts = tuple(parts)

    @property
    def duration(self) -> float:
        return sum(part.duration for part in self._parts)

    @property
    def jumps(self) -> bool:
        return any(part.jumps for part in self._parts)

    def at(self, t: float) -> tuple[float, float]:
        for part in self._parts[:-1]:
            if t < part.duration:
                return part.at(t)
            t -= part.duration
        return self._parts[-1].at(t)


def approach(position: float, trajectory: Trajectory, limits: MotionLimits) -> Sequence:
    """From ``position`` [m] smoothly to where the trajectory begins, half a second of rest, and the trajectory."""
    start = trajectory.at(0.0)[0]
    way = MinimumJerk(position, start - position, shortest_time(start - position, limits), back=False)
    return Sequence([way, Rest(start, _SETTLE_S), trajectory])
