"""A plant of a few lines behind the plant node, to test the node without any physics; runs as a process."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.nodes.running import run_plant
from hydraulic_plant_node.plant_backend import BackendError, PlantBackend

STROKE = 0.2
REFUSED_GAIN = 0.75  # within the declared range, but not for this plant


class IntegratorPlant(PlantBackend):
    """Velocity proportional to the drive; writes what happens to it to the file `journal`."""

    hardware_id = "integrator"
    catch_up = 50

    def parameters(self) -> Sequence[ParameterSpec]:
        return (
            ParameterSpec("journal", "", "file that receives one line per call"),
            ParameterSpec(
                "trouble", "", "configure | activate | step | hang | deactivate | fault | set: what goes wrong"
            ),
            ParameterSpec("real_time_factor", 1.0, "plant seconds per wall second", "1", 0.01, 100.0),
            ParameterSpec("publish_clock", False, "be the clock"),
            ParameterSpec("hardware", "", "what it pretends to hang on"),
        )

    def hardware(self, values: Mapping[str, Any]) -> str:
        return str(values["hardware"])

    def configure(self, values: Mapping[str, Any]) -> Sequence[ParameterSpec]:
        self._journal, self._trouble = values["journal"], values["trouble"]
        self._gain, self._position, self._velocity, self._drift = 0.05, 0.0, 0.0, 0.0
        self._note("configure")
        if self._trouble == "configure":
            raise BackendError("no plant behind this name")
        return (
            ParameterSpec("model.gain", self._gain, "velocity per drive", "m/s/V", 0.0, 1.0, live=True),
            ParameterSpec("model.drift", self._drift, "velocity at 0 V", "m/s", -1.0, 1.0, live=True),
        )

    def set_parameter(self, name: str, value: Any) -> None:
        if value == REFUSED_GAIN:
            raise BackendError("the plant cannot follow")
        if self._trouble == "set":
            self._note("set hangs")
            time.sleep(3600.0)
        setattr(self, name.replace("model.", "_"), value)
        self._note(f"set {name} {value}")

    def description(self) -> Mapping[str, Any]:
        return {**super().description(), "gain": self._gain}

    def activate(self) -> None:
        self._note("activate")
        if self._trouble == "activate":
            raise BackendError("the plant does not answer")

    def set_enabled(self, on: bool) -> None:
        self._note(f"enabled {on}")

    def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample:
        if drive and self._trouble == "step":
            raise ArithmeticError("integrator burst")
        if drive and self._trouble == "hang":
            self._note("step hangs")
            while not Path(self._journal).with_name("go on").exists():
                time.sleep(0.01)
            self._note("step returns")
        if drive and self._trouble == "fault":
            self.fault = "cable break"
        sample = PlantSample(
            stamp_ns,
            position=self._position,
            velocity=self._velocity,
            force=100.0 * drive,
            drive=drive,
            pressure_a=7e6 + 1e5 * drive,
            pressure_b=7e6 - 1e5 * drive,
            pressure_supply=14e6,
            limit_retracted=self._position <= -STROKE / 2,
            limit_extended=self._position >= STROKE / 2,
        )
        self._velocity = self._gain * drive + self._drift
        self._position = min(max(self._position + self._velocity * dt, -STROKE / 2), STROKE / 2)
        self._last = drive
        return sample

    def deactivate(self) -> None:
        self._note(f"deactivate after {getattr(self, '_last', 0.0)} V")
        if self._trouble == "deactivate":
            raise BackendError("the plant does not answer")

    def reset(self) -> None:
        self._note("reset")
        self.fault = ""
        self._trouble = ""

    def cleanup(self) -> None:
        self._note("cleanup")

    def _note(self, line: str) -> None:
        if self._journal:
            with Path(self._journal).open("a") as journal:
                journal.write(line + "\n")


if __name__ == "__main__":
    sys.exit(run_plant(IntegratorPlant(), "Integrator behind the plant node."))
