"""Strangers among running nodes: plant, controller and recorder under random messages, bytes, calls and parameters."""

from __future__ import annotations

import math
import random
import time
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from hydraulic_interfaces.contract import DRIVE_LIMIT_V, PISTON, SERVOVALVE, find_topic, service, topic
from hydraulic_interfaces.conversions import interface_class
from hydraulic_interfaces.qos import profile

from . import must
from .running import Observer, Process
from .values import anything, joints, number, text

MESSAGES = 20_000
CALLS = 60
_NAMES = {
    "plant": ("watchdog", "rate", "model", "position_noise", "model.moving_mass", "extra_effects", "impact_speed", "x"),
    "controller": ("kp", "ki", "controller", "gains", "age_limit", "use_sim_time", "x"),
    "recorder": ("output", "max_duration", "x"),
}


class _Strangers:
    def __init__(self, rng: random.Random, observer: Observer) -> None:
        self._rng, self._observer = rng, observer
        node = observer.node
        self._streams = {
            name: node.create_publisher(interface_class(find_topic(name).type), topic(name), profile(name))
            for name in ("command", "reference", "experiment")
        }
        self._streams["status"] = node.create_publisher(String, "recorder/status", profile("latched"))

    def publish(self) -> None:
        rng, now = self._rng, time.time_ns()
        name = rng.choice(("command", "command", "command", "reference", "experiment", "status"))
        publisher = self._streams[name]
        if rng.random() < 0.03:
            publisher.publish(b"\0\1\0\0" + rng.randbytes(rng.randrange(200)))
        elif name == "command":
            source = rng.choice(("stranger", "stranger", "controller"))
            publisher.publish(joints(rng, now, source, [SERVOVALVE], {"effort": [number(rng, 8.0)]}, 0.1))
        elif name == "reference":
            fields = {"position": [number(rng, 0.3)], "velocity": [number(rng)]}
            publisher.publish(joints(rng, now, "stranger", [PISTON], fields, 0.1))
        else:
            publisher.publish(
                String(data=rng.choice((text(rng), repr(anything(rng)), '{"output": "x"}')).replace("\0", ""))
            )

    def call(self) -> None:
        rng, call = self._rng, self._observer.call
        kind = rng.randrange(5)
        if kind < 2:
            call(SetBool, service("enable"), data=rng.random() < 0.8)
        elif kind == 2:
            call(Trigger, service(rng.choice(("reset", "emergency_stop"))))
        else:
            node = rng.choice(list(_NAMES))
            value = _value(rng)
            parameters = [Parameter(name=rng.choice(_NAMES[node]), value=value) for _ in range(rng.choice((1, 1, 3)))]
            call(SetParametersAtomically, f"/actuator/{node}/set_parameters_atomically", parameters=parameters)


def _value(rng: random.Random) -> ParameterValue:
    kinds: dict[str, tuple[int, Any]] = {
        "bool_value": (ParameterType.PARAMETER_BOOL, rng.random() < 0.5),
        "integer_value": (ParameterType.PARAMETER_INTEGER, rng.choice((0, -1, 2**63 - 1, rng.randrange(1000)))),
        "double_value": (ParameterType.PARAMETER_DOUBLE, number(rng)),
        "string_value": (ParameterType.PARAMETER_STRING, text(rng).replace("\0", "")),
        "double_array_value": (ParameterType.PARAMETER_DOUBLE_ARRAY, [number(rng)]),
    }
    field, (kind, value) = rng.choice(list(kinds.items()))
    return ParameterValue(type=kind, **{field: value})


def graph(rng: random.Random, folder: Path) -> int:
    """One bench: drives finite and within the limit, 0 V after the stop, all alive, an orderly end, no traceback."""
    for log in folder.glob("*.log"):
        log.unlink()
    bag = folder / f"bag{rng.randrange(10**9)}"
    processes = [
        Process("plant", folder, "hydraulic_sim.nodes.simulator", options=("--autostart",)),
        Process("recorder", folder, "hydraulic_sysid.nodes.recorder", f"output:={bag}"),
        Process("controller", folder, "hydraulic_control.nodes.controller", "autostart:=true", "gains:=npid"),
    ]
    observer = Observer()
    try:
        observer.wait(lambda: observer.plant_state(120.0) == "active", "an active plant", 120.0)
        strangers = _Strangers(rng, observer)
        for count in range(MESSAGES):
            strangers.publish()
            if count % 50 == 0:
                time.sleep(0.01)
            if count % (MESSAGES // CALLS) == 0:
                strangers.call()
        observer.call(SetBool, service("enable"), data=True)
        observer.call(Trigger, service("emergency_stop"))
        stopped = time.time_ns() + 20_000_000
        observer.wait(lambda: len(observer.since(stopped)) > 100, "states after the stop")
        drives = [drive for _, _, drive, _ in list(observer.samples)]
        must(all(math.isfinite(d) and abs(d) <= DRIVE_LIMIT_V for d in drives), "a drive beyond the limit")
        must(not any(drive for _, _, drive, _ in observer.since(stopped)), "a drive after the emergency stop")
    finally:
        observer.close()
        alive = {process.name: process.runs for process in processes}
        codes = {process.name: process.end(60.0) for process in processes}
    must(all(alive.values()), f"ended before it was told to: {[name for name, runs in alive.items() if not runs]}")
    must(not any(codes.values()), f"exit codes {codes}")
    for process in processes:
        must("Traceback" not in process.said, f"the {process.name} printed a traceback:\n{process.said[-3000:]}")
    return MESSAGES + CALLS
