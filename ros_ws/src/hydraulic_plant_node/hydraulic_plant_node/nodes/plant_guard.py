"""Who talks to a plant and beside it: what is refused for that, and what the user hears of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclpy.node import Node

from hydraulic_plant_node.command_gate import CommandGate, Verdict
from hydraulic_plant_node.nodes.notices import Notices
from hydraulic_plant_node.plant_backend import BackendError, PlantBackend
from hydraulic_plant_node.run_marker import RunMarker

HARDWARE_WATCHDOG_S = 0.2
"""Longest silence of a source that a real actuator may be driven through."""


class PlantGuard:
    """Watches over the surroundings of a plant node; `watch` is called often, from the thread that serves ROS."""

    def __init__(self, node: Node, gate: CommandGate, backend: PlantBackend) -> None:
        self._node, self._gate, self._backend = node, gate, backend
        self._notices = Notices(node.get_logger().warning)
        self._marker: RunMarker | None = None

    def enter(self, values: Mapping[str, Any]) -> None:
        """Before the plant is configured with these parameters; a real one is stopped if its last run was not ended.

        :raises BackendError: it may not be configured so.
        """
        hardware = self._backend.hardware(values)
        if not hardware:
            return
        if values["watchdog"] > HARDWARE_WATCHDOG_S:
            raise BackendError(
                f"watchdog is {values['watchdog']:g} s: an actuator on {hardware} must not be driven for longer "
                f"without a command than {HARDWARE_WATCHDOG_S:g} s"
            )
        if values["enable_on_activate"]:
            raise BackendError(f"enable_on_activate: an actuator on {hardware} is enabled by the service alone")
        self._marker = RunMarker(hardware)
        if reason := self._marker.begin():
            self._gate.stop(reason)
            self._node.get_logger().warning(f"stopped until reset: {reason}")

    def leave(self) -> None:
        """After the plant has been released in order."""
        if self._marker is not None:
            self._marker.end(self._gate.stop_reason)
            self._marker = None

    def watch(self) -> None:
        """Say in the log, once while it lasts, what is wrong with those that talk to the plant."""
        gate, found = self._gate, {}
        if self._notices.moved("rival", gate.counts[Verdict.OTHER_PUBLISHER]):
            found["rival"] = f"a second publisher commands as {gate.rivalled!r} and is refused"
        if self._notices.moved("order", gate.counts[Verdict.OUT_OF_ORDER]):
            found["order"] = "commands are refused: they are not stamped later than the last one of their source"
        self._notices.tell(found)
