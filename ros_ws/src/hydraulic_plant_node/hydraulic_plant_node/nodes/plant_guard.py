"""Who talks to a plant and beside it: what is refused for that, and what the user hears of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclpy.node import Node

from hydraulic_plant_node.command_gate import CommandGate, Verdict
from hydraulic_plant_node.nodes.notices import Notices
from hydraulic_plant_node.plant_backend import BackendError, PlantBackend

HARDWARE_WATCHDOG_S = 0.2
"""Longest silence of a source that a real actuator may be driven through."""


class PlantGuard:
    """Watches over the surroundings of a plant node; `watch` is called often, from the thread that serves ROS."""

    def __init__(self, node: Node, gate: CommandGate, backend: PlantBackend) -> None:
        self._node, self._gate, self._backend = node, gate, backend
        self._notices = Notices(node.get_logger().warning)

    def admit(self, values: Mapping[str, Any]) -> None:
        """Whether the plant may be configured with these parameters.

        :raises BackendError: it may not.
        """
        if self._backend.hardware(values) and values["watchdog"] > HARDWARE_WATCHDOG_S:
            raise BackendError(
                f"watchdog is {values['watchdog']:g} s: an actuator on {self._backend.hardware(values)} must not be "
                f"driven for longer without a command than {HARDWARE_WATCHDOG_S:g} s"
            )

    def watch(self) -> None:
        """Say in the log, once while it lasts, what is wrong with those that talk to the plant."""
        gate, found = self._gate, {}
        if self._notices.moved("rival", gate.counts[Verdict.OTHER_PUBLISHER]):
            found["rival"] = f"a second publisher commands as {gate.rivalled!r} and is refused"
        if self._notices.moved("order", gate.counts[Verdict.OUT_OF_ORDER]):
            found["order"] = "commands are refused: they are not stamped later than the last one of their source"
        self._notices.tell(found)
