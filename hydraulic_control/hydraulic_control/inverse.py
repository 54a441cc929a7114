"""The steady inverse of a calibrated model: which drive gives which speed, with all the effects that the model has.

The model itself is run at constant drives from rest, so that an effect that was found and added, built in or the user's
own, is inverted without a line here.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hydraulic_control.errors import ControlError
from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.linear import velocity_gain
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

_DT = 1e-3  # s
_LONGEST = 0.6  # s at one drive
_TRAVEL = 0.4  # of the stroke to either side, that a run may need
_STEADY = 0.25  # last part of a run, over which speed and force are averaged
_STILL = 1e-4  # of the largest speed, below which it is called still
_JUMP = 1e-6  # of the largest speed, over which the inverse crosses a dead band
_STEP = 0.3  # of the largest drive, at which the lag is measured


class Inverse(NamedTuple):
    """Drives (N,) [V] over rising speeds (N,) [m/s], the force from the pressures (N,) [N] there.

    ``lag`` [s] is the mean time that the speed needs to follow the drive, ``pressure`` [Pa] supply less tank, ``area``
    [m²] the mean of the piston's.
    """

    drives: Array
    speeds: Array
    forces: Array
    lag: float
    pressure: float
    area: float


def inverse(name: str, size: int) -> Inverse:
    """The inverse of a model file or preset over ``size`` (odd) drives.

    :raises ControlError: the file cannot be read, or the model does not move to both sides.
    """
    try:
        path = Path(name)
        return _inverse(name, path.stat().st_mtime_ns if path.is_file() else 0, size)
    except (OSError, ValueError) as error:
        raise ControlError(f"model_inversion.model: {error}") from None


@lru_cache(maxsize=8)
def _inverse(name: str, edited: int, size: int) -> Inverse:
    return of_model(load_model(name), size)


def of_model(model: Model, size: int) -> Inverse:
    """As `inverse`, of a model."""
    if model.kind != "hydraulic":
        raise ControlError(f"{model.name}: cannot be inverted: its drive gives a force, no speed")
    plant = Plant.at_rate(model, 1.0 / _DT)
    limit, half = plant.value("drive_limit"), 0.5 * plant.value("stroke")
    fastest = velocity_gain(model) * limit
    count = max(round(min(_LONGEST, 2.0 * _TRAVEL * half / fastest) / _DT), 40)
    part = np.linspace(-1.0, 1.0, size // 2)
    drives = limit * np.sign(part) * part**2
    try:
        runs = np.array([_steady(plant, u, count, half) for u in drives.tolist()])
        lag = _lag(plant, _STEP * limit, count, half)
    except SimulationError as error:
        raise ControlError(f"{model.name}: cannot be inverted: {error}") from None
    if not (runs[0, 0] < -_STILL * fastest and runs[-1, 0] > _STILL * fastest):
        raise ControlError(
            f"{model.name}: cannot be inverted: at ∓{limit:g} V it moves at {runs[0, 0]:.3g} and {runs[-1, 0]:.3g} m/s"
        )
    points = np.column_stack((drives, runs))
    back, ahead = _branch(points, fastest, -1.0), _branch(points, fastest, 1.0)
    table = _filled(np.vstack((back, np.array([[0.5 * (back[-1, 0] + ahead[0, 0]), 0.0, 0.0]]), ahead)), size)
    area = 0.5 * (plant.value("piston_area_a") + plant.value("piston_area_b"))
    pressure = plant.value("supply_pressure") - plant.value("tank_pressure")
    inverted, speeds, forces = table.T.copy()
    return Inverse(inverted, speeds, forces, lag, pressure, area)


def _branch(points: Array, fastest: float, sign: float) -> Array:
    """Rows (drive, speed, force) of one direction, of rising speed, from the edge of the dead band on.

    The edge is where the line through the first two moving points meets no speed, but not within the drives that move
    nothing.
    """
    rows = points[sign * points[:, 1] > _STILL * fastest]
    rows = rows if sign > 0.0 else rows[::-1]
    speeds = sign * rows[:, 1]
    rows = rows[speeds > np.concatenate(([0.0], np.maximum.accumulate(speeds)[:-1]))]
    edge = rows[0].copy()
    if len(rows) > 1:
        edge[0] -= rows[0, 1] * (rows[1, 0] - rows[0, 0]) / (rows[1, 1] - rows[0, 1])
    still = points[(sign * points[:, 1] <= _STILL * fastest) & (sign * points[:, 0] < sign * rows[0, 0]), 0]
    if len(still):
        edge[0] = sign * max(sign * edge[0], float(np.max(sign * still)))
    edge[1] = sign * _JUMP * fastest
    rows = np.vstack((edge, rows[sign * rows[:, 0] > sign * edge[0]]))
    return rows if sign > 0.0 else rows[::-1]


def _filled(rows: Array, size: int) -> Array:
    """With rows put in the middle of the widest steps of the speed, until there are ``size``: the same broken line."""
    while len(rows) < size:
        widest = int(np.argmax(np.diff(rows[:, 1])))
        rows = np.insert(rows, widest + 1, 0.5 * (rows[widest] + rows[widest + 1]), axis=0)
    return rows


def _steady(plant: Plant, drive: float, count: int, half: float) -> tuple[float, float]:
    """Speed and force at a drive, begun so that the way lies around mid stroke."""
    start = plant.initial_state(position=-float(np.sign(drive)) * 0.5 * _TRAVEL * half)
    run = plant.simulate(np.full(count, drive), _DT, start)
    last = slice(-round(_STEADY * count), None)
    return float(run.velocity[last].mean()), float(run.force[last].mean())


def _lag(plant: Plant, drive: float, count: int, half: float) -> float:
    """Mean residence time ∫(v∞ − v)dt/(v∞ − v₀) of a step from half of the drive to all of it.

    K. J. Åström, T. Hägglund, Advanced PID Control, 2006, sec. 2.7.
    """
    steps = np.repeat([0.5 * drive, drive], count)
    speed = plant.simulate(steps, _DT, plant.initial_state(position=-_TRAVEL * half)).velocity
    last = round(_STEADY * count)
    before, after = speed[count - last : count].mean(), speed[-last:].mean()
    return float(np.clip(_DT * np.sum(after - speed[count:-last]) / (after - before), 0.0, 0.1))
