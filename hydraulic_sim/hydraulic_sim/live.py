"""A plant that runs along, sample by sample."""

from __future__ import annotations

import numpy as np

from . import base
from .errors import ModelError
from .model import Model
from .plant import LONGEST_STEP, Plant
from .trajectory import PlantState, PlantValues


class LivePlant:
    """One running plant; `step` costs a few microseconds. Not to be shared between threads."""

    def __init__(self, plant: Plant, initial: PlantState | None = None) -> None:
        """From ``initial``, by default rest in mid stroke.

        :raises SimulationError: a state of another library.
        """
        initial = initial or plant.initial_state()
        plant.check_state(initial)
        self.plant = plant
        self._state = initial.states.copy()
        self._memory = initial.memory.copy()
        self._time = initial.time
        self._drive = np.zeros(1)
        self._out = np.empty((1, len(base.OUTPUTS)))
        self._limit = plant.value("drive_limit")
        self._areas = plant.value("piston_area_a"), plant.value("piston_area_b")

    def step(self, drive: float, dt: float) -> PlantValues:
        """What the sensors say now, with ``drive`` [V] applied from now on; then advance by ``dt`` [s].

        :raises SimulationError: as `Plant.simulate` does.
        """
        applied = min(max(drive, -self._limit), self._limit)
        self._drive[0] = applied
        self.plant.advance(self._drive, dt, self._time, self._state, self._memory, self._out)
        self._time += dt
        x, v, p_a, p_b, p_s, spool = self._out[0, :6].tolist()
        return PlantValues(x, v, p_a, p_b, p_s, spool, p_a * self._areas[0] - p_b * self._areas[1], applied)

    def replace_model(self, model: Model) -> None:
        """Go on with another model of the same library (effects on or off, other values) from the present state.

        States and memories would not fit.

        :raises ModelError: its effect files are not those this plant was compiled from: others, or edited since.
        """
        if model.library.fingerprint != self.plant.model.library.fingerprint:
            raise ModelError(f"model {model.name!r} has other effect files than the plant that runs, or edited ones")
        self.plant = Plant(model, min(self.plant.longest_step, LONGEST_STEP), self.plant.refinement)
        self._limit = self.plant.value("drive_limit")
        self._areas = self.plant.value("piston_area_a"), self.plant.value("piston_area_b")

    @property
    def state(self) -> PlantState:
        """A copy of the present state."""
        return PlantState(self._state.copy(), self._memory.copy(), self._time)
