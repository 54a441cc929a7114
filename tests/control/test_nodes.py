"""Controller, reference and relay as processes on the simulated plant: the closed loop through topics."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_control.controller import Controller
from hydraulic_control.relay import Relay, RelaySettings
from hydraulic_control.response import Response, step_figures
from hydraulic_control.simulation import QUIET, SimulatedPlant
from hydraulic_interfaces.conversions import from_time
from hydraulic_sim.model_file import load_model

MODEL = "moog_mcr_m_1002_bench"
CONTROLLER = "/actuator/controller"
# A loaded machine holds processes up. What is under test here is the loop, not the scheduler: the plant waits for the
# controller, and the controller for the reference.
IN_LOCKSTEP = ("lockstep:=true", "real_time_factor:=1.0")
HALF_RATE, HALF_RATE_DT = "rate:=500.0", 2e-3  # what two processes do at 1 kHz is much for a busy machine
BY_THE_WALL = ("lockstep:=false", "real_time_factor:=1.0", "rate:=250.0")  # at which the test keeps up, too
PATIENT = ("use_sim_time:=true", "age_limit:=0.5", "lockstep:=true")
PLAYS = ("use_sim_time:=true", "state_timeout:=10.0")


@pytest.fixture
def plant(launch: Any, compiled_physics: None) -> Callable[..., Any]:
    def start(*parameters: str) -> Any:
        given = [f"model:={MODEL}", "watchdog:=0.5", "enable_on_activate:=true", *IN_LOCKSTEP, *parameters]
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


def refer(client: Any, publisher: Any, position: float, stamp_ns: int | None = None) -> None:
    from hydraulic_interfaces.conversions import reference_to_message
    from hydraulic_interfaces.samples import Reference

    stamp = client.node.get_clock().now().nanoseconds if stamp_ns is None else stamp_ns
    publisher.publish(reference_to_message(Reference(stamp, position, 0.0)))


def controller_says(heard: list[Any]) -> dict[str, str]:
    """The controller's newest row on the diagnostics."""
    for message in reversed(heard[-40:]):
        for status in message.status:
            if status.name == f"{CONTROLLER}: loop":
                return {"level": str(ord(status.level)), "message": status.message} | {
                    entry.key: entry.value for entry in status.values
                }
    return {}


def plant_now(heard: list[Any]) -> int:
    """The plant's time by its newest diagnostics."""
    return max(from_time(m.header.stamp) for m in heard if any("/plant: " in s.name for s in m.status))


def test_a_step_through_the_topics_is_that_in_one_process(
    plant: Any, node: Any, client: Any, tmp_path: Path, wait_until: Any
) -> None:
    from hydraulic_control import gains_file
    from hydraulic_control.simulation import run, step_reference

    heard = client.collect("diagnostics")
    plant(HALF_RATE)
    node("controller", "autostart:=true", "gains:=npid", *PATIENT)
    wait_until(lambda: int(controller_says(heard).get("answered", 0)) > 100, "a controller that answers")
    output = tmp_path / "response.json"
    player = node("reference", "autostart:=true", "exit_when_done:=true", "dwell:=1.0", f"output:={output}", *PLAYS)
    assert player.wait() == 0, player.output()
    response = Response.from_document(json.loads(output.read_text()))
    through_topics = step_figures(response)
    case = SimulatedPlant(load_model(MODEL), QUIET)
    step = step_reference(0.05, at=0.5)
    in_process = step_figures(run(case, Controller(gains_file.load("npid")), step, 1.5, HALF_RATE_DT))
    assert through_topics.rise_time == pytest.approx(in_process.rise_time, rel=0.02)
    assert through_topics.overshoot == pytest.approx(in_process.overshoot, abs=0.1)
    assert through_topics.steady_state_error == pytest.approx(in_process.steady_state_error, abs=1e-5)
    assert np.abs(response.drive).max() <= 10.0
    assert np.diff(response.time) == pytest.approx(HALF_RATE_DT), "one reference for every state"

    states, reference = client.collect("state"), client.publisher("reference")
    wait_until(lambda: states and reference.get_subscription_count(), "states, and a controller that listens")
    assert client.call("std_srvs/srv/Trigger", "/actuator/emergency_stop").success
    wait_until(lambda: plant_now(heard) - 10**8 > from_time(states[0].header.stamp), "a while at 0 V")
    for stamp in (0, plant_now(heard) - 5 * 10**9):
        refer(client, reference, 0.3, stamp)
    wait_until(lambda: int(controller_says(heard).get("old_reference", 0)) == 2, "that both are refused")
    assert client.call("std_srvs/srv/Trigger", "/actuator/reset").success
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    begun, found = len(states), states[-1].position[0]
    wait_until(lambda: len(states) > begun + 250, "half a second enabled")
    assert max(abs(m.position[0] - found) for m in states[begun:]) < 1e-4, "nothing moves"


