"""The simulated actuator: the plant of a model file behind the topic contract."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_interfaces.samples import NAN, PlantSample
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.nodes.running import run_plant
from hydraulic_plant_node.plant_backend import BackendError, PlantBackend
from hydraulic_plant_node.travel_limits import EndsOfTravel
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.nodes._extra_effects import switched
from hydraulic_sim.nodes._sensors import Sensor
from hydraulic_sim.plant import Plant

DEFAULT_MODEL = "moog_mcr_m_1002_bench"
MODEL_PREFIX = "model."

SENSORS: tuple[ParameterSpec, ...] = (
    ParameterSpec("position_noise", 0.0, "standard deviation of the position", "m", 0.0, 1.0, live=True),
    ParameterSpec("position_resolution", 0.0, "least step of the position", "m", 0.0, 1.0, live=True),
    ParameterSpec("velocity_noise", 0.0, "standard deviation of the velocity", "m/s", 0.0, 10.0, live=True),
    ParameterSpec("velocity_resolution", 0.0, "least step of the velocity", "m/s", 0.0, 10.0, live=True),
    ParameterSpec("pressure_noise", 0.0, "standard deviation of each pressure", "Pa", 0.0, 1e8, live=True),
    ParameterSpec("pressure_resolution", 0.0, "least step of each pressure", "Pa", 0.0, 1e8, live=True),
)

PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec("model", DEFAULT_MODEL, "model file, or the name of a preset"),
    ParameterSpec("initial_position", 0.0, "where the piston starts, 0 is mid-stroke", "m", -100.0, 100.0),
    ParameterSpec("limit_margin", 1e-3, "limit switches close this far before the stops", "m", 0.0, 1.0),
    ParameterSpec("impact_speed", 0.0, "at most at a stop: drives are braked before it; 0: not", "m/s", 0.0, 1.0),
    ParameterSpec("noise_seed", 0, "seed of all sensor noise", "", 0, 2**31 - 1),
    ParameterSpec("publish_clock", False, "publish /clock: everybody else follows with use_sim_time"),
    ParameterSpec("real_time_factor", 1.0, "simulated per wall second, with publish_clock", "1", 0.01, 100.0),
    ParameterSpec("extra_effects", "", "beside the model's own, YAML: {valve_deadband: {width: 0.03}}", live=True),
    *SENSORS,
)


class Simulator(PlantBackend):
    """Integrates a model behind the plant node; the model's parameters appear as `model.<key>`."""

    hardware_id = "simulator"
    catch_up = 50

    def __init__(self) -> None:
        self._model: Model | None = None
        self._extra: tuple[str, ...] = ()

    def parameters(self) -> Sequence[ParameterSpec]:
        """See `PlantBackend.parameters`."""
        return PARAMETERS

    def configure(self, values: Mapping[str, Any]) -> Sequence[ParameterSpec]:
        """Read and compile the model.

        :raises ModelError: the model file is not acceptable.
        :raises SimulationError: no integration step follows its physics.
        :raises BackendError: the initial position lies outside the stroke.
        """
        model = load_model(values["model"])
        half = 0.5 * model.value("stroke")
        if abs(values["initial_position"]) > half:
            raise BackendError(
                f"initial_position is {values['initial_position']:g} m, outside the stroke of {model.name}: "
                f"{-half:g} … {half:g} m"
            )
        self._start = values["initial_position"]
        self._switch_at = half - values["limit_margin"]
        self._impact_speed = values["impact_speed"]
        # Compiles or loads the kernels too, which must not happen in the first cycle.
        self._live = LivePlant(Plant.at_rate(model, values["rate"]))
        seeds = np.random.SeedSequence(values["noise_seed"]).spawn(5)
        self._position, self._velocity, *self._pressures = (Sensor(seed) for seed in seeds)
        for spec in SENSORS:
            self.set_parameter(spec.name, values[spec.name])
        self._extra = ()
        self._switch_effects(values["extra_effects"])
        keys = model.keys()
        return [_model_parameter(model, key) for key in keys]

    def set_parameter(self, name: str, value: Any) -> None:
        """A sensor's noise or resolution, the extra effects, or a parameter of the model; from the next step on."""
        if name == "extra_effects":
            self._switch_effects(value)
            return
        if name.startswith(MODEL_PREFIX):
            model = self._live.plant.model.with_values({name.removeprefix(MODEL_PREFIX): value})
            self._live.replace_model(model)
            self._take_model(model)
            return
        quantity, _, what = name.partition("_")
        sensors = {"position": [self._position], "velocity": [self._velocity], "pressure": self._pressures}
        for sensor in sensors[quantity]:
            setattr(sensor, what, value)

    def ends_of_travel(self) -> EndsOfTravel | None:
        """Those of the model, where `impact_speed` asks for it.

        :raises BackendError: a model without a valve, whose speed follows from no data.
        """
        if not self._impact_speed:
            return None
        model = self._live.plant.model
        if model.kind != "hydraulic":
            raise BackendError(f"impact_speed: the speed of {model.name} does not follow from its data; allowed: 0")
        half, area = 0.5 * model.value("stroke"), min(model.value("piston_area_a"), model.value("piston_area_b"))
        drop = model.value("supply_pressure") - model.value("tank_pressure")
        flow = model.value("valve_flow") * math.sqrt(drop / model.value("valve_drop"))  # all of it over one land
        full_speed = flow / area * DRIVE_LIMIT_V / model.value("drive_limit")
        return EndsOfTravel(-half, half, self._impact_speed, full_speed)

    def activate(self) -> None:
        """Start from rest at the initial position."""
        plant = self._live.plant
        self._live = LivePlant(plant, plant.initial_state(position=self._start))

    def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample:
        """See `PlantBackend.step`."""
        now = self._live.step(drive, dt)
        read_a, read_b, read_supply = self._pressures
        a, b = read_a(now.pressure_a * self._hydraulic), read_b(now.pressure_b * self._hydraulic)
        return PlantSample(
            stamp_ns,
            position=self._position(now.position),
            velocity=self._velocity(now.velocity),
            force=a * self._area_a - b * self._area_b,
            drive=now.drive,
            spool=now.spool * self._spool_travel * self._hydraulic,
            pressure_a=a,
            pressure_b=b,
            pressure_supply=read_supply(now.pressure_supply * self._hydraulic),
            limit_retracted=now.position <= -self._switch_at,
            limit_extended=now.position >= self._switch_at,
        )

    def deactivate(self) -> None:
        """Nothing moves between steps."""

    def report(self) -> Mapping[str, str]:
        """The model in use, for the diagnostics."""
        if self._model is None:
            return {}
        return {"model": self._model.name, "effects": ", ".join(self._model.effects)}

    def _switch_effects(self, text: str) -> None:
        model, self._extra = switched(self._live.plant.model, self._extra, text)
        self._live.replace_model(model)
        self._take_model(model)

    def _take_model(self, model: Model) -> None:
        self._model = model
        self._area_a, self._area_b = model.value("piston_area_a"), model.value("piston_area_b")
        self._spool_travel = model.value("spool_travel")
        # A plant without hydraulics has no pressures and no spool that could be measured.
        self._hydraulic = 1.0 if model.kind == "hydraulic" else NAN


def _model_parameter(model: Model, key: str) -> ParameterSpec:
    record = model.parameter(key)
    name, (low, high) = MODEL_PREFIX + key, record.bounds
    return ParameterSpec(name, model.value(key), record.description, record.unit, low, high, live=True)


def main(argv: list[str] | None = None) -> int:
    """Run the simulator node."""
    return run_plant(Simulator(), "Simulated electro-hydraulic actuator on the bench's topics.", argv)


if __name__ == "__main__":
    sys.exit(main())
