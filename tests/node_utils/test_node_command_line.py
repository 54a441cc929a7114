"""The command line of nodes: help, what is refused, and who may find them."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")

from hydraulic_node_utils.nodes import command_line  # noqa: E402
from hydraulic_node_utils.parameter_spec import ParameterSpec  # noqa: E402

WORKSPACE = Path(__file__).resolve().parents[2] / "ros_ws" / "src"
PARAMETERS = (ParameterSpec("gain", 2.5, "how much", "V/m"),)
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


@pytest.mark.parametrize("arguments", [["--wrong"], ["--ros-args", "-p", "foo"], ["--ros-args", "--wrong"]])
def test_bad_options_are_one_clear_line(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(RANGE, "LOCALHOST")
    with pytest.raises(SystemExit) as stopped:
        command_line.start(command_line.parser("A node.", PARAMETERS), arguments)
    assert stopped.value.code == 2
    usage, *complaint = capsys.readouterr().err.splitlines()
    assert usage.startswith("usage:") and len(complaint) == 1 and arguments[-1] in complaint[0]


def test_the_help_lists_the_parameters() -> None:
    assert "gain = 2.5 V/m: how much" in command_line.parser("A node.", PARAMETERS).format_help()


@pytest.mark.parametrize(("chosen", "used"), [(None, "LOCALHOST"), ("SUBNET", "SUBNET")])
def test_nodes_are_found_on_this_machine_only_by_default(
    chosen: str | None, used: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(RANGE, "before")  # so that it is restored in either case
    monkeypatch.delenv(RANGE) if chosen is None else monkeypatch.setenv(RANGE, chosen)
    seen: list[str | None] = []
    monkeypatch.setattr(rclpy, "init", lambda **_: seen.append(os.environ.get(RANGE)))
    monkeypatch.setattr(sys, "argv", ["node"])
    command_line.start(command_line.parser("A node.", PARAMETERS), None)
    assert seen == [used]


def test_every_executable_node_starts_this_way() -> None:
    """Nobody else calls rclpy.init, but what is more than a node: the client of a demo, the server of the workbench."""
    callers = {
        file.relative_to(WORKSPACE).as_posix()
        for package in WORKSPACE.iterdir()
        for file in (package / package.name).rglob("*.py")
        if "rclpy.init(" in file.read_text(encoding="utf-8")
    }
    assert callers == {
        "hydraulic_node_utils/hydraulic_node_utils/nodes/command_line.py",
        "hydraulic_bringup/hydraulic_bringup/nodes/_graph_client.py",
        "hydraulic_workbench/hydraulic_workbench/nodes/workbench.py",
        "hydraulic_bringup/hydraulic_bringup/entry/virtualenv.py",  # sees whether rclpy starts
    }
