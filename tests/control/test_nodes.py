"""Controller, reference and relay as processes on the simulated plant: the closed loop through topics."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_control.relay import RelaySettings, measure
from hydraulic_control.response import Response, step_figures
from hydraulic_control.simulation import QUIET, SimulatedPlant
from hydraulic_interfaces.conversions import from_time
from hydraulic_sim.model_file import load_model

MODEL = "moog_mcr_m_1002_bench"
CONTROLLER = "/actuator/controller"
# A loaded machine holds processes up: what is under test here is the loop, not the scheduler.
PATIENT = ("age_limit:=0.5",)


@pytest.fixture
def plant(launch: Any, compiled_physics: None) -> Callable[..., Any]:
    def start(*parameters: str) -> Any:
        given = [f"model:={MODEL}", "watchdog:=0.5", "enable_on_activate:=true", *parameters]
        return launch("hydraulic_sim.nodes.simulator", "--autostart", "--ros-args", *_options(given))

    return start


@pytest.fixture
def node(launch: Any) -> Callable[..., Any]:
    def start(name: str, *parameters: str) -> Any:
        return launch(f"hydraulic_control.nodes.{name}", "--ros-args", *_options(parameters))

    return start


def _options(parameters: Any) -> list[str]:
    return [word for parameter in parameters for word in ("-p", parameter)]


def set_parameter(client: Any, name: str, value: float | str, target: str = CONTROLLER) -> Any:
    from rcl_interfaces.msg import Parameter, ParameterValue

    content = {"type": 4, "string_value": value} if isinstance(value, str) else {"type": 3, "double_value": value}
    change = Parameter(name=name, value=ParameterValue(**content))
    return client.call("rcl_interfaces/srv/SetParameters", f"{target}/set_parameters", parameters=[change]).results[0]


def refer(client: Any, publisher: Any, position: float) -> None:
    from hydraulic_interfaces.conversions import reference_to_message
    from hydraulic_interfaces.samples import Reference

    now = client.node.get_clock().now().nanoseconds
    publisher.publish(reference_to_message(Reference(now, position, 0.0)))


def controller_says(heard: list[Any]) -> dict[str, str]:
    """The controller's newest row on the diagnostics."""
    for message in reversed(heard[-40:]):
        for status in message.status:
            if status.name == f"{CONTROLLER}: loop":
                return {"level": str(ord(status.level)), "message": status.message} | {
                    entry.key: entry.value for entry in status.values
                }
    return {}


def test_a_step_through_the_topics_is_that_in_one_process(
    plant: Any, node: Any, client: Any, tmp_path: Path, wait_until: Any
) -> None:
    from hydraulic_control import gains_file
    from hydraulic_control.controller import Controller
    from hydraulic_control.simulation import run, step_reference

    heard = client.collect("diagnostics")
    plant()
    node("controller", "autostart:=true", "gains:=npid", *PATIENT)
    wait_until(lambda: int(controller_says(heard).get("answered", 0)) > 100, "a controller that answers")
    output = tmp_path / "response.json"
    player = node("reference", "autostart:=true", "exit_when_done:=true", "dwell:=1.0", f"output:={output}")
    assert player.wait() == 0, player.output()
    response = Response.from_document(json.loads(output.read_text()))
    through_topics = step_figures(response)
    case = SimulatedPlant(load_model(MODEL), QUIET)
    in_process = step_figures(run(case, Controller(gains_file.load("npid")), step_reference(0.05, at=0.5), 1.5))
    assert through_topics.rise_time == pytest.approx(in_process.rise_time, rel=0.1)
    assert through_topics.overshoot == pytest.approx(in_process.overshoot, abs=0.5)
    assert through_topics.steady_state_error == pytest.approx(in_process.steady_state_error, abs=3e-5)
    assert np.abs(response.drive).max() <= 10.0
    stamps = np.diff(response.time)
    assert stamps == pytest.approx(1e-3, abs=1e-9), "one reference for every state"


