"""The closed loop in one process: a controller at 1 kHz on a nonlinear plant or on an identified linear model.

As through topics, a drive that answers the sample of one instant is applied from the next one on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hydraulic_control.controller import Controller
from hydraulic_control.response import Response
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant

PERIOD_S = 1e-3
Reference = Callable[[float], tuple[float, float]]
"""Position [m] and velocity [m/s] at a time [s]."""


class LoopPlant(Protocol):
    """What a loop needs of a plant; ``true_position`` [m] is the one at the last sample, without the sensor's noise."""

    true_position: float

    def step(self, drive: float, dt: float) -> tuple[float, float, float]:
        """Position [m], force from the pressures [N] and applied drive [V] now; then advance with that drive [V]."""


@dataclass(frozen=True)
class SensorNoise:
    """Noise of the bench: standard deviations of position [m] and of each pressure [Pa], resolution of position [m]."""

    position: float = 2e-5
    resolution: float = 2.4e-5
    pressure: float = 15e3


QUIET = SensorNoise(0.0, 0.0, 0.0)


class SimulatedPlant:
    """A physical model behind its sensors, from rest at ``position`` [m]; the same seed gives the same noise."""

    def __init__(self, model: Model, noise: SensorNoise = SensorNoise(), seed: int = 0, position: float = 0.0) -> None:
        plant = Plant(model)
        self._live = plant.live(plant.initial_state(position=position))
        self._noise, self._generator = noise, np.random.default_rng(seed)
        area = float(np.hypot(plant.value("piston_area_a"), plant.value("piston_area_b")))
        self._force_noise = noise.pressure * area
        self._draws: list[list[float]] = []
        self.true_position = position

    def step(self, drive: float, dt: float) -> tuple[float, float, float]:
        """See `LoopPlant`. Raises `SimulationError` where the physics cannot be followed."""
        now = self._live.step(drive, dt)
        if not self._draws:
            self._draws = self._generator.standard_normal((1000, 2)).tolist()
        of_position, of_force = self._draws.pop()
        self.true_position = now.position
        position, resolution = now.position + self._noise.position * of_position, self._noise.resolution
        if resolution > 0.0:
            position = round(position / resolution) * resolution
        return position, now.force + self._force_noise * of_force, now.drive


def run(
    plant: LoopPlant, controller: Controller, reference: Reference, duration: float, dt: float = PERIOD_S
) -> Response:
    """Play ``reference`` for ``duration`` [s]; the controller is stopped first and begins with the first sample.

    The controller sees the sensors, the response holds the true position: figures are not to be those of the noise.
    A plant that cannot be followed any more ends the loop there: what is missing of the response is not a number.
    """
    count = round(duration / dt)
    columns = np.full((4, count), np.nan)
    time, wanted, position, applied = columns
    controller.stop()
    drive = 0.0
    for i in range(count):
        t = i * dt
        r, velocity = reference(t)
        try:
            x, force, u = plant.step(drive, dt)
        except SimulationError:
            break
        drive = controller.step(dt, r, velocity, x, force)
        time[i], wanted[i], position[i], applied[i] = t, r, plant.true_position, u
    return Response(time, wanted, position, applied)


def step_reference(amplitude: float, start: float = 0.0, at: float = 0.1) -> Reference:
    """A step of ``amplitude`` [m] from ``start`` [m] at the time ``at`` [s]."""
    return lambda t: (start + amplitude if t >= at else start, 0.0)