def test_lifecycle_live_gains_and_stale_states(plant: Any, node: Any, client: Any, wait_until: Any) -> None:
    Controller({"controller": "pid"})  # what was never compiled on this machine is refused while the loop runs
    heard, commands = client.collect("diagnostics"), client.collect("command")
    reference = client.publisher("reference")
    plant(*BY_THE_WALL)
    states = client.collect("state")
    process = node("controller", "gains:=npid", "age_limit:=0.5")
    wait_until(lambda: states, "states")
    assert client.state(CONTROLLER) == "unconfigured"
    refused = set_parameter(client, "kp", -5.0)
    assert not refused.successful and "kp" in refused.reason
    assert client.change_state("configure", CONTROLLER)
    assert not commands, "an inactive controller says nothing"
    assert client.change_state("activate", CONTROLLER)

    def stamps(messages: list[Any]) -> set[int]:
        return {from_time(m.header.stamp) for m in messages[-2000:]}

    wait_until(lambda: len(stamps(states) & stamps(commands)) > 100, "commands with the stamps of their states")
    assert all(m.header.frame_id == "controller" for m in commands)
    wait_until(lambda: refer(client, reference, 0.03) or abs(states[-1].position[0] - 0.03) < 5e-4, "the goal")
    for name, value in (("kp", 150.0), ("controller", "pid"), ("ki", 0.0)):
        assert set_parameter(client, name, value).successful, name
    refused = set_parameter(client, "controller", "lqr")
    assert not refused.successful and "pole_placement" in refused.reason
    wait_until(lambda: controller_says(heard).get("controller") == "pid", "the law in the diagnostics")
    # A limit that a busy machine keeps: where the last state before the silence is too old, the law rests already.
    assert set_parameter(client, "age_limit", 0.4).successful
    assert client.change_state("deactivate")  # the plant's state falls silent
    wait_until(lambda: int(controller_says(heard).get("silent", 0)) > 0, "the silence in the diagnostics")
    wait_until(lambda: commands[-1].effort[0] == 0.0, "0 V")
    wait_until(lambda: controller_says(heard).get("level") == "2", "an error in the diagnostics")
    assert client.change_state("activate")
    assert set_parameter(client, "age_limit", 0.5).successful
    wait_until(lambda: controller_says(heard).get("level") == "0", "that it answers again")
    process.interrupt()
    assert process.wait() == 0
    wait_until(lambda: commands[-1].effort[0] == 0.0, "a last command of 0 V")


@pytest.mark.parametrize(
    "effects",
    [
        pytest.param("{valve_deadband: {width: 0.02}}", marks=pytest.mark.thorough),
        pytest.param("{supply_droop: {resistance: 4.0e9, time: 0.1}}", marks=pytest.mark.thorough),
    ],
    ids=["deadband", "droop"],
)
def test_a_hidden_effect_in_mid_run_is_survived_and_shows_in_the_error(
    plant: Any, node: Any, client: Any, wait_until: Any, tmp_path: Path, effects: str
) -> None:
    """A dead band makes the piston lag, a drooping supply makes it slower; neither makes the loop unstable."""
    heard, health = client.collect("diagnostics"), client.diagnostics()

    def answered() -> int:
        return int(controller_says(heard).get("answered", 0))

    plant(HALF_RATE)
    node("controller", "autostart:=true", "gains:=npid", *PATIENT)
    wait_until(lambda: answered() > 100, "a controller that answers")
    output = tmp_path / "response.json"
    sine = ("kind:=sine", "amplitude:=0.03", "frequency:=1.0", "cycles:=5")
    player = node("reference", "autostart:=true", "exit_when_done:=true", f"output:={output}", *PLAYS, *sine)
    wait_until(lambda: controller_says(heard).get("reference_m") != "none", "a reference")
    refused = set_parameter(client, "output", str(tmp_path / "thesis.txt"), "/actuator/reference")
    assert not refused.successful and "output" in refused.reason
    begun = answered()
    wait_until(lambda: answered() > begun + 1000, "some of the sine")
    assert set_parameter(client, "extra_effects", effects, "/actuator/plant").successful
    switched_ns = plant_now(heard)
    wait_until(lambda: effects[1:9] in health["effects"], "the effect")
    assert player.wait() == 0, player.output()
    document = json.loads(output.read_text())
    response, switch = Response.from_document(document), 1e-9 * (switched_ns - document["start_ns"])
    error = np.abs(response.reference - response.position)
    assert 1.0 < switch < 4.5, "in the middle of the sine"
    before = error[(response.time > 0.5) & (response.time < switch - 0.6)]
    after = error[(response.time > switch) & (response.time < 6.5)]
    assert np.sqrt(np.mean(before**2)) < np.sqrt(np.mean(after**2)), "it shows in the error"
    assert after.max() < 0.02, "and does not run away"
    assert np.all(np.isfinite(response.drive)) and np.abs(response.drive).max() <= 10.0
    assert error[-1] < 2e-3, "it comes to rest"
    assert math.isfinite(float(controller_says(heard)["error_m"]))


