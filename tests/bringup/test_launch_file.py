"""The launch file: its arguments and tables as they are written, and the description where ROS 2 launch is there."""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from hydraulic_bringup.demo import online
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_interfaces import contract
from hydraulic_sim.model_file import load_model

ROOT = Path(__file__).resolve().parents[2]
BRINGUP = ROOT / "ros_ws/src/hydraulic_bringup"
FILE = BRINGUP / "launch/bench.launch.py"
TREE = ast.parse(FILE.read_text(encoding="utf-8"))


def constant(name: str) -> Any:
    """Value of a table at the top of the launch file."""
    (found,) = [n.value for n in TREE.body if isinstance(n, ast.Assign) and getattr(n.targets[0], "id", "") == name]
    return ast.literal_eval(found)


def calls(name: str) -> list[ast.Call]:
    """All calls of a function or class."""
    return [n for n in ast.walk(TREE) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == name]


def keyword(call: ast.Call, name: str) -> Any:
    """A keyword argument that is written as a constant; None if it is computed or absent."""
    values = [k.value for k in call.keywords if k.arg == name]
    return values[0].value if values and isinstance(values[0], ast.Constant) else None


def test_arguments_are_described_and_have_defaults() -> None:
    arguments = constant("ARGUMENTS")
    names = [name for name, _, _ in arguments]
    assert names == [
        "plant", "model", "bus", "interface", "channel", "params", "enable", "record", "experiment", "controller",
        "gains", "reference", "estimate",
    ]  # fmt: skip
    assert all(isinstance(default, str) and text for _, default, text in arguments)
    defaults = {name: default for name, default, _ in arguments}
    assert defaults["plant"] in constant("PLANTS")
    assert defaults["enable"] == "false"  # nothing moves without being asked for
    load_model(defaults["model"])
    load_bus(defaults["bus"])


def test_both_plants_are_those_of_the_demo() -> None:
    plants = {name: f"{package}.nodes.{executable}" for name, (package, executable) in constant("PLANTS").items()}
    assert plants == online.PLANTS


@pytest.mark.parametrize("plant", ["sim", "can"])
def test_the_plants_are_executables(plant: str) -> None:
    package, executable = constant("PLANTS")[plant]
    assert (ROOT / "ros_ws/src" / package / package / "nodes" / f"{executable}.py").is_file()


def test_nodes_have_the_names_of_the_contract() -> None:
    (plant,) = calls("LifecycleNode")
    assert keyword(plant, "name") == contract.PLANT_NODE
    assert keyword(plant, "namespace") == contract.NAMESPACE
    (other,) = calls("Node")
    assert keyword(other, "namespace") == contract.NAMESPACE
    started = [tuple(a.value for a in call.args[:2] if isinstance(a, ast.Constant)) for call in calls("_node")]
    assert {name for _, name in started} == {
        contract.RECORDER_NODE, contract.EXCITATION_NODE, contract.ESTIMATOR_NODE, contract.CONTROLLER_NODE,
        contract.REFERENCE_NODE,
    }  # fmt: skip
    for package, executable in started:
        assert (ROOT / package / package / "nodes" / f"{executable}.py").is_file()


def test_the_laws_are_those_of_the_controller() -> None:
    from hydraulic_control import gains_file, parameters

    assert constant("CONTROLLERS") == parameters.CONTROLLERS
    assert set(parameters.CONTROLLERS) <= set(gains_file.shipped())


def test_parameters_that_are_set_are_declared() -> None:
    pytest.importorskip("rclpy")
    from hydraulic_can_driver.nodes import can_driver
    from hydraulic_control.nodes import controller, reference
    from hydraulic_plant_node.nodes import plant_node
    from hydraulic_sim.nodes import simulator
    from hydraulic_sysid.nodes import estimator, excitation, recorder

    declared = {
        "plant": {s.name for s in (*plant_node.PARAMETERS, *simulator.PARAMETERS)},
        "can": {s.name for s in (*plant_node.PARAMETERS, *can_driver.PARAMETERS)},
        "recorder": {s.name for s in recorder.PARAMETERS},
        "excitation": {s.name for s in excitation.PARAMETERS},
        "controller": {s.name for s in controller.PARAMETERS},
        "reference": {s.name for s in reference.PARAMETERS},
        "estimator": {s.name for s in estimator.PARAMETERS},
    }
    keys = [
        {k.value for k in node.keys if isinstance(k, ast.Constant)}
        for node in ast.walk(TREE)
        if isinstance(node, ast.Dict) and node.lineno > TREE.body[-1].lineno - 90
    ]
    settings = [found for found in keys if found and not found & set(constant("PLANTS"))]
    assert len(settings) == 7
    for found in settings:
        assert any(found <= names for names in declared.values()), found


