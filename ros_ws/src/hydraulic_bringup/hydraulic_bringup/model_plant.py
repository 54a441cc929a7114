"""The plant of a model file behind the virtual CAN devices."""

from __future__ import annotations

import numpy as np

from hydraulic_can_driver.virtual import Reading
from hydraulic_sim.errors import ModelError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant

_BLOCK = 4096
_CHANNELS = 4  # position and three pressures


class ModelPlant:
    """Steps a model; adds white noise to what the sensors see.

    ``rate`` [Hz] of the steps to come; ``position`` [m] to start from, 0 is mid-stroke; standard deviations of the
    noise of position [m] and pressures [Pa]; ``seed`` of the noise. Compiles at once.

    :raises ModelError: the model is not acceptable, or the start lies outside the stroke.
    :raises SimulationError: no integration step follows its physics.
    """

    def __init__(
        self,
        model: Model,
        rate: float,
        position: float = 0.0,
        position_noise: float = 0.0,
        pressure_noise: float = 0.0,
        seed: int = 0,
    ) -> None:
        half = 0.5 * model.value("stroke")
        if abs(position) > half:
            raise ModelError(f"initial position is {position:g} m; {model.name} allows {-half:g} … {half:g} m")
        plant = Plant.at_rate(model, rate)
        LivePlant(plant).step(0.0, 1.0 / rate)  # loads the compiled code, which must not happen on the bench
        self._live = LivePlant(plant, plant.initial_state(position=position))
        self._hydraulic = model.kind == "hydraulic"
        self._scale = np.array([position_noise, *[pressure_noise] * (_CHANNELS - 1)])
        self._generator = np.random.default_rng(seed)
        self._noise: list[list[float]] = []

    def step(self, drive: float, dt: float) -> Reading:
        """See `hydraulic_can_driver.virtual.Plant`."""
        now = self._live.step(drive, dt)
        if not self._noise:
            self._noise = (self._scale * self._generator.standard_normal((_BLOCK, _CHANNELS))).tolist()
        x, a, b, supply = self._noise.pop()
        if not self._hydraulic:
            return Reading(now.position + x, now.velocity)
        return Reading(
            now.position + x,
            now.velocity,
            now.pressure_a + a,
            now.pressure_b + b,
            now.pressure_supply + supply,
            now.spool,
        )
