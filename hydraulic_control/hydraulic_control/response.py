"""What a closed loop did, and the figures it is judged by."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydraulic_control.errors import ControlError

Array = NDArray[np.float64]
BAND = 0.02
"""Settled means within this part of the step."""


@dataclass(frozen=True)
class Response:
    """Samples of a closed loop, each (N,): time [s], reference [m], position [m], applied drive [V]."""

    time: Array
    reference: Array
    position: Array
    drive: Array

    @property
    def ran_away(self) -> bool:
        """Whether the plant could not be followed to the end."""
        return not bool(np.isfinite(self.position).all())

    def as_document(self) -> dict[str, list[float]]:
        """Plain lists, for JSON."""
        return {name: value.tolist() for name, value in asdict(self).items()}

    def gaps(self) -> tuple[float, float]:
        """Part of the samples that is missing from a steady rate, and the longest time without one [s]."""
        steps = np.diff(self.time)
        whole = (self.time[-1] - self.time[0]) / float(np.median(steps))
        return max(1.0 - len(steps) / whole, 0.0), float(steps.max())

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Response:
        """The response in such a document.

        :raises ControlError: a column is missing or too short.
        """
        columns = {}
        for field in fields(cls):
            try:
                columns[field.name] = np.array(document[field.name], dtype=float)
            except (KeyError, TypeError, ValueError):
                raise ControlError(f"a response needs numbers for {field.name!r}") from None
        sizes = {len(column) for column in columns.values()}
        if len(sizes) != 1 or sizes.pop() < 10:
            raise ControlError("a response needs at least 10 samples, the same number of each column")
        return cls(**columns)


@dataclass(frozen=True)
class StepFigures:
    """Of one step.

    Rise time 10 … 90 % [s], settling time into ±2 % [s], overshoot [%], steady-state error [m], RMS error [m], integral
    of the squared error [m²·s] and of its absolute value [m·s], RMS drive [V] and the mean speed of the drive [V/s].
    What is not reached is infinite.
    """

    rise_time: float
    settling_time: float
    overshoot: float
    steady_state_error: float
    rms_error: float
    ise: float
    iae: float
    effort: float
    activity: float


def step_figures(response: Response) -> StepFigures:
    """Figures of the only step in the reference; before it the loop rests.

    The steady state is the mean over the last tenth.

    :raises ControlError: the reference does not step exactly once, or nothing comes after it.
    """
    jumps = np.flatnonzero(np.diff(response.reference) != 0.0)
    if len(jumps) != 1:
        raise ControlError(f"the reference changes {len(jumps)} times; figures of a step need exactly one")
    first = int(jumps[0]) + 1
    t, x, u = (c[first:] for c in (response.time, response.position, response.drive))
    start, goal = response.reference[first - 1], response.reference[first]
    part = (x - start) / (goal - start)
    t = t - t[0]
    tail = x[-max(len(x) // 10, 1) :]
    whole = tracking_figures(Response(t, np.full_like(t, goal), x, u))
    return StepFigures(
        rise_time=_reached(t, part, 0.9) - _reached(t, part, 0.1),
        settling_time=_settled(t, part),
        overshoot=100.0 * max(float(part.max()) - 1.0, 0.0),
        steady_state_error=float(abs(goal - tail.mean())),
        rms_error=whole.rms_error,
        ise=float(np.sum((goal - x) ** 2) * np.median(np.diff(t))),
        iae=whole.iae,
        effort=whole.effort,
        activity=whole.activity,
    )


@dataclass(frozen=True)
class TrackingFigures:
    """Of any reference.

    RMS and largest error [m], integral of the absolute error [m·s], RMS drive [V] and the mean speed of the drive
    [V/s].
    """

    rms_error: float
    largest_error: float
    iae: float
    effort: float
    activity: float


def tracking_figures(response: Response) -> TrackingFigures:
    """Figures over the whole response."""
    error = response.reference - response.position
    dt = float(np.median(np.diff(response.time)))
    return TrackingFigures(
        rms_error=float(np.sqrt(np.mean(error**2))),
        largest_error=float(np.max(np.abs(error))),
        iae=float(np.sum(np.abs(error)) * dt),
        effort=float(np.sqrt(np.mean(response.drive**2))),
        activity=float(np.mean(np.abs(np.diff(response.drive))) / dt),
    )


def _reached(t: Array, part: Array, level: float) -> float:
    """When ``part`` first passes ``level``, interpolated between samples; infinite if it never does."""
    above = np.flatnonzero(part >= level)
    if not len(above):
        return float("inf")
    i = int(above[0])
    if i == 0:
        return float(t[0])
    share = (level - part[i - 1]) / (part[i] - part[i - 1])
    return float(t[i - 1] + share * (t[i] - t[i - 1]))


def _settled(t: Array, part: Array) -> float:
    """When ``part`` is within the band for good; infinite if it is not at the end."""
    outside = np.flatnonzero(np.abs(part - 1.0) > BAND)
    if not len(outside):
        return 0.0
    last = int(outside[-1])
    return float(t[last + 1]) if last + 1 < len(t) else float("inf")
