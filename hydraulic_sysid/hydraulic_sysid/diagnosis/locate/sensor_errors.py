"""What the model's own sensors do to a reading, so that it can be taken out of a measured one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trajectory import Trajectory

_GRID = 401


@dataclass(frozen=True)
class SensorErrors:
    """Errors of the readings: for the position one that depends on the position alone, and one that has a history.

    ``grid`` (G,) readings and ``static`` (G,) their errors [m]; ``moving`` (N,) the rest, as it is in the free run;
    ``pressures``: the errors of the pressures' readings [Pa], (N,) each. None where the model has no such effect.
    """

    grid: Array | None = None
    static: Array | None = None
    moving: Array | None = None
    pressures: dict[str, Array] | None = None

    def corrected(self, channels: Mapping[str, Array]) -> dict[str, Array]:
        """Position and pressures (N,) as they were, if the model's sensors are right."""
        found = {n: channels[n] for n in ("position", "pressure_a", "pressure_b") if n in channels}
        if self.grid is not None and self.static is not None and self.moving is not None:
            found["position"] = found["position"] - np.interp(found["position"], self.grid, self.static) - self.moving
        for name, error in (self.pressures or {}).items():
            if name in found:
                found[name] = found[name] - error
        return found


def sensor_errors(model: Model, plant: Plant, free: Trajectory) -> SensorErrors:
    """Errors that the model states, `free` being its run over the record."""
    slots = {model.library[name].slot for name in model.effects}
    grid = static = moving = None
    if "position_sensor" in slots:
        span = 0.5 * plant.value("stroke")
        true = np.linspace(-1.05 * span, 1.05 * span, _GRID)
        states = np.tile(plant.initial_state().states, (_GRID, 1))
        states[:, 0] = true
        idle = np.zeros(2)
        read = plant.predict(idle, 1e-3, np.zeros(_GRID, dtype=np.int64), 1, states)["position"][:, 0]
        order = np.argsort(read, kind="stable")
        grid, static = read[order], (read - true)[order]
        error = free.position - free.true_position
        moving = error - np.interp(free.true_position, true, read - true)
    pressures = None
    if "pressure_sensor" in slots:
        pressures = {
            "pressure_a": free.pressure_a - free.true_pressure_a,
            "pressure_b": free.pressure_b - free.true_pressure_b,
        }
    return SensorErrors(grid, static, moving, pressures)
