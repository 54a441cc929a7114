"""The plants that can be chosen, and what is started for each."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_bringup.demo.online import SENSORS
from hydraulic_bringup.verbs.virtual_bench import FAULTS
from hydraulic_can_driver.bus import Bus
from hydraulic_workbench.errors import WorkbenchError

SIMULATOR, GUESS, CAN_VIRTUAL, CAN, ATTACHED = "simulator", "guess", "can_virtual", "can", "attached"
KINDS = (SIMULATOR, GUESS, CAN_VIRTUAL, CAN)
MODULES = {
    SIMULATOR: "hydraulic_sim.nodes.simulator",
    GUESS: "hydraulic_sim.nodes.simulator",
    CAN_VIRTUAL: "hydraulic_can_driver.nodes.can_driver",
    CAN: "hydraulic_can_driver.nodes.can_driver",
}
DEVICES = "hydraulic_bringup.verbs.virtual_bench"
REAL_TIME = 1.0  # the demo may hurry, people who watch may not


@dataclass(frozen=True)
class Chosen:
    """A plant as it was chosen: kind, model, effects that are hidden in it, bus, and whether time waits for answers."""

    kind: str
    name: str
    model: Path | None = None
    model_id: str | None = None
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    bus: str = "bench"
    interface: str = ""
    channel: str = ""
    lockstep: bool = True

    @property
    def real(self) -> bool:
        """Whether something moves."""
        return self.kind in (CAN, ATTACHED)

    def parameters(self) -> dict[str, object]:
        """Of the plant node."""
        values: dict[str, object] = {"lockstep": self.lockstep}
        if self.kind in (SIMULATOR, GUESS):
            return values | {"model": str(self.model), **SENSORS, "real_time_factor": REAL_TIME}
        return values | {"bus": self.bus, "interface": self.interface, "channel": self.channel}

    def device_options(self) -> list[str]:
        """Of the virtual devices."""
        noise = [f"--position-noise={SENSORS['position_noise']}", f"--pressure-noise={SENSORS['pressure_noise']}"]
        line = [f"--bus={self.bus}", f"--interface={self.interface}", f"--channel={self.channel}"]
        return [*line, f"--model={self.model}", *noise, "--listen", *(["--lockstep"] if self.lockstep else [])]

    def hidden_text(self) -> str:
        """What the simulator is told of the effects: a mapping in YAML's flow style."""
        rows = (f"{name}: {{{', '.join(f'{k}: {v!r}' for k, v in row.items())}}}" for name, row in self.hidden.items())
        return f"{{{', '.join(rows)}}}" if self.hidden else ""


def virtual_channel() -> str:
    """A channel of virtual CAN that nobody else on this machine is likely to have."""
    draw = random.SystemRandom().randint
    return f"239.74.{draw(0, 255)}.{draw(1, 254)}:{draw(20000, 30000)}"


def faults_of(bus: Bus) -> list[dict[str, Any]]:
    """Faults that the virtual devices of a bus can be given, one row for each device that can have it."""
    rows = []
    for name, fault in FAULTS.items():
        text = " ".join((fault.__doc__ or name).split("\n\n")[0].split())
        for node, device in bus.nodes.items():
            if not fault.profiles or device.profile in fault.profiles:
                rows.append({"name": name, "node": node, "title": name.replace("_", " "), "text": text, "on": False})
    return rows


def checked_hidden(asked: Any) -> dict[str, dict[str, float]]:
    """Effects and their parameters as a page gives them.

    :raises WorkbenchError: no mapping of names to mappings of names to numbers.
    """
    found: dict[str, dict[str, float]] = {}
    for name, values in asked.items() if isinstance(asked, dict) else ():
        if not (str(name).isidentifier() and isinstance(values, dict) and all(map(_is_setting, values.items()))):
            raise WorkbenchError(f"hidden is {asked!r}; it must be {{effect: {{parameter: number}}}}", "hidden")
        found[name] = {key: float(value) for key, value in values.items()}
    if asked and not found:
        raise WorkbenchError(f"hidden is {asked!r}; it must be {{effect: {{parameter: number}}}}", "hidden")
    return found


def _is_setting(pair: tuple[Any, Any]) -> bool:
    name, value = pair
    return str(name).isidentifier() and isinstance(value, int | float) and not isinstance(value, bool)
