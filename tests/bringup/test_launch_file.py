"""The launch file: what it starts for which arguments, and how that runs where ROS 2 launch is installed."""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import signal
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from hydraulic_bringup import launched
from hydraulic_bringup.demo import online
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_interfaces import contract
from hydraulic_sim.model_file import load_model

ROOT = Path(__file__).resolve().parents[2]
BRINGUP = ROOT / "ros_ws/src/hydraulic_bringup"
FILE = BRINGUP / "launch/bench.launch.py"
DEFAULTS = {name: value for name, value, _ in launched.ARGUMENTS}
EVERYTHING = [
    {"record": "/tmp/bag", "experiment": "chirp", "estimate": "true"},
    {"controller": "pid", "reference": "sine", "record": "/tmp/bag"},
    {"plant": "can", "controller": "npid", "gains": "my.yaml", "enable": "True"},
]
REFUSED = [
    ({"plant": "boat"}, "boat"),
    ({"controller": "lqr"}, "lqr"),
    ({"controller": "npid", "experiment": "chirp"}, "one of them"),
    ({"reference": "step"}, "controller:="),
    ({"enable": "maybe"}, "enable:=maybe: allowed are true and false"),
]


def test_arguments_are_described_and_have_defaults() -> None:
    assert all(isinstance(default, str) and text for _, default, text in launched.ARGUMENTS)
    assert DEFAULTS["enable"] == "false", "nothing moves without being asked for"
    assert DEFAULTS["namespace"] == contract.NAMESPACE
    load_model(DEFAULTS["model"])
    load_bus(DEFAULTS["bus"])


def test_both_plants_are_those_of_the_demo() -> None:
    plants = {name: f"{package}.nodes.{executable}" for name, (package, executable) in launched.PLANTS.items()}
    assert plants == online.PLANTS


def test_by_default_there_is_a_plant_alone() -> None:
    assert launched.plant(DEFAULTS) == launched.Started(
        "hydraulic_sim", "simulator", "plant", {"enable_on_activate": False, "model": DEFAULTS["model"]}
    )
    assert launched.others(DEFAULTS) == []


@pytest.mark.parametrize("chosen", EVERYTHING)
def test_what_is_started_exists_and_declares_what_it_is_given(chosen: dict[str, str]) -> None:
    pytest.importorskip("rclpy")
    from hydraulic_plant_node.nodes import plant_node

    values = DEFAULTS | chosen
    for node in (launched.plant(values), *launched.others(values)):
        module = importlib.import_module(f"{node.package}.nodes.{node.executable}")
        declared = {spec.name: spec for spec in (*plant_node.PARAMETERS, *module.PARAMETERS)}
        for name, value in node.parameters.items():
            assert type(value) is type(declared[name].default), f"{node.name}: {name}"
            declared[name].check(value)
    assert {node.name for node in launched.others(values)} <= {
        contract.RECORDER_NODE, contract.EXCITATION_NODE, contract.ESTIMATOR_NODE, contract.CONTROLLER_NODE,
        contract.REFERENCE_NODE,
    }  # fmt: skip


@pytest.mark.parametrize(("chosen", "complaint"), REFUSED)
def test_what_cannot_be_started_is_refused(chosen: dict[str, str], complaint: str) -> None:
    values = DEFAULTS | chosen
    with pytest.raises(launched.ArgumentError, match=complaint):
        launched.plant(values)
        launched.others(values)


def test_a_namespace_is_absolute_and_has_its_own_time() -> None:
    assert launched.namespace(DEFAULTS) == "/actuator" and launched.remappings(DEFAULTS) == []
    for given in ("left", "/left", "/left/"):
        values = DEFAULTS | {"namespace": given}
        assert launched.namespace(values) == "/left" and launched.remappings(values) == [("/clock", "clock")]


def test_the_laws_have_gains() -> None:
    from hydraulic_control import gains_file, parameters

    assert set(parameters.CONTROLLERS) <= set(gains_file.shipped())


