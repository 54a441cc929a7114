"""Two actuators in one graph, each in a namespace of its own: one in emergency stop, the other moves."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.conversions import from_time, reference_to_message
from hydraulic_interfaces.samples import Reference
from hydraulic_sysid.data.records import read_records
from hydraulic_sysid.excitation import Plan, save_plan
from hydraulic_sysid.excitation.signals.chirp import Chirp

MODEL, RATE = "sample_bench", 100.0
ON_ONE_GRAPH = {"/diagnostics", "/parameter_events", "/rosout"}
NODES = {
    ("plant", "/left"),
    ("controller", "/left"),
    ("plant", "/right"),
    ("estimator", "/right"),
    ("recorder", "/right"),
    ("excitation", "/right"),
}


def at_rest(states: Sequence[Any]) -> bool:
    """A drive of 0 V, and the piston where it is to a micrometre."""
    return {s.effort[1] for s in states} == {0.0} and float(np.ptp([s.position[0] for s in states])) < 1e-6


def short_plan(file: Path) -> Path:
    timing = {"fade_in": 0.1, "fade_out": 0.1, "rest_before": 0.1, "rest_after": 0.1}
    save_plan(Plan("short", Chirp(3.0, 1.0, 5.0, 1.0), 0.5, centring_gain=0.0, rate=RATE, **timing), file)
    return file


def test_one_stands_stopped_beside_one_that_moves(
    launch: Any, client: Any, wait_until: Any, tmp_path: Path, compiled_physics: None
) -> None:
    def start(side: str, node: str, *flags: str, **parameters: object) -> Any:
        values = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        return launch(node, *flags, "--ros-args", "-r", f"__ns:=/{side}", "-r", "/clock:=clock", *values)

    def plant(side: str) -> None:
        values = {"model": MODEL, "lockstep": True, "rate": RATE, "watchdog": 0.5, "enable_on_activate": True}
        start(side, "hydraulic_sim.nodes.simulator", "--autostart", **values)

    states = {side: client.collect("state", namespace=f"/{side}") for side in ("left", "right")}
    reference = client.publisher("reference", "/left")
    plant("left"), plant("right")
    start("left", "hydraulic_control.nodes.controller", autostart=True, gains="npid", age_limit=1.0, use_sim_time=True)
    start("right", "hydraulic_sysid.nodes.estimator", model=MODEL)
    recorder = start("right", "hydraulic_sysid.nodes.recorder", output=tmp_path / "bag")
    predicted, events = (client.collect(name, namespace="/right") for name in ("predicted_state", "experiment"))

    def refer() -> None:  # somebody wants the left one to move all the time
        if states["left"]:
            stamp_ns = from_time(states["left"][-1].header.stamp)
            reference.publish(reference_to_message(Reference(stamp_ns, 0.05, 0.0)))

    client.node.create_timer(0.02, refer)
    client.wake()
    wait_until(lambda: states["left"] and abs(states["left"][-1].effort[1]) > 1.0, "motion on the left")
    assert client.call("std_srvs/srv/Trigger", "/left/emergency_stop").success

    plan = {"plan": short_plan(tmp_path / "plan.yaml"), "state_timeout": 10.0, "listeners": 2}
    excitation = start("right", "hydraulic_sysid.nodes.excitation", **plan)
    wait_until(lambda: set(client.node.get_node_names_and_namespaces()) >= NODES, "all nodes")
    wait_until(lambda: {"/left/clock", "/right/clock", "/right/recorder/status"} <= names(client.node), "their topics")
    assert {name for name in names(client.node) if name.split("/")[1] not in ("left", "right", "test")} == set()
    # A node is there before its topics: the estimator loads its model in between, for longer than a run in lockstep.
    heard = partial(client.node.get_subscriptions_info_by_topic, "/right/state")
    wait_until(lambda: {"estimator", "recorder"} <= {end.node_name for end in heard()}, "those that take the states")
    wait_until(lambda: at_rest(states["left"][-round(RATE) :]), "a second at rest on the left")
    stopped = len(states["left"])
    begin = partial(client.call, "std_srvs/srv/Trigger", "/right/excitation/start")
    wait_until(lambda: (said := begin().message).startswith("starting") or "a run is on" in said, "a run on the right")
    wait_until(lambda: events and json.loads(events[-1].data)["event"] != "started", "the end of the run")
    later = json.loads(events[-1].data)["stamp_ns"] + 200_000_000
    done = lambda: predicted and from_time(predicted[-1].header.stamp) > later  # noqa: E731
    wait_until(done, "what the estimator makes of the run")
    recorder.interrupt()
    assert recorder.wait() == 0, excitation.output() + recorder.output()

    (record,) = read_records(tmp_path / "bag")
    assert np.ptp(record["position"]) > 5e-3 and np.abs(record["drive"]).max() > 2.0
    assert {"/diagnostics"} == {name for name in recorded(tmp_path / "bag") if not name.startswith("/right/")}
    assert recorded(tmp_path / "bag")["/right/predicted_state"] > len(record)
    still = states["left"][stopped:]
    assert len(still) > 0.5 * len(record)
    # It creeps: the longer the test runs, the further. In every second it is at rest.
    second = round(RATE)
    assert all(at_rest(still[k : k + second]) for k in range(0, len(still), second))


def names(node: Any) -> set[str]:
    """Topics and services of the graph, without those that all nodes have in common."""
    found = [*node.get_topic_names_and_types(), *node.get_service_names_and_types()]
    return {name for name, _ in found} - ON_ONE_GRAPH


def recorded(bag: Path) -> dict[str, int]:
    """Number of messages by topic, as the bag's metadata says."""
    from rosbags.rosbag2 import Reader

    with Reader(bag) as reader:
        return {name: topic.msgcount for name, topic in reader.topics.items() if topic.msgcount}
