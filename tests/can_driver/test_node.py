"""The driver's node as a process over virtual devices: what it leaves behind, and faults as its users see them."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PLANT = Path(__file__).parents[1] / "contract" / "can_plant.py"
NODE = "hydraulic_can_driver.nodes.can_driver"


@pytest.fixture
def driving(launch: Any, client: Any, wait_until: Any, compiled_physics: None) -> Callable[[], tuple[Any, list[Any]]]:
    """Starts node and devices, and drives with 0.5 V."""

    def start() -> tuple[Any, list[Any]]:
        process = launch(PLANT, "--autostart", "--ros-args", "-p", "watchdog:=2.0")
        states = client.collect("state")
        wait_until(lambda: client.state() == "active", "an active plant")
        assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
        client.source("hand", 0.5)
        wait_until(lambda: states and states[-1].effort[1] > 0.4, "the commanded drive")
        return process, states

    return start


def trigger(client: Any, name: str) -> Any:
    return client.call("std_srvs/srv/Trigger", f"/actuator/{name}")


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_a_signal_leaves_the_valve_at_zero_and_off(driving: Callable[..., Any], number: str) -> None:
    process, _ = driving()
    process.interrupt(getattr(signal, number))
    assert process.wait() == 0, process.output()
    assert "left behind: init, 0 V" in process.output()
    assert "Traceback" not in process.output()


def test_transitions_and_services_move_the_valve(driving: Callable[..., Any], client: Any, wait_until: Any) -> None:
    process, states = driving()
    steps = ["disabled", "hold", "active"]
    assert [line for line in process.output().splitlines() if "valve: " in line] == [f"valve: {s}" for s in steps]
    told = client.collect("description", depth=1)
    wait_until(lambda: told, "what the plant is")
    assert json.loads(told[-1].data)["devices"]["valve"]["settings"]
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=False).success
    assert process.output().rstrip().endswith("valve: disabled")
    assert trigger(client, "emergency_stop").success
    assert trigger(client, "reset").success
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    assert process.output().rstrip().endswith("valve: active")
    assert trigger(client, "emergency_stop").success
    assert process.output().rstrip().endswith("valve: disabled")
    assert client.change_state("deactivate")
    assert process.output().rstrip().endswith("valve: init")
    assert states[-1].effort[1] == 0.0


def test_a_fault_is_told_latched_and_reset(driving: Callable[..., Any], client: Any, wait_until: Any) -> None:
    process, states = driving()
    health = client.diagnostics()
    process.interrupt(signal.SIGUSR1)
    wait_until(lambda: "EMCY 0x3412" in health["fault"], "the fault in the diagnostics")
    wait_until(lambda: states[-1].effort[1] == 0.0, "0 V")
    assert health["plant level"] == "2" and "EMCY 0x3412" in health["emergencies"]
    refusal = client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True)
    assert not refusal.success and "0x3412" in refusal.message
    process.interrupt(signal.SIGUSR2)
    wait_until(lambda: "no error" in health["emergencies"], "the end of its cause")
    wait_until(lambda: trigger(client, "reset").success, "a reset that is accepted")
    at_reset = len(states)
    wait_until(lambda: len(states) > at_reset + 50, "states after the reset")
    assert {state.effort[1] for state in states[at_reset:]} == {0.0}
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    wait_until(lambda: states[-1].effort[1] > 0.4, "the drive after reset and enable")


def test_nobody_on_the_bus(launch: Any, client: Any) -> None:
    process = launch(NODE, "--ros-args", "-p", "interface:=virtual", "-p", "channel:=nobody")
    assert not client.change_state("configure")
    assert client.state() == "unconfigured"
    process.says("cannot configure: valve (node 0x10): 0x1000:0 cannot be read: no answer")


def test_no_such_bus_file(launch: Any, client: Any) -> None:
    process = launch(NODE, "--ros-args", "-p", "bus:=no_such.yaml")
    assert not client.change_state("configure")
    process.says("no_such.yaml: cannot be read")