def test_lifecycle_live_gains_and_stale_states(plant: Any, node: Any, client: Any, wait_until: Any) -> None:
    heard, commands = client.collect("diagnostics"), client.collect("command")
    reference = client.publisher("reference")
    plant()
    states = client.collect("state")
    process = node("controller", "gains:=npid", "age_limit:=0.2")
    wait_until(lambda: states, "states")
    assert client.state(CONTROLLER) == "unconfigured"
    refused = set_parameter(client, "kp", -5.0)
    assert not refused.successful and "kp" in refused.reason
    assert client.change_state("configure", CONTROLLER)
    assert not commands, "an inactive controller says nothing"
    assert client.change_state("activate", CONTROLLER)

    def stamps(messages: list[Any]) -> set[int]:
        return {from_time(m.header.stamp) for m in list(messages)}

    wait_until(lambda: len(stamps(states) & stamps(commands)) > 100, "commands with the stamps of their states")
    assert all(m.header.frame_id == "controller" for m in commands)
    wait_until(lambda: refer(client, reference, 0.03) or abs(states[-1].position[0] - 0.03) < 5e-4, "the goal")
    for name, value in (("kp", 150.0), ("controller", "pid"), ("ki", 0.0)):
        assert set_parameter(client, name, value).successful, name
    refused = set_parameter(client, "controller", "lqr")
    assert not refused.successful and "pole_placement" in refused.reason
    wait_until(lambda: controller_says(heard).get("controller") == "pid", "the law in the diagnostics")
    assert set_parameter(client, "age_limit", 0.001).successful
    assert client.change_state("deactivate")  # the plant's state falls silent
    wait_until(lambda: int(controller_says(heard).get("silent", 0)) > 0, "the silence in the diagnostics")
    wait_until(lambda: commands[-1].effort[0] == 0.0, "0 V")
    wait_until(lambda: controller_says(heard)["level"] == "2", "an error in the diagnostics")
    assert client.change_state("activate")
    assert set_parameter(client, "age_limit", 0.5).successful
    wait_until(lambda: controller_says(heard)["level"] == "0", "that it answers again")
    process.interrupt()
    assert process.wait() == 0
    assert commands[-1].effort[0] == 0.0


@pytest.mark.parametrize(
    "effects",
    ["{valve_deadband: {width: 0.02}}", "{supply_droop: {resistance: 2.0e9, time: 0.1}}"],
    ids=["deadband", "droop"],
)
def test_a_hidden_effect_in_mid_run_is_survived_and_shows_in_the_error(
    plant: Any, node: Any, client: Any, wait_until: Any, effects: str
) -> None:
    """A dead band makes the piston lag, drooping supply makes it slower; neither makes the loop unstable."""
    heard, states = client.collect("diagnostics"), client.collect("state", 100_000)
    health = client.diagnostics()
    references = client.collect("reference", 100_000)
    plant()
    node("controller", "autostart:=true", "gains:=npid", *PATIENT)
    node("reference", "autostart:=true", "kind:=sine", "amplitude:=0.05", "frequency:=0.5", "cycles:=60")

    def worst(count: int) -> float:
        """Of the newest states whose reference has come as well: a busy test may lose some of either."""
        wanted = {from_time(m.header.stamp): m.position[0] for m in list(references)}
        found = [m.position[0] - wanted[s] for m in list(states) if (s := from_time(m.header.stamp)) in wanted]
        return float(np.max(np.abs(found[-count:]))) if len(found) >= count else math.nan

    # Past the approach and the first cycle, in which the sine swells.
    wait_until(lambda: len(references) > 6000 and worst(2000) > 0.0, "a whole cycle of the sine")
    before = worst(2000)
    assert set_parameter(client, "extra_effects", effects, "/actuator/plant").successful
    wait_until(lambda: effects[1:9] in health["effects"], "the effect")
    mark, last = len(states), len(references)
    wait_until(lambda: min(len(states) - mark, len(references) - last) > 4000, "two more cycles")
    after = worst(2000)
    assert before < 0.012
    assert before < after < 0.03, "it shows, and does not run away"
    drives = np.array([m.effort[1] for m in states[-2000:]])
    assert np.all(np.isfinite(drives)) and np.abs(drives).max() <= 10.0
    assert np.mean(np.abs(np.diff(drives))) < 0.2, "no chatter"
    assert math.isfinite(float(controller_says(heard)["error_m"]))
    assert set_parameter(client, "extra_effects", "", "/actuator/plant").successful


def test_the_relay_experiment_through_the_topics(plant: Any, node: Any, client: Any, tmp_path: Path) -> None:
    plant()
    output = tmp_path / "relay.json"
    process = node("relay", f"output:={output}", "time_limit:=20.0")
    assert process.wait() == 0, process.output()
    found = json.loads(output.read_text())
    expected = measure(SimulatedPlant(load_model(MODEL), QUIET), RelaySettings())
    # A state that is answered late lengthens the cycle it falls into.
    assert found["critical_period"] == pytest.approx(expected.period, rel=0.2)
    assert found["critical_gain"] == pytest.approx(expected.gain, rel=0.4)


def test_the_relay_needs_a_plant_that_obeys_and_stays_within_its_travel(plant: Any, node: Any, client: Any) -> None:
    plant("enable_on_activate:=false")
    process = node("relay", "start_timeout:=3.0")
    assert process.wait() == 1
    assert "no plant obeyed" in process.output()
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    far = node("relay", "travel:=0.0001", "hysteresis:=0.001")
    assert far.wait() == 1
    assert "travelled" in far.output()


def test_bad_parameters_are_told_at_the_start(node: Any) -> None:
    for name, parameter, complaint in (
        ("reference", "amplitude:=0.9", "allowed are 0.6 m"),
        ("controller", "controller:=lqr", "pole_placement"),
        ("relay", "amplitude:=50.0", "amplitude"),
    ):
        process = node(name, parameter, *(["autostart:=true"] if name == "reference" else []))
        assert process.wait() == 2, process.output()
        assert complaint in process.output() and "Traceback" not in process.output()
