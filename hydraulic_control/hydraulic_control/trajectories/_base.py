"""What every trajectory has in common, and the check that it stays within the limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol

import numpy as np

from hydraulic_control.errors import ControlError

_GRID_S = 1e-3
_LONGEST_GRID = 2_000_000
_TOLERANCE = 1.001


@dataclass(frozen=True)
class MotionLimits:
    """Largest position to either side of mid-stroke [m], velocity [m/s] and acceleration [m/s²] of a reference."""

    travel: float = 0.6
    velocity: float = 0.4
    acceleration: float = 10.0


class Trajectory(Protocol):
    """A reference over time; before 0 and after its duration it rests."""

    @property
    def duration(self) -> float:
        """Seconds until it rests for good."""

    @property
    def jumps(self) -> bool:
        """Whether its position jumps, which no limit of velocity can hold for."""

    def at(self, t: float) -> tuple[float, float]:
        """Position [m] and velocity [m/s] at ``t`` [s]."""


@dataclass(frozen=True)
class Profile:
    """A trajectory by formula; its numbers are its fields."""

    offset: float
    amplitude: float
    jumps: ClassVar[bool] = False

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], limits: MotionLimits) -> Trajectory:
        """See `make`; a field that is no setting is a limit."""
        known = {**vars(limits), **settings}
        return cls(**{f.name: known[f.name] for f in fields(cls)})  # type: ignore[return-value]


def ramped(now: float, total: float, distance: float, speed: float, acceleration: float) -> tuple[float, float]:
    """Way [m] and speed [m/s] at ``now`` [s] of a way that takes ``total`` [s] from rest to rest.

    It goes at ``speed`` between ramps of constant ``acceleration``.
    """
    ramp, left = speed / acceleration, total - now
    if now < ramp:
        return 0.5 * acceleration * now**2, acceleration * now
    if left < ramp:
        return distance - 0.5 * acceleration * left**2, acceleration * left
    return speed * (now - 0.5 * ramp), speed


def check_limits(name: str, trajectory: Trajectory, limits: MotionLimits) -> None:
    """Refuse a trajectory that leaves the limits.

    A step and a staircase jump: of them only the travel is checked, the actuator goes as fast as it can.

    :raises ControlError: it leaves them; the text says what, how far, and what is allowed.
    """
    count = min(int(trajectory.duration / _GRID_S) + 2, _LONGEST_GRID)
    time = np.linspace(-_GRID_S, trajectory.duration + _GRID_S, count + 2)
    rows = np.array([trajectory.at(t) for t in time.tolist()])
    found = {"position": (np.max(np.abs(rows[:, 0])), limits.travel, "m")}
    if not trajectory.jumps:
        acceleration = np.diff(rows[:, 1]) / (time[1] - time[0])
        found["velocity"] = (np.max(np.abs(rows[:, 1])), limits.velocity, "m/s")
        found["acceleration"] = (np.max(np.abs(acceleration)), limits.acceleration, "m/s²")
    for what, (value, allowed, unit) in found.items():
        if not value <= allowed * _TOLERANCE:
            raise ControlError(
                f"{name}: the reference's {what} reaches {value:.4g} {unit}; allowed are {allowed:.4g} {unit}"
            )
