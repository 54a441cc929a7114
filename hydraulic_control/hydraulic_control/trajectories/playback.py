"""A reference from a file."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from hydraulic_control.errors import ControlError

from ._base import MotionLimits

COLUMNS = ("time_s", "position_m")


class Playback:
    """Positions [m] over time [s], joined without overshoot by a monotone cubic that begins and ends at rest."""

    jumps: ClassVar[bool] = False

    def __init__(self, time: np.ndarray, position: np.ndarray) -> None:
        slopes = PchipInterpolator(time, position).derivative()(time)
        slopes[0] = slopes[-1] = 0.0
        self._curve = CubicHermiteSpline(time - time[0], position, slopes)
        self._slope = self._curve.derivative()
        self._ends = float(position[0]), float(position[-1])
        self._duration = float(time[-1] - time[0])

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], limits: MotionLimits) -> Playback:
        """See `make`; reads the CSV file with the columns time_s and position_m."""
        return cls(*read_points(Path(settings["file"])))

    @property
    def duration(self) -> float:
        return self._duration

    def at(self, t: float) -> tuple[float, float]:
        if t < 0.0:
            return self._ends[0], 0.0
        if t > self._duration:
            return self._ends[1], 0.0
        return float(self._curve(t)), float(self._slope(t))


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and positions [m] of a CSV file.

    :raises ControlError: a file that cannot be read, lacks a column, or holds less than two points, values that are no
        numbers, or times that do not increase.
    """
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ControlError(f"{path}: cannot be read: {error}") from None
    try:
        points = np.array([[float(row[name]) for name in COLUMNS] for row in rows])
    except (KeyError, TypeError, ValueError):
        raise ControlError(f"{path}: needs numbers in the columns {', '.join(COLUMNS)}") from None
    if len(points) < 2 or not np.all(np.isfinite(points)) or not np.all(np.diff(points[:, 0]) > 0.0):
        raise ControlError(f"{path}: needs at least two points, finite, with increasing {COLUMNS[0]}")
    return points[:, 0], points[:, 1]
