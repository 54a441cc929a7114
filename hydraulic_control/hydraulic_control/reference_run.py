"""One run of a reference: from where the piston is to the trajectory, along it, and what came of it; without ROS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hydraulic_control.errors import ControlError
from hydraulic_control.response import Response
from hydraulic_control.trajectories import MotionLimits, Trajectory, approach, make
from hydraulic_interfaces.samples import PlantSample, Reference

_LONGEST = 4_000_000  # samples kept


class StandstillWatch:
    """Notices a plant that does not follow: at 0 V for ``patience`` [s], further than ``error`` [m] from its reference.

    No controller leaves the drive at exactly 0 V there; a plant that is stopped or not enabled does.
    """

    def __init__(self, error: float = 5e-3, patience: float = 0.1) -> None:
        self.error, self.patience = error, patience
        self._since_ns: int | None = None

    def stands(self, sample: PlantSample, reference: float | None) -> bool:
        """Whether it has stood for that long at this state; ``reference`` [m] is what was sent last, None: nothing."""
        away = reference is not None and abs(reference - sample.position) > self.error
        if not away or sample.drive != 0.0:
            self._since_ns = None
            return False
        if self._since_ns is None:
            self._since_ns = sample.stamp_ns
        return (sample.stamp_ns - self._since_ns) * 1e-9 >= self.patience


class ReferenceRun:
    """Answers every state with a reference until the trajectory has been played, and keeps the response.

    :raises ControlError: a trajectory that is not possible within the limits.
    """

    def __init__(self, kind: str, settings: Mapping[str, Any], limits: MotionLimits) -> None:
        self.kind, self._limits = kind, limits
        self._own: Trajectory = make(kind, settings, limits)
        self._whole: Trajectory | None = None
        self._started_ns = self._last_ns = 0
        self._lead = 0.0
        self.done = False
        self._rows: list[tuple[float, float, float, float]] = []

    @property
    def duration(self) -> float:
        """Of the trajectory itself [s], without the approach."""
        return self._own.duration

    def answer(self, sample: PlantSample) -> Reference | None:
        """The reference at the instant of a state; None for a state out of order or without a position."""
        if not math.isfinite(sample.position) or (self._whole is not None and sample.stamp_ns <= self._last_ns):
            return None
        if self._whole is None:
            if abs(sample.position) > self._limits.travel:
                raise ControlError(
                    f"the piston is at {sample.position:.4g} m, outside the travel of ±{self._limits.travel:g} m"
                )
            self._whole = approach(sample.position, self._own, self._limits)
            self._lead = self._whole.duration - self._own.duration
            self._started_ns = sample.stamp_ns
        self._last_ns = sample.stamp_ns
        t = (sample.stamp_ns - self._started_ns) * 1e-9
        position, velocity = self._whole.at(t)
        if t >= self._lead and len(self._rows) < _LONGEST:
            self._rows.append((t - self._lead, position, sample.position, sample.drive))
        self.done = t >= self._whole.duration
        return Reference(sample.stamp_ns, position, velocity)

    @property
    def start_ns(self) -> int:
        """Stamp at which the trajectory itself began: 0 s of the response."""
        return self._started_ns + round(self._lead * 1e9)

    def response(self) -> Response:
        """What has been played so far, from the trajectory's beginning."""
        rows = np.array(self._rows, dtype=float).reshape(-1, 4)
        return Response(*(rows[:, i].copy() for i in range(4)))
