"""The topic contract of the bench: names, types, QoS and units, as tables.

A simulated actuator and a real one serve exactly these topics and services under the same node name, so that
every other node works with either. The tables are the only place where a name is written down.
"""

from __future__ import annotations

from dataclasses import dataclass

NAMESPACE = "/actuator"
"""Of a node that is not told otherwise (`-r __ns:=/left`): each actuator of a graph has a namespace of its own."""
PLANT_NODE = "plant"
EXCITATION_NODE = "excitation"
RECORDER_NODE = "recorder"
CONTROLLER_NODE = "controller"
REFERENCE_NODE = "reference"
RELAY_NODE = "relay"
ESTIMATOR_NODE = "estimator"
CONDITION_MONITOR_NODE = "condition_monitor"

PISTON = "piston"
SERVOVALVE = "servovalve"
PLANT_FRAME = "plant"
"""`header.frame_id` of everything the plant publishes; in a command it names the source instead."""

DRIVE_LIMIT_V = 10.0
WATCHDOG_S = 0.05
RATE_HZ = 1000.0

STARTED, FINISHED, ABORTED = "started", "finished", "aborted"
"""What `event` says in the JSON on the topic `experiment`: a run began, was played to its end, was broken off."""


@dataclass(frozen=True)
class Topic:
    """One topic; its name is relative to the namespace of the node unless it starts with "/"."""

    name: str
    type: str
    qos: str
    publisher: str
    content: str


@dataclass(frozen=True)
class Service:
    """One service of the plant node: name (relative to its namespace), type and what it does."""

    name: str
    type: str
    content: str


_JOINTS = "sensor_msgs/msg/JointState"
_PRESSURE = "sensor_msgs/msg/FluidPressure"

TOPICS: tuple[Topic, ...] = (
    Topic("command", _JOINTS, "stream", "source", "name [servovalve], effort [V]; frame_id names the source"),
    Topic(
        "state",
        _JOINTS,
        "stream",
        "plant",
        "name [piston, servovalve], position [m, m or NaN], velocity [m/s, NaN], "
        "effort [N from the pressures, V applied from this instant on]",
    ),
    Topic("pressure_a", _PRESSURE, "stream", "plant", "Pa, stamp of the state"),
    Topic("pressure_b", _PRESSURE, "stream", "plant", "Pa, stamp of the state"),
    Topic("pressure_supply", _PRESSURE, "stream", "plant", "Pa, stamp of the state; NaN without a transducer"),
    Topic("limit_retracted", "std_msgs/msg/Bool", "latched", "plant", "limit switch at the retracted end"),
    Topic("limit_extended", "std_msgs/msg/Bool", "latched", "plant", "limit switch at the extended end"),
    Topic("reference", _JOINTS, "stream", "reference", "name [piston], position [m], velocity [m/s]"),
    Topic("predicted_state", _JOINTS, "stream", "estimator", "as state, from the model on the applied drive"),
    Topic("residual", _JOINTS, "stream", "estimator", "measured minus predicted, as state"),
    Topic("model_parameters", _JOINTS, "stream", "estimator", "name [a1 … b1 … c], position values, velocity ±"),
    Topic("model_poles", _JOINTS, "stream", "estimator", "name [pole1 …], position Re z, velocity Im z, effort [Hz]"),
    Topic("model_fit", _JOINTS, "stream", "estimator", "name [one_step], position predicted, velocity error, effort %"),
    Topic("description", "std_msgs/msg/String", "latched", "plant", "JSON: what the plant is and how it is set"),
    Topic("experiment", "std_msgs/msg/String", "latched", "excitation", "JSON: started, finished or aborted run"),
    Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "diagnostics", "every node", "health"),
)

SERVICES: tuple[Service, ...] = (
    Service("enable", "std_srvs/srv/SetBool", "true: commands move the actuator; false: 0 V"),
    Service("emergency_stop", "std_srvs/srv/Trigger", "0 V at once, latched until reset; works in every state"),
    Service("reset", "std_srvs/srv/Trigger", "releases the latched stop; the actuator stays disabled until enable"),
)

_TOPICS = {entry.name.removeprefix("/"): entry for entry in TOPICS}
_SERVICES = {entry.name: entry for entry in SERVICES}


def absolute(name: str, namespace: str = NAMESPACE) -> str:
    """Full name of a topic, service or node that is written relative to a namespace."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def find_topic(name: str) -> Topic:
    """Table row of a topic by its short name ("state", "diagnostics"); KeyError names what there is."""
    try:
        return _TOPICS[name.removeprefix("/").removeprefix(f"{NAMESPACE[1:]}/")]
    except KeyError:
        raise KeyError(f"topic {name!r} is not in the contract; there are {', '.join(_TOPICS)}") from None


def topic(name: str, namespace: str = NAMESPACE) -> str:
    """Full name of a topic of the contract: `topic("state")` is "/actuator/state"."""
    return absolute(find_topic(name).name, namespace)


def service(name: str) -> str:
    """Full name of a service of the contract: `service("enable")` is "/actuator/enable"."""
    if name not in _SERVICES:
        raise KeyError(f"service {name!r} is not in the contract; there are {', '.join(_SERVICES)}")
    return absolute(name)
