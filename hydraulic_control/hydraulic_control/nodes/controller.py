"""Node `/actuator/controller`: a managed node that closes the position loop, one command for every state.

It follows the topic `reference`; until one comes it holds the position that it found when it was activated. A command
carries the stamp of the state it answers. The gains are live parameters; changing one makes no bump in the drive. A
state that is too old or cannot be believed is answered with 0 V and a diagnostic. Whenever the plant does not obey, the
reference is dropped and the position found is held. In lockstep a state waits for the reference of its instant.
"""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState

from hydraulic_control.controller import Controller
from hydraulic_control.lockstep import ReferenceLockstep
from hydraulic_control.nodes._controller_health import ControllerHealth
from hydraulic_control.nodes._controller_parameters import PARAMETERS, ControllerParameters
from hydraulic_control.session import ControlSession
from hydraulic_interfaces.contract import CONTROLLER_NODE, NAMESPACE
from hydraulic_interfaces.conversions import CommandEncoder, from_time, reference_from_message, sample_from_messages
from hydraulic_interfaces.qos import profile
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.nodes.callbacks import understood
from hydraulic_node_utils.nodes.diagnostics import OK
from hydraulic_node_utils.nodes.guarded_lifecycle import guard_transitions
from hydraulic_node_utils.nodes.serving import Served, serve
from hydraulic_node_utils.plant_report import PlantReport
from hydraulic_node_utils.scheduling import release_realtime_for_all, request_realtime_for_all

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
HEALTH_PERIOD_S = 0.5
STATE_DEPTH = 10  # a node that cannot keep up must skip some, not fall behind


class ControllerNode(Served, LifecycleNode):
    """Parameters, topics, lifecycle and diagnostics around a `ControlSession`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(CONTROLLER_NODE, namespace=NAMESPACE, **options)
        guard_transitions(self)
        self._state = "unconfigured"
        self._session = ControlSession(Controller())
        self._settings = ControllerParameters(
            self, self._session, lambda: self._state != "unconfigured", lambda: self._state == "active"
        )
        self._health = ControllerHealth(self.get_fully_qualified_name(), self._session)
        self._encode = CommandEncoder(CONTROLLER_NODE)
        self._command = self.create_publisher(JointState, "command", profile("command"))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", profile("diagnostics"))
        self._simulated = self.get_parameter("use_sim_time").value
        self._heard, self._reported = self._steady(), time.monotonic()
        self._stamp_ns = 0
        self._lockstep = self._health.lockstep = ReferenceLockstep() if self._settings.table["lockstep"] else None
        self._waiting: PlantSample | None = None
        self._plant = PlantReport(self.get_namespace())
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, profile("diagnostics"))
        self.create_subscription(JointState, "state", self._on_state, profile("state", STATE_DEPTH))
        self.create_subscription(JointState, "reference", self._on_reference, profile("reference", STATE_DEPTH))
        if self._settings.table["autostart"]:
            self._starter = self.create_timer(0.0, self._autostart)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the gains and compile the step; FAILURE with a log line if that cannot be done."""
        try:
            self._settings.load_gains()
            # Compiled, or read from numba's cache, before the first state waits for it.
            Controller(self._session.controller.values).step(1e-3, 0.0, 0.0, 0.0)
        except ValueError as error:
            self.get_logger().error(f"cannot configure: {error}")
            return FAILURE
        self._settings.table.warn_of_unknown()
        self._state = "inactive"
        return SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hold the position that the next state reports, until a reference comes."""
        self._session.begin()
        if priority := self._settings.table["realtime_priority"]:
            self._health.scheduling = request_realtime_for_all(priority)
        self._heard, self._state, self._waiting = self._steady(), "active", None
        return SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """0 V, then silence."""
        self._state = "inactive"
        self._session.begin()
        self._command.publish(self._encode(self._stamp_ns + 1, 0.0))
        release_realtime_for_all()
        return SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let everything be set again."""
        self._state = "unconfigured"
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As on_deactivate, from whatever state."""
        if self._state == "active":
            self.on_deactivate(state)
        self._state = "finalized"
        return SUCCESS

    def watch(self) -> None:
        """What must happen without a message: notice silence, report health."""
        now = time.monotonic()
        self._settings.watch()
        self._answer()
        if self._state == "active" and self._session.silence(age := self._steady() - self._heard):
            self._command.publish(self._encode(self._stamp_ns + round(age * 1e9), 0.0))
            self._reported = 0.0
        if now - self._reported > HEALTH_PERIOD_S:
            self._reported = now
            self._diagnostics.publish(self._health.message(self._state, self.get_clock().now().nanoseconds))

    def close(self) -> None:
        """0 V if it was in command."""
        if self._state == "active":
            self.on_deactivate(None)  # type: ignore[arg-type]

    def _on_state(self, message: JointState) -> None:
        if self._state != "active":
            return
        sample = understood(self, "state", sample_from_messages, message)
        if sample is None:
            return
        self._waiting = sample
        if self._lockstep:
            self._lockstep.state(sample.stamp_ns, time.monotonic())
        self._answer()

    def _answer(self) -> None:
        """Answer the state that waits, unless its reference is still to come."""
        sample = self._waiting
        if sample is None or self._state != "active":
            return
        if self._lockstep and self._lockstep.waits(self.count_publishers("reference"), time.monotonic()):
            return
        self._waiting = None
        clock = self.get_clock()
        drive = self._session.answer(sample, clock.now().nanoseconds)
        if drive is not None:
            self._command.publish(self._encode(sample.stamp_ns, drive))
            self._stamp_ns = sample.stamp_ns
            self._health.latencies.append((clock.now().nanoseconds - sample.stamp_ns) * 1e-9)
        self._heard = self._steady()

    def _on_reference(self, message: JointState) -> None:
        reference = understood(self, "reference", reference_from_message, message)
        if reference is not None:
            self._session.follow(reference, self.get_clock().now().nanoseconds)
            if self._lockstep:
                self._lockstep.reference(reference.stamp_ns)
                self._answer()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for row in message.status:
            values = {pair.key: pair.value for pair in row.values}
            own = self._plant.update(row.name, row.level == OK, row.message, values)
            if own and (reason := self._plant.disobedience(CONTROLLER_NODE)):
                self._session.disobeyed(reason, from_time(message.header.stamp))

    def _steady(self) -> float:
        """Seconds by which silence is measured: a simulation may run slower than the wall's clock."""
        return self.get_clock().now().nanoseconds * 1e-9 if self._simulated else time.monotonic()

    def _autostart(self) -> None:
        self._starter.cancel()
        if self.trigger_configure() == SUCCESS:
            self.trigger_activate()


def main(argv: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; exit code 0, or 2 for a bad parameter."""
    return serve(ControllerNode, "Position control of the actuator: NPID and its peers.", PARAMETERS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
