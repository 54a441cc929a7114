"""What a plant has to itself: its namespace, its clock and its hardware."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.plant_backend import BackendError

HARDWARE = f"can{os.getpid()}"  # of this process alone: other tests run at the same time
VALUES = {"watchdog": 0.05, "enable_on_activate": False}
OWN_CLOCK = ["--ros-args", "-r", "/clock:=clock"]


@pytest.fixture
def plant(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Enters as the plant of a namespace; raises what the guard says against it."""
    import rclpy

    from hydraulic_plant_node.nodes.plant_guard import PlantGuard

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    context, guards = rclpy.Context(), []
    rclpy.init(context=context)

    def enter(namespace: str, own_clock: bool = False, hardware: str = "", cli: list[str] | None = None) -> Any:
        node = rclpy.create_node("plant", namespace=namespace, context=context, cli_args=cli)
        backend: Any = SimpleNamespace(hardware=lambda values: hardware)
        guards.append(PlantGuard(node, CommandGate(), backend))
        guards[-1].enter(VALUES, own_clock)
        return guards[-1]

    yield enter
    for guard in guards:
        guard.leave()
    rclpy.shutdown(context=context)


def test_one_plant_per_namespace(plant: Callable[..., Any]) -> None:
    left = plant("/left")
    plant("/right")
    with pytest.raises(BackendError, match="another process is /left/plant in domain .* namespace of its own"):
        plant("/left")
    left.leave()
    plant("/left").enter(VALUES, own_clock=True)


def test_who_the_other_plant_is_may_come_to_be_known_later(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    import rclpy
    from rclpy.node import Node

    from hydraulic_plant_node.nodes.plant_guard import PlantGuard

    context, gate, names = rclpy.Context(), CommandGate(), ["plant", "_NODE_NAME_UNKNOWN_"]
    monkeypatch.setattr(Node, "count_publishers", lambda *_: len(names))
    monkeypatch.setattr(
        Node,
        "get_publishers_info_by_topic",
        lambda _, topic: [SimpleNamespace(node_namespace="/left", node_name=n) for n in names if topic == "state"],
    )
    rclpy.init(context=context)
    backend: Any = SimpleNamespace()
    guard = PlantGuard(rclpy.create_node("plant", namespace="/left", context=context), gate, backend)
    guard.serve()
    guard.watch()
    assert gate.stopped and not gate.enabled
    names[1] = "impostor"
    guard.watch()
    assert gate.stop_reason.startswith("another plant: /left/impostor publishes /left/state")
    gate.reset()
    gate.stop("emergency stop")
    guard.watch()
    assert gate.stop_reason == "emergency stop"
    rclpy.shutdown(context=context)


def test_two_plants_do_not_set_one_clock(plant: Callable[..., Any]) -> None:
    plant("/left", own_clock=True)
    with pytest.raises(BackendError, match=r"another plant publishes /clock in domain .* \(-r /clock:=clock\)"):
        plant("/right", own_clock=True)
    plant("/middle", own_clock=True, cli=OWN_CLOCK)


def test_two_plants_do_not_drive_one_actuator(plant: Callable[..., Any]) -> None:
    left = plant("/left", hardware=HARDWARE)
    left.serve()
    with pytest.raises(BackendError, match=f"another process drives the actuator on {HARDWARE}"):
        plant("/right", hardware=HARDWARE)
    left.leave()
    plant("/middle", hardware=HARDWARE)
    with pytest.raises(BackendError, match="another process is /left/plant"):
        plant("/left")
