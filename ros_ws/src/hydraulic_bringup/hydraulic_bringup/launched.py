"""What `bench.launch.py` starts for which arguments, without ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hydraulic_control.parameters import CONTROLLERS
from hydraulic_interfaces.contract import (
    CONTROLLER_NODE,
    ESTIMATOR_NODE,
    EXCITATION_NODE,
    NAMESPACE,
    PLANT_NODE,
    RECORDER_NODE,
    REFERENCE_NODE,
)
from hydraulic_interfaces.errors import HydraulicError

PLANTS = {"sim": ("hydraulic_sim", "simulator"), "can": ("hydraulic_can_driver", "can_driver")}
CONFIGURATIONS = {"sim": "bench.yaml", "can": "can.yaml"}
"""Parameter files in the folder config of this package."""

ARGUMENTS = (
    ("plant", "sim", "what serves the topics: sim (simulated actuator) or can (CAN driver)"),
    ("namespace", NAMESPACE, "of all nodes; each actuator in a graph has its own"),
    ("model", "moog_mcr_m_1002_bench", "model file or preset of the simulated actuator"),
    ("bus", "bench", "bus file, or a shipped one, of the CAN driver"),
    ("interface", "", "python-can interface of the CAN driver; empty: that of the bus file"),
    ("channel", "", "channel of that interface, such as can0; empty: that of the bus file"),
    ("params", "", "parameter file (default: config/bench.yaml or config/can.yaml of this package)"),
    ("enable", "false", "let commands through as soon as the plant is active; refused by a plant on hardware"),
    ("record", "", "folder of a new bag; empty: nothing is recorded"),
    ("experiment", "", "excitation plan (file or shipped name) to play; empty: none"),
    ("controller", "", "law that closes the loop: npid, pid or pole_placement; empty: none"),
    ("gains", "", "parameter file of the controller; empty: the shipped one of its law"),
    ("reference", "", "trajectory to play: step, staircase, sine, …; empty: none"),
    ("estimate", "false", "run the estimator beside the plant, with the same model"),
)
"""Name, default and description of the arguments of the launch file."""

_TRUE = ("true", "1", "yes")
_FALSE = ("false", "0", "no")


class ArgumentError(HydraulicError):
    """An argument of the launch file that is not allowed, alone or beside the others."""


@dataclass(frozen=True)
class Started:
    """A node to be started: executable of a package, node name, parameters."""

    package: str
    executable: str
    name: str
    parameters: dict[str, Any] = field(default_factory=dict)


def namespace(values: Mapping[str, str]) -> str:
    """Absolute namespace of all nodes; "left" is "/left"."""
    return "/" + values["namespace"].strip("/")


def remappings(values: Mapping[str, str]) -> list[tuple[str, str]]:
    """What is remapped in all nodes: an actuator in a namespace of its own has its own time there, too."""
    return [] if namespace(values) == NAMESPACE else [("/clock", "clock")]


def plant(values: Mapping[str, str]) -> Started:
    """The plant node.

    :raises ArgumentError: no such plant.
    """
    kind = values["plant"]
    if kind not in PLANTS:
        raise ArgumentError(f"plant:={kind}: allowed are {', '.join(PLANTS)}")
    own = ("model",) if kind == "sim" else ("bus", "interface", "channel")
    settings = {"enable_on_activate": _flag(values, "enable"), **{name: values[name] for name in own}}
    return Started(*PLANTS[kind], PLANT_NODE, settings)


def others(values: Mapping[str, str]) -> list[Started]:
    """The nodes beside the plant.

    :raises ArgumentError: arguments that do not go together, or no such controller.
    """
    found = []
    record, experiment = values["record"], values["experiment"]
    if record:
        settings: dict[str, Any] = {"output": record, "stop_on_experiment_end": bool(experiment)}
        found.append(Started("hydraulic_sysid", "recorder", RECORDER_NODE, settings))
    if _flag(values, "estimate"):
        found.append(Started("hydraulic_sysid", "estimator", ESTIMATOR_NODE, {"model": values["model"]}))
    if experiment:
        settings = {"plan": experiment, "autostart": True, "listeners": 2 if record else 1}
        found.append(Started("hydraulic_sysid", "excitation", EXCITATION_NODE, settings))
    return [*found, *_closed_loop(values)]


def _closed_loop(values: Mapping[str, str]) -> list[Started]:
    """The controller, and what it is to follow."""
    law, reference = values["controller"], values["reference"]
    if not law:
        if reference or values["gains"]:
            raise ArgumentError("reference and gains are for a controller: name one with controller:=")
        return []
    if law not in CONTROLLERS:
        raise ArgumentError(f"controller:={law}: allowed are {', '.join(CONTROLLERS)}")
    if values["experiment"]:
        raise ArgumentError("experiment and controller cannot both command the plant: give one of them")
    settings = {"gains": values["gains"] or law, "controller": law, "autostart": True}
    found = [Started("hydraulic_control", "controller", CONTROLLER_NODE, settings)]
    if reference:
        settings = {"kind": reference, "autostart": True}
        found.append(Started("hydraulic_control", "reference", REFERENCE_NODE, settings))
    return found


def _flag(values: Mapping[str, str], name: str) -> bool:
    text = values[name].lower()
    if text not in (*_TRUE, *_FALSE):
        raise ArgumentError(f"{name}:={values[name]}: allowed are true and false")
    return text in _TRUE