@pytest.mark.parametrize("plant", ["sim", "can"])
def test_parameter_files_fit_their_nodes(plant: str) -> None:
    pytest.importorskip("rclpy")
    from hydraulic_can_driver.nodes import can_driver
    from hydraulic_plant_node.nodes import plant_node
    from hydraulic_sim.nodes import simulator

    own = {"sim": simulator.PARAMETERS, "can": can_driver.PARAMETERS}[plant]
    specs = {s.name: s for s in (*plant_node.PARAMETERS, *own)}
    file = yaml.safe_load((BRINGUP / "config" / launched.CONFIGURATIONS[plant]).read_text(encoding="utf-8"))
    assert list(file) == [f"/**/{contract.PLANT_NODE}"], "of a plant in any namespace"
    values = file[f"/**/{contract.PLANT_NODE}"]["ros__parameters"]
    assert set(values) <= set(specs)
    assert values["watchdog"] == contract.WATCHDOG_S
    for name, value in values.items():
        # ROS takes no integer for a parameter that is a float.
        assert type(value) is type(specs[name].default), name


def test_parameter_files_apply_in_every_namespace(ros_domain: int) -> None:
    rclpy = pytest.importorskip("rclpy")
    from hydraulic_control import gains_file
    from hydraulic_node_utils.nodes.rclpy_internals import given_at_start

    context = rclpy.Context()
    rclpy.init(context=context)
    for namespace in ("/actuator", "/left", "/hall_2/left"):
        for name, file, parameter in (
            ("plant", BRINGUP / "config/bench.yaml", "position_noise"),
            ("plant", BRINGUP / "config/can.yaml", "watchdog"),
            ("controller", gains_file.find("npid"), "kp"),
        ):
            options = ["--ros-args", "--params-file", str(file)]
            node = rclpy.create_node(name, namespace=namespace, context=context, cli_args=options)
            assert parameter in given_at_start(node), f"{namespace}/{name}: {file.name}"
    rclpy.shutdown(context=context)


def test_what_it_imports_is_declared() -> None:
    tree = ast.parse(FILE.read_text(encoding="utf-8"))
    manifest = (BRINGUP / "package.xml").read_text(encoding="utf-8")
    modules = {(n.module or "").split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert {"launch", "launch_ros", "lifecycle_msgs"} < modules
    for module in modules - {"hydraulic_bringup"}:
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


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The packages of this checkout as installed ones: their executables, and the parameter files."""
    for name in ("hydraulic_bringup", "hydraulic_sim", "hydraulic_sysid", "hydraulic_control", "hydraulic_can_driver"):
        marker = tmp_path / "prefix/share/ament_index/resource_index/packages" / name
        marker.parent.mkdir(parents=True, exist_ok=True)
        marker.touch()
        folder = tmp_path / "prefix/lib" / name
        folder.mkdir(parents=True)
        for module in (ROOT / "ros_ws/src" / name / name / "nodes").glob("[!_]*.py"):
            script = folder / module.stem
            script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {name}.nodes.{module.stem} "$@"\n')
            script.chmod(0o755)
    share = tmp_path / "prefix/share/hydraulic_bringup"
    share.mkdir()
    (share / "config").symlink_to(BRINGUP / "config")
    there = os.environ.get("AMENT_PREFIX_PATH", "")
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(filter(None, (str(tmp_path / "prefix"), there))))
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "ros_log"))


def test_it_declares_its_arguments(description: ModuleType) -> None:
    arguments = description.generate_launch_description().get_launch_arguments()
    assert [a.name for a in arguments] == list(DEFAULTS)


def test_a_refused_argument_ends_the_launch(description: ModuleType, launch: Any, prefix: None) -> None:
    process = launch(ROOT / "tests/bringup/run_launch_file.py", "plant:=boat")
    assert process.wait() != 0
    assert "plant:=boat: allowed are sim, can" in process.output()


def test_a_plant_that_dies_takes_the_others_with_it(
    description: ModuleType, launch: Any, prefix: None, client: Any, wait_until: Any, compiled_physics: None
) -> None:
    states = client.collect("state", namespace="/left")
    arguments = ("model:=sample_bench", "namespace:=left", "controller:=npid", "estimate:=true")
    process = launch(ROOT / "tests/bringup/run_launch_file.py", *arguments)
    wait_until(lambda: states, "a state of the plant")
    nodes = {("plant", "/left"), ("controller", "/left"), ("estimator", "/left")}
    wait_until(lambda: set(client.node.get_node_names_and_namespaces()) >= nodes, "all nodes")
    assert client.state("/left/plant") == "active"
    wait_until(lambda: client.state("/left/controller") == "active", "an active controller")
    started = dict(re.findall(r"\[(\w+)-\d+\]: process started with pid \[(\d+)\]", process.output()))
    assert set(started) == {"simulator", "controller", "estimator"}
    os.kill(int(started["simulator"]), signal.SIGKILL)
    process.wait()
    for pid in started.values():
        assert not Path("/proc", pid).exists()
