"""The contract's topics on the side of the plant, as its loop uses them: no executor in between."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import islice
from typing import Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, String

from hydraulic_interfaces.contract import RECORDER_NODE, find_topic
from hydraulic_interfaces.conversions import (
    ClockEncoder,
    MessageError,
    PressureEncoder,
    StateEncoder,
    command_from_message,
    interface_class,
)
from hydraulic_interfaces.qos import STREAM_DEPTH, STREAM_HISTORY, profile
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.nodes.mailbox import Mailbox
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.recorders import Recorders


class PlantPorts:
    """Publishers of a plant and its command subscription, all in the namespace of `node`; `state` once it is opened."""

    def __init__(self, node: Node) -> None:
        self._state: Any = None
        self._pressures = tuple(self._publisher(node, f"pressure_{name}") for name in ("a", "b", "supply"))
        self._retracted = self._publisher(node, "limit_retracted")
        self._extended = self._publisher(node, "limit_extended")
        self._description = self._publisher(node, "description")
        self._limits: tuple[bool, bool] | None = None
        self._clock: Any = None
        self._status: Any = None
        self._recorders = Recorders()
        self._node = node
        self._encode_state = StateEncoder()
        self._encode_pressure = PressureEncoder()
        self._encode_clock = ClockEncoder()
        kind = interface_class(find_topic("command").type)
        self._commands = Mailbox(node, kind, "command", profile("command"))

    def take_commands(self, gate: CommandGate, now_ns: int) -> None:
        """Put every waiting command through the gate."""
        # A source that floods the topic must not hold up the plant's cycle.
        for message, info in islice(self._commands.take_with_info(), STREAM_DEPTH):
            try:
                command = command_from_message(message)
            except MessageError as error:
                gate.reject(str(error))
            else:
                alone = self._commands.publishers <= 1
                gate.accept(command, now_ns, info["publication_sequence_number"], alone)

    def wait_for_command(self, seconds: float) -> None:
        """Return when a command waits, or after that time."""
        self._commands.wait(seconds)

    def commanders(self) -> int:
        """How many publishers of commands there are."""
        return self._commands.publishers

    def recorded_ns(self) -> int | None:
        """Stamp up to which every recorder that records has the samples; None where there is none."""
        if self._status is None or not self._status.get_publisher_count():
            self._recorders.forget()
        return self._recorders.recorded_ns()

    def open_state(self) -> None:
        """Become the plant of this namespace: whoever publishes `state` is."""
        if self._state is None:
            self._state = self._publisher(self._node, "state")

    def follow_recorders(self) -> None:
        """Hear from now on how far recorders are."""
        if self._status is None:
            name = f"{RECORDER_NODE}/status"  # of the recorder beside it
            self._status = self._node.create_subscription(String, name, self._on_status, profile("latched"))

    def discard_commands(self) -> None:
        """Forget what came while nobody listened, and what the limit switches last said."""
        for _ in self._commands.take():
            pass
        self._limits = None

    def publish(self, sample: PlantSample) -> None:
        """Send the sample: state and pressures always, the limit switches when they change."""
        stamp = sample.stamp_ns
        self._state.publish(self._encode_state(sample))
        values = (sample.pressure_a, sample.pressure_b, sample.pressure_supply)
        for publisher, value in zip(self._pressures, values, strict=True):
            publisher.publish(self._encode_pressure(stamp, value))
        limits = (sample.limit_retracted, sample.limit_extended)
        if limits != self._limits:
            self._limits = limits
            self._retracted.publish(Bool(data=limits[0]))
            self._extended.publish(Bool(data=limits[1]))

    def describe(self, plant: Mapping[str, Any]) -> None:
        """Tell everybody, also who comes later, what the plant is."""
        self._description.publish(String(data=json.dumps(plant)))

    def open_clock(self) -> None:
        """Become the source of time for every node on simulated time."""
        if self._clock is None:
            self._clock = self._node.create_publisher(Clock, "/clock", profile("stream", depth=10))

    def publish_clock(self, stamp_ns: int) -> None:
        """Send the time."""
        if self._clock is not None:
            self._clock.publish(self._encode_clock(stamp_ns))

    def _on_status(self, message: String) -> None:
        self._recorders.hear(message.data)

    @staticmethod
    def _publisher(node: Node, name: str) -> Any:
        row = find_topic(name)
        depth = STREAM_HISTORY if row.qos == "stream" else None
        return node.create_publisher(interface_class(row.type), name, profile(name, depth))