def test_the_relay_experiment_through_the_topics(
    plant: Any, node: Any, client: Any, wait_until: Any, tmp_path: Path
) -> None:
    """What the node commands and finds is what the same relay does with the states that the node answered.

    How many samples pass before the plant obeys is left to the scheduler. Since a relay switches at whole samples, the
    oscillation that follows depends on it, so there is no other run to compare with.
    """
    states, commands = client.collect("state"), client.collect("command")
    plant("enable_on_activate:=false", "real_time_factor:=0.25")  # of a faster one a process held up misses states
    output, settings = tmp_path / "relay.json", RelaySettings()
    process = node("relay", f"output:={output}", "use_sim_time:=true", "state_timeout:=5.0")
    wait_until(lambda: states and commands, "states and commands: from here on all are heard")
    begun_ns = max(from_time(first.header.stamp) for first in (states[0], commands[-1]))  # the node may have heard more
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    assert process.wait() == 0, process.output()
    found = json.loads(output.read_text())
    wait_until(lambda: commands[-1].effort[0] == 0.0, "the last command, which is 0 V")
    ended_ns = from_time(commands[-1].header.stamp)
    wait_until(lambda: from_time(states[-1].header.stamp) > ended_ns, "a state after it")

    state_at = {from_time(message.header.stamp): message for message in list(states)}
    answered = [(from_time(message.header.stamp), message.effort[0]) for message in list(commands)]
    relay, last_ns, obeyed = Relay(settings), begun_ns, list[bool]()
    for stamp_ns, drive in (one for one in answered if one[0] > begun_ns):
        state = state_at[stamp_ns]
        if not obeyed and state.effort[1] != settings.amplitude:
            assert drive == settings.amplitude, "until the plant obeys"
        else:
            assert drive == relay.step(1e-9 * (stamp_ns - last_ns), state.position[0])
            if relay.done:
                break
            obeyed.append(state_at[stamp_ns + 1_000_000].effort[1] == drive)
        last_ns = stamp_ns
    assert relay.result is not None
    assert found["critical_period"] == pytest.approx(relay.result.period, rel=1e-9)
    assert found["critical_gain"] == pytest.approx(relay.result.gain, rel=1e-9)
    in_lockstep = obeyed[50:]
    assert len(in_lockstep) > 200 and all(in_lockstep), "each drive is applied at the next sample"


def test_the_relay_needs_an_obedient_plant_and_keeps_its_travel(plant: Any, node: Any, client: Any) -> None:
    plant("enable_on_activate:=false")
    process = node("relay", "start_timeout:=3.0")
    assert process.wait() == 1
    assert "no plant obeyed" in process.output()
    assert client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    far = node("relay", "travel:=0.0001", "hysteresis:=0.001", "state_timeout:=5.0")
    assert far.wait() == 1
    assert "travelled" in far.output()


def test_bad_parameters_are_told_at_the_start(node: Any, tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.txt"
    thesis.write_text("ten years of work")
    for name, parameter, complaint in (
        ("reference", "amplitude:=0.9", "allowed are 0.6 m"),
        ("controller", "controller:=lqr", "pole_placement"),
        ("relay", "amplitude:=50.0", "amplitude"),
        ("reference", f"output:={thesis}", "thesis.txt exists"),
    ):
        process = node(name, parameter, *(["autostart:=true"] if name == "reference" else []))
        assert process.wait() == 2, process.output()
        assert complaint in process.output() and "Traceback" not in process.output()
