"""The topic contract, asserted on every plant node alike: a plant is one row in `PLANTS`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hydraulic_interfaces.contract import SERVICES, TOPICS, absolute, topic
from hydraulic_interfaces.conversions import from_time
from hydraulic_interfaces.qos import profile

HERE = Path(__file__).parent

PLANTS: dict[str, tuple[str, ...]] = {
    "can": (str(HERE / "can_plant.py"),),
    "integrator": (str(HERE.parent / "plant_node" / "integrator_plant.py"),),
    "sim": ("hydraulic_sim.nodes.simulator",),
}
RATE = ("-p", "rate:=100.0")  # low, so that the collecting test process keeps up on a busy machine
# Long enough for a source in a loaded test process not to be taken for silent.
PATIENT = ("-p", "watchdog:=2.0")
PLANT = "/actuator/plant"


THOROUGH = "integrator"  # shares all but its few lines of physics with the others


@pytest.fixture(params=[pytest.param(p, marks=pytest.mark.thorough) if p == THOROUGH else p for p in sorted(PLANTS)])
def start(request: pytest.FixtureRequest, launch: Any, compiled_physics: None) -> Callable[..., Any]:
    """Starts the plant under test with further ROS arguments."""
    target, *arguments = PLANTS[request.param]

    def run(*ros: str, autostart: bool = True, lockstep: bool = False) -> Any:
        options = [name for name, on in (("--autostart", autostart), ("--lockstep", lockstep)) if on]
        return launch(target, *arguments, *options, "--ros-args", *RATE, *ros)

    return run


def enable(client: Any, on: bool = True) -> Any:
    return client.call("std_srvs/srv/SetBool", "/actuator/enable", data=on)


def trigger(client: Any, name: str) -> Any:
    return client.call("std_srvs/srv/Trigger", f"/actuator/{name}")


def enabled(client: Any, wait_until: Any) -> None:
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enable(client).success


def applied(states: list[Any]) -> float:
    """The drive in the newest state, in whole millivolts: a plant applies, and says, what its amplifier resolves."""
    return millivolts(states[-1]) if states else math.nan


def millivolts(state: Any) -> float:
    return round(float(state.effort[1]), 3)


def test_names_types_and_qos(start: Any, client: Any, wait_until: Any) -> None:
    start(autostart=False)
    assert client.change_state("configure"), "who publishes `state` is the plant, which it is once it is configured"
    for row in TOPICS:
        if row.publisher != "plant" and row.name != "command":
            continue
        look = client.node.get_publishers_info_by_topic
        if row.name == "command":
            look = client.node.get_subscriptions_info_by_topic
        infos = wait_until(partial(known, look, absolute(row.name)), f"the plant on {row.name}")
        assert len(infos) == 1
        assert (infos[0].node_namespace, infos[0].node_name) == ("/actuator", "plant")
        assert infos[0].topic_type == row.type
        qos = infos[0].qos_profile
        assert qos.reliability.name == "RELIABLE"
        assert qos.durability.name == ("TRANSIENT_LOCAL" if row.qos == "latched" else "VOLATILE")
    expected = {(absolute(row.name), (row.type,)) for row in SERVICES}

    def served() -> bool:
        found = client.node.get_service_names_and_types_by_node("plant", "/actuator")
        return expected <= {(name, tuple(types)) for name, types in found}

    wait_until(served, f"the services {expected}")


def known(look: Callable[[str], list[Any]], name: str) -> list[Any]:
    """End points of a topic; empty until the names of all their nodes have come as well."""
    infos = look(name)
    return infos if all("UNKNOWN" not in info.node_name for info in infos) else []


def test_lifecycle_round_trip(start: Any, client: Any, wait_until: Any) -> None:
    start(autostart=False)
    assert client.state() == "unconfigured"
    states = client.collect("state")
    assert not client.change_state("activate"), "an unconfigured node cannot be activated"
    assert client.state() == "unconfigured"
    for _ in range(2):
        assert client.change_state("configure")
        assert client.state() == "inactive"
        assert not enable(client).success, "an inactive plant must not be enabled"
        assert client.change_state("activate")
        before = len(states)
        wait_until(lambda n=before: len(states) > n + 50, "states of an active plant")
        assert client.change_state("deactivate")
        assert applied(states) == 0.0
        assert client.change_state("cleanup")
    assert client.state() == "unconfigured"
    stamps = [from_time(m.header.stamp) for m in states]
    assert all(b > a for a, b in zip(stamps, stamps[1:], strict=False)), "stamps increase over re-activation"


def shared_stamps(streams: dict[str, list[Any]], count: int) -> list[int]:
    """The first `count` successive stamps that all streams have alike; empty if there are none yet.

    A message may get lost on the way to a test process that is held up: then the count begins anew after it.
    """
    stamps = [[from_time(m.header.stamp) for m in list(heard)] for heard in streams.values()]
    if not all(stamps):
        return []
    first, last = max(times[0] for times in stamps), min(times[-1] for times in stamps)
    everywhere = set.intersection(*map(set, stamps))
    run: list[int] = []
    for stamp in sorted({t for times in stamps for t in times if first <= t <= last}):
        run = [*run, stamp] if stamp in everywhere else []
        if len(run) == count:
            break
    return run if len(run) == count else []


def test_samples_share_stamps_on_the_grid(start: Any, client: Any, wait_until: Any) -> None:
    streams = {name: client.collect(name) for name in ("state", "pressure_a", "pressure_b", "pressure_supply")}
    begun = client.node.get_clock().now().nanoseconds
    start()
    common = wait_until(
        partial(shared_stamps, streams, 100), "100 successive samples of which every topic has its part"
    )
    steps = {b - a for a, b in zip(common, common[1:], strict=False)}
    assert all(step > 0 and step % 1_000_000 == 0 for step in steps)
    newest = streams["state"][-1]
    assert begun < common[0] < from_time(newest.header.stamp) < client.node.get_clock().now().nanoseconds, "wall time"
    assert list(newest.name) == ["piston", "servovalve"]
    assert len(newest.position) == len(newest.velocity) == len(newest.effort) == 2
    assert math.isnan(newest.velocity[1])
    assert all(math.isfinite(x) for x in (newest.position[0], newest.velocity[0], *newest.effort))


def test_moves_only_when_enabled_and_stops_when_the_source_falls_silent(
    start: Any, client: Any, wait_until: Any
) -> None:
    start()
    states, health = client.collect("state"), client.diagnostics()
    source = client.source("hand", 0.5)
    wait_until(lambda: health.count("disabled") > 0, "commands refused because nothing is enabled")
    refused = len(states)
    wait_until(lambda: len(states) > refused + 20, "states after refused commands")
    assert set(map(millivolts, states)) == {0.0}
    enabled(client, wait_until)
    wait_until(lambda: applied(states) == 0.5, "the commanded drive")
    source.stop()
    wait_until(lambda: applied(states) == 0.0, "0 V after the watchdog time")
    wait_until(lambda: health.count("timeouts") > 0, "the watchdog in the diagnostics")
    source = client.source("hand", -0.5)
    wait_until(lambda: applied(states) == -0.5, "a drive re-armed by the next command")
    assert enable(client, False).success
    wait_until(lambda: applied(states) == 0.0, "0 V when disabled")


def test_in_lockstep_each_sample_has_the_drive_that_answers_the_one_before(
    start: Any, client: Any, wait_until: Any
) -> None:
    """However late the answers come: some are held up for longer than the watchdog tolerates in wall time."""
    from sensor_msgs.msg import JointState

    from hydraulic_interfaces.conversions import command_to_message
    from hydraulic_interfaces.samples import Command

    start("-p", "enable_on_activate:=true", lockstep=True)
    command, states = client.publisher("command"), []

    def drive(stamp_ns: int) -> float:
        return 0.01 * (stamp_ns // 1_000_000 % 100)

    def answer(state: JointState) -> None:
        states.append(state)
        if len(states) % 50 == 0:
            time.sleep(0.1)
        stamp_ns = from_time(state.header.stamp)
        command.publish(command_to_message(Command(stamp_ns, "far", drive(stamp_ns))))

    client.node.create_subscription(JointState, topic("state"), answer, profile("state", 10))
    client.wake()
    wait_until(lambda: any(map(millivolts, states[-50:])), "a command that is obeyed")
    first = len(states) + 20  # until plant and source are in step
    wait_until(lambda: len(states) > first + 200, "200 samples")
    found = states[first : first + 200]
    stamps = [from_time(state.header.stamp) for state in found]
    assert len({b - a for a, b in zip(stamps, stamps[1:], strict=False)}) == 1, "no sample is missing"
    applied = [state.effort[1] for state in found]
    assert applied[1:] == pytest.approx([drive(stamp) for stamp in stamps[:-1]], abs=1e-3)


def test_positive_drive_extends(start: Any, client: Any, wait_until: Any) -> None:
    start(*PATIENT)
    states = client.collect("state")
    enabled(client, wait_until)
    origin = wait_until(lambda: states and states[-1], "a state").position[0]
    client.source("hand", 1.0)
    state = wait_until(
        lambda: next((s for s in states[-200:] if s.position[0] > origin + 1e-4), None), "a piston that extends"
    )
    assert state.velocity[0] > 0.0


def test_out_of_range_is_clamped_and_nonsense_rejected(start: Any, client: Any, wait_until: Any) -> None:
    from sensor_msgs.msg import JointState

    start(*PATIENT)
    states, health = client.collect("state"), client.diagnostics()
    enabled(client, wait_until)
    source = client.source("hand", 0.25)
    wait_until(lambda: applied(states) == 0.25, "the commanded drive")
    source.drive = math.nan
    wait_until(lambda: health.count("not_finite") > 0, "NaN counted")
    source.drive = math.inf
    refused = health.count("not_finite")
    wait_until(lambda: health.count("not_finite") > refused, "infinity counted")
    source.drive, source.age = 9.0, 5.0
    wait_until(lambda: health.count("stale") > 0, "old commands counted")
    source.age = -5.0
    wait_until(lambda: health.count("future") > 0, "commands from the future counted")
    source.stop()
    nameless = client.source("", 9.0)
    wait_until(lambda: health.count("unnamed") > 0, "commands without a source counted")
    nameless.stop()
    strange = client.publisher("command")
    wait_until(
        lambda: strange.publish(JointState(name=["piston"], effort=[9.0])) or health.count("malformed") > 0,
        "wrongly named commands counted",
    )
    assert {millivolts(state) for state in states} <= {0.0, 0.25}
    client.source("hand", 25.0)
    wait_until(lambda: applied(states) == 10.0, "the limit")
    wait_until(lambda: health.count("clamped") > 0, "clamping in the diagnostics")


def test_one_source_at_a_time(start: Any, client: Any, wait_until: Any) -> None:
    start(*PATIENT)
    states, health = client.collect("state"), client.diagnostics()
    enabled(client, wait_until)
    first = client.source("first", 0.5)
    wait_until(lambda: applied(states) == 0.5, "the first source's drive")
    client.source("second", -0.5)
    wait_until(lambda: health.count("other_source") > 20, "a refused second source in the diagnostics")
    assert health["source"] == "first"
    assert -0.5 not in set(map(millivolts, states))
    first.stop()
    wait_until(lambda: applied(states) == -0.5, "the second source once the first is silent")


def test_emergency_stop_is_latched_until_reset_and_enable(start: Any, client: Any, wait_until: Any) -> None:
    start(*PATIENT)
    states, health = client.collect("state"), client.diagnostics()
    enabled(client, wait_until)
    client.source("hand", 0.5)
    wait_until(lambda: applied(states) == 0.5, "the commanded drive")
    assert trigger(client, "emergency_stop").success
    wait_until(lambda: applied(states) == 0.0, "0 V after the emergency stop")
    stopped = len(states)
    refusal = enable(client)
    assert not refusal.success and "reset" in refusal.message
    wait_until(lambda: health["emergency_stop"] == "True", "the stop in the diagnostics")
    assert health["plant level"] == "2"
    # Nor does it get lost by going round through the lifecycle.
    for transition in ("deactivate", "activate"):
        assert client.change_state(transition)
    assert not enable(client).success
    assert trigger(client, "reset").success
    at_reset = len(states)
    wait_until(lambda: len(states) > at_reset + 50, "states after the reset")
    assert {state.effort[1] for state in states[stopped:]} == {0.0}, "reset alone must not move anything"
    assert enable(client).success
    wait_until(lambda: applied(states) == 0.5, "the drive after reset and enable")


def test_emergency_stop_before_activation(start: Any, client: Any, wait_until: Any) -> None:
    start(autostart=False)
    assert trigger(client, "emergency_stop").success
    assert client.change_state("configure") and client.change_state("activate")
    assert not enable(client).success


def test_limit_switches_reach_late_subscribers(start: Any, client: Any, wait_until: Any) -> None:
    start()
    wait_until(lambda: client.state() == "active", "an active plant")
    switches = {name: client.collect(name, depth=1) for name in ("limit_retracted", "limit_extended")}
    for name, heard in switches.items():
        wait_until(lambda heard=heard: heard, f"the latched {name}")
        assert heard[-1].data is False


def test_parameters_are_described_and_guarded(start: Any, client: Any, wait_until: Any) -> None:
    from rcl_interfaces.msg import Parameter, ParameterValue

    start()
    wait_until(lambda: client.state() == "active", "an active plant")
    answer = client.call(
        "rcl_interfaces/srv/DescribeParameters", f"{PLANT}/describe_parameters", names=["rate", "watchdog"]
    )
    for row in answer.descriptors:
        assert row.description and row.floating_point_range[0].to_value > row.floating_point_range[0].from_value

    def put(name: str, value: float) -> Any:
        change = Parameter(name=name, value=ParameterValue(type=3, double_value=value))
        return client.call("rcl_interfaces/srv/SetParameters", f"{PLANT}/set_parameters", parameters=[change]).results[
            0
        ]

    for value in (1e9, math.nan):
        refused = put("watchdog", value)
        assert not refused.successful and "configured" not in refused.reason, "out of its range whatever the state"
    for name, value in (("watchdog", 0.2), ("rate", 500.0)):
        refused = put(name, value)
        assert not refused.successful and "configured" in refused.reason, "no protection is weakened while it runs"


def test_diagnostics_report_timing(start: Any, client: Any, wait_until: Any) -> None:
    health = client.diagnostics()
    start()
    wait_until(lambda: health.count("samples") > 50, "some samples")
    wait_until(lambda: float(health["rate_Hz"] or "nan") > 0.0, "a rate")
    values = health.values()
    assert float(values["rate_Hz"]) > 0.0 and float(values["run_jitter_p99_ms"]) >= 0.0
    assert {"overruns", "skipped", "age_s", "applied_drive_V", "source", "fault"} <= set(values)


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_signals_end_it_at_zero_volts(start: Any, client: Any, wait_until: Any, number: str) -> None:
    import signal

    process = start(*PATIENT)
    states = client.collect("state")
    enabled(client, wait_until)
    client.source("hand", 0.5)
    wait_until(lambda: applied(states) == 0.5, "the commanded drive")
    process.interrupt(getattr(signal, number))
    assert process.wait() == 0, process.output()
    assert "Traceback" not in process.output()
    wait_until(lambda: applied(states) == 0.0, "a last state at 0 V")
