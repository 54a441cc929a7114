"""Who talks to a plant and beside it: what is refused for that, and what the user hears of it."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.utilities import get_rmw_implementation_identifier

from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes import middleware
from hydraulic_plant_node.command_gate import CommandGate, Verdict
from hydraulic_plant_node.name_claim import NameClaim
from hydraulic_plant_node.nodes.notices import Counters, Notices
from hydraulic_plant_node.plant_backend import BackendError, PlantBackend
from hydraulic_plant_node.run_marker import RunMarker

HARDWARE_WATCHDOG_S = 0.2
"""Longest silence of a source that a real actuator may be driven through."""
_LOOK_AROUND_S = 1.0
"""How long after its start a plant on hardware is configured at the earliest: it knows the others then."""
_HARDWARE = "hardware "
_LOOK_EVERY = 5  # calls of `watch`


class PlantGuard:
    """Watches over the surroundings of a plant node; `watch` is called often, from the thread that serves ROS."""

    def __init__(self, node: Node, gate: CommandGate, backend: PlantBackend) -> None:
        self._node, self._gate, self._backend = node, gate, backend
        self._notices, self._counters = Notices(node.get_logger().warning), Counters()
        self._domain = node.context.get_domain_id()
        self._claims: dict[str, NameClaim] = {}
        self._marker: RunMarker | None = None
        self._made, self._serves, self._watched = time.monotonic(), False, 0
        self.not_heard = self._other = ""

    def enter(self, values: Mapping[str, Any], own_clock: bool) -> None:
        """Before the plant is configured with these parameters; a real one is stopped if its last run was not ended.

        :raises BackendError: it may not be configured so, or another one serves the same topics, time or hardware.
        """
        name, clock = self._node.get_fully_qualified_name(), self._node.resolve_topic_name("/clock")
        self._claim(
            f"plant {self._domain} {self._node.get_namespace()}",
            f"another process is {name} in domain {self._domain}: end it, or give this one a namespace of its own "
            "(-r __ns:=/left) or another ROS_DOMAIN_ID",
        )
        if own_clock:
            self._claim(
                f"clock {self._domain} {clock}",
                f"another plant publishes {clock} in domain {self._domain}: give every node a clock in its own "
                "namespace (-r /clock:=clock)",
            )
        hardware = self._backend.hardware(values)
        if hardware:
            self._claim(f"{_HARDWARE}{hardware}", f"another process drives the actuator on {hardware}: end it")
            time.sleep(max(self._made + _LOOK_AROUND_S - time.monotonic(), 0.0))
        self.check_alone()
        if reason := middleware.reach(os.environ, get_rmw_implementation_identifier()):
            self._node.get_logger().warning(reason)
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

    def serve(self) -> None:
        """After the plant has been configured, when its publisher of `state` has been made."""
        self._serves = True

    def check_alone(self) -> None:
        """See that nobody else publishes the state of this plant.

        :raises BackendError: somebody does.
        """
        if others := self._others():
            name = self._node.resolve_topic_name("state")
            raise BackendError(f"another plant: {', '.join(others)} publishes {name}, and would take the same commands")

    def leave(self) -> None:
        """After the plant has been released in order."""
        if self._marker is not None:
            self._marker.end(self._gate.stop_reason)
            self._marker = None
        for name in list(self._claims):
            # Its publishers of `state` and time live until the process ends; the hardware has been let go.
            if not self._serves or name.startswith(_HARDWARE):
                self._claims.pop(name).give_back()

    def watch(self) -> None:
        """Stop the plant where there is another; log, once while it lasts, what is wrong with those that talk to it."""
        gate, found = self._gate, {}
        try:
            self.check_alone()
        except BackendError as error:
            if self._serves:
                gate.stop(str(error))
                if gate.stop_reason == self._other:  # who it is comes to be known a little after that it is there
                    gate.stop_reason = str(error)
                found["other plant"] = self._other = str(error)
        if self._watched % _LOOK_EVERY == 0:
            self.not_heard = self._not_heard()
        self._watched += 1
        if self.not_heard:
            found["not heard"] = self.not_heard
        if self._counters.moved("rival", gate.counts[Verdict.OTHER_PUBLISHER]):
            found["rival"] = f"a second publisher commands as {gate.rivalled!r} and is refused"
        if self._counters.moved("order", gate.counts[Verdict.OUT_OF_ORDER]):
            found["order"] = "commands are refused: they are not stamped later than the last one of their source"
        self._notices.tell(found)

    def _claim(self, name: str, refusal: str) -> None:
        claim = self._claims.get(name) or NameClaim(name)
        if not claim.take():
            raise BackendError(refusal)
        self._claims[name] = claim

    def _others(self) -> list[str]:
        """Nodes, without this one, that publish the state in its namespace."""
        if self._node.count_publishers("state") <= self._serves:
            return []
        infos = self._node.get_publishers_info_by_topic("state")
        names = Counter(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos)
        names[self._node.get_fully_qualified_name()] -= self._serves
        return sorted(names.elements())

    def _not_heard(self) -> str:
        """Who publishes commands in a way that the plant's subscription does not take; "" where nobody does."""
        deaf = []
        for info in self._node.get_publishers_info_by_topic("command"):
            compatible, reason = qos_check_compatible(info.qos_profile, profile("command"))
            if compatible == QoSCompatibility.ERROR:
                deaf.append(f"{info.node_namespace.rstrip('/')}/{info.node_name} ({reason.rstrip('; ')})")
        return f"commands are not heard, their QoS does not match: {', '.join(sorted(deaf))}" if deaf else ""
