"""Node `/actuator/excitation`: plays an excitation plan, one command for every state of the plant.

A command carries the stamp of the state it answers, so that the plant sees the whole delay of the loop in it.
The topic `experiment` tells what is played, how it ended and why; `~/start` and `~/abort` are the switches, and
`~/measure_bandwidth` plays a probe and tells the bandwidth.
"""

from __future__ import annotations

import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from hydraulic_interfaces.contract import EXCITATION_NODE, NAMESPACE
from hydraulic_interfaces.conversions import CommandEncoder, sample_from_messages
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes.callbacks import trigger, understood
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.serving import ServedNode, serve
from hydraulic_sysid.excitation import NOT_STARTED, ExcitationError, Phase, Plan, Session, load_plan
from hydraulic_sysid.nodes._bandwidth_probe import BandwidthProbe
from hydraulic_sysid.nodes._excitation_health import health
from hydraulic_sysid.nodes._excitation_parameters import PARAMETERS

HEALTH_PERIOD_S = 0.5
# States that wait longer are not worth an answer: a node that cannot keep up must skip some, not fall behind.
STATE_DEPTH = 10


class ExcitationNode(ServedNode):
    """Parameters, topics and services around a `Session`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(EXCITATION_NODE, namespace=NAMESPACE, **options)
        self._table = ParameterTable(self, PARAMETERS)
        plan = load_plan(self._table["plan"])  # a bad plan is to be heard of now, not at the start
        self._encode = CommandEncoder(EXCITATION_NODE)
        self._command = self.create_publisher(JointState, "command", profile("command"))
        self._experiment = self.create_publisher(String, "experiment", profile("experiment"))
        self._health = self.create_publisher(DiagnosticArray, "/diagnostics", profile("diagnostics"))
        self._session = Session(self._tell, self._command.get_subscription_count, self.get_namespace())
        self._patience_ends, self._reported = math.inf, -math.inf
        self._leaving = False
        if self._table["autostart"]:
            self._arm(plan, self._table["start_timeout"] or math.inf)
        self.create_subscription(JointState, "state", self._on_state, profile("state", STATE_DEPTH))
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, profile("diagnostics"))
        trigger(self, "~/start", self._start)
        trigger(self, "~/abort", self._abort)
        self._probe = BandwidthProbe(self, lambda: self._table["probe"], self._begin)

    def watch(self) -> None:
        """What must happen without a message: notice silence, give up waiting, report health, leave."""
        now = time.monotonic()
        last_command = self._session.silence(now)
        if last_command is not None:
            self._command.publish(self._encode(*last_command))
        if self._session.ended and not self._session.busy:
            self.exit_code = 0 if self._session.ended is Phase.FINISHED else 1
            self.over = self._leaving or self._table["exit_when_done"]
        if now - self._reported > HEALTH_PERIOD_S:
            self._reported = now
            waiting_for = self._session.obstacle(now) if self._session.armed else ""
            now_ns = self.get_clock().now().nanoseconds
            self._health.publish(health(self.get_fully_qualified_name(), self._session, waiting_for, now_ns))
            if self._session.armed and now > self._patience_ends:
                self.get_logger().error(f"{NOT_STARTED}: waited too long for {waiting_for}")
                self._session.stop("")
                self.exit_code, self.over = 1, self._table["exit_when_done"]

    def interrupt(self, name: str) -> None:
        """SIGINT or SIGTERM: bring the drive to zero first, where a run is on."""
        self._leaving = True
        self._session.stop(f"interrupted by {name}")
        self.over = not self._session.busy

    def _arm(self, plan: Plan, patience: float) -> None:
        self._patience_ends = time.monotonic() + patience
        self._session.state_timeout = self._table["state_timeout"]
        self._session.applied_tolerance = self._table["applied_tolerance"]
        self._session.listeners_needed = self._table["listeners"]
        self._session.arm(plan)

    def _tell(self, event: str) -> None:
        self._experiment.publish(String(data=event))
        if self._session.ended and self._session.run is not None:
            self._probe.end(self._session.run.plan, self._session.ended is Phase.FINISHED, self._session.last_end)
        self.get_logger().info(self._session.last_end if self._session.ended else "started")

    def _on_state(self, message: JointState) -> None:
        sample = understood(self, "state", sample_from_messages, message)
        if sample is None:
            return
        drive = self._session.answer(sample, time.monotonic())
        if self._session.run is not None:
            self._probe.take(self._session.run.plan, sample)
        if drive is not None:
            self._command.publish(self._encode(sample.stamp_ns, drive))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for row in message.status:
            values = {pair.key: pair.value for pair in row.values}
            self._session.diagnose(row.name, row.level == DiagnosticStatus.OK, row.message, values)

    def _begin(self, plan: Plan) -> None:
        """Arm `plan` to start with the next state.

        :raises ExcitationError: it cannot start now.
        """
        if self._session.busy:
            raise ExcitationError("a run is on, or waits to start")
        if obstacle := self._session.obstacle(time.monotonic()):
            raise ExcitationError(obstacle)
        self._arm(plan, math.inf)

    def _start(self) -> str:
        plan = load_plan(self._table["plan"])
        self._begin(plan)
        return f"starting {plan.name}, {plan.total_time:g} s"

    def _abort(self) -> str:
        if not self._session.stop("asked to abort"):
            raise ExcitationError("nothing to abort")
        return "stopping"


def main(argv: list[str] | None = None) -> int:
    """Run the node; exit code 0, 1 when a run was aborted or not started, 2 for a bad parameter or plan."""
    return serve(ExcitationNode, "Play an excitation plan on the actuator.", PARAMETERS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