@pytest.mark.parametrize("plant", ["sim", "can"])
def test_parameter_files_fit_their_nodes(plant: str) -> None:
    pytest.importorskip("rclpy")
    from hydraulic_can_driver.nodes import can_driver
    from hydraulic_plant_node.nodes import plant_node
    from hydraulic_sim.nodes import simulator

    own = {"sim": simulator.PARAMETERS, "can": can_driver.PARAMETERS}[plant]
    specs = {s.name: s for s in (*plant_node.PARAMETERS, *own)}
    file = yaml.safe_load((BRINGUP / "config" / constant("CONFIGURATIONS")[plant]).read_text(encoding="utf-8"))
    assert list(file) == [f"/**/{contract.PLANT_NODE}"], "of a plant in any namespace"
    values = file[f"/**/{contract.PLANT_NODE}"]["ros__parameters"]
    assert set(values) <= set(specs)
    assert values["watchdog"] == contract.WATCHDOG_S
    for name, value in values.items():
        # ROS takes no integer for a parameter that is a float.
        assert type(value) is type(specs[name].default), name


def test_what_it_imports_is_declared() -> None:
    manifest = (BRINGUP / "package.xml").read_text(encoding="utf-8")
    modules = {(n.module or "").split(".")[0] for n in ast.walk(TREE) if isinstance(n, ast.ImportFrom)}
    assert modules == {"launch", "launch_ros", "lifecycle_msgs", "hydraulic_node_utils"}
    for module in modules:
        assert f"<exec_depend>{module}</exec_depend>" in manifest


@pytest.fixture
def description() -> ModuleType:
    """The launch file as a module, where ROS 2 launch is installed."""
    pytest.importorskip("launch")
    pytest.importorskip("launch_ros")
    spec = importlib.util.spec_from_file_location("bench_launch", FILE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_describes_its_arguments(description: ModuleType) -> None:
    arguments = description.generate_launch_description().get_launch_arguments()
    assert [a.name for a in arguments] == [name for name, _, _ in constant("ARGUMENTS")]


def nodes_of(description: ModuleType, chosen: dict[str, str]) -> list[Any]:
    """What is started for arguments that differ from their defaults."""
    from launch import LaunchContext

    context = LaunchContext()
    context.launch_configurations.update({name: value for name, value, _ in constant("ARGUMENTS")} | chosen)
    return list(description.generate_launch_description().entities[-1].execute(context))


@pytest.mark.parametrize(
    ("chosen", "nodes"),
    [
        ({}, ["simulator"]),
        ({"plant": "can"}, ["can_driver"]),
        ({"estimate": "true"}, ["simulator", "estimator"]),
        ({"record": "/tmp/bag", "experiment": "chirp"}, ["simulator", "recorder", "excitation"]),
        ({"controller": "npid"}, ["simulator", "controller"]),
        ({"controller": "pid", "reference": "sine"}, ["simulator", "controller", "reference"]),
    ],
)
def test_it_starts_what_is_asked_for(description: ModuleType, chosen: dict[str, str], nodes: list[str]) -> None:
    from launch_ros.actions import Node

    started = [action for action in nodes_of(description, chosen) if isinstance(action, Node)]
    assert [node.node_executable for node in started] == nodes


@pytest.mark.parametrize(
    ("chosen", "complaint"),
    [
        ({"plant": "boat"}, "boat"),
        ({"controller": "lqr"}, "lqr"),
        ({"controller": "npid", "experiment": "chirp"}, "one of them"),
        ({"reference": "step"}, "controller:="),
    ],
)
def test_what_cannot_be_started_is_refused(description: ModuleType, chosen: dict[str, str], complaint: str) -> None:
    with pytest.raises(RuntimeError, match=complaint):
        nodes_of(description, chosen)
