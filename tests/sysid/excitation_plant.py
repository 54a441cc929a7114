"""An integrating plant behind the plant node, with faults to switch on while it runs; runs as a process."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.nodes.running import run_plant
from hydraulic_plant_node.plant_backend import PlantBackend

SPEED_GAIN = 0.03  # m/s per volt


class FaultyPlant(PlantBackend):
    """Velocity proportional to the drive; `trouble` is nothing, "blind" or "deaf"."""

    catch_up = 50

    def parameters(self) -> Sequence[ParameterSpec]:
        return (ParameterSpec("trouble", "", "what goes wrong from now on", live=True),)

    def configure(self, values: Mapping[str, Any]) -> Sequence[ParameterSpec]:
        self._trouble, self._position = values["trouble"], 0.0
        return ()

    def set_parameter(self, name: str, value: Any) -> None:
        self._trouble = value

    def activate(self) -> None:
        pass

    def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample:
        applied = 0.0 if self._trouble == "deaf" else drive
        position = math.nan if self._trouble == "blind" else self._position
        speed = SPEED_GAIN * applied
        self._position += speed * dt
        return PlantSample(stamp_ns, position=position, velocity=speed, drive=applied)

    def deactivate(self) -> None:
        pass


if __name__ == "__main__":
    sys.exit(run_plant(FaultyPlant(), "Integrator with faults."))
