"""Node `/actuator/reference`: plays a trajectory for the controller, one reference for every state of the plant.

It leads from where the piston is smoothly to where the trajectory begins, plays it, and holds its end; where the plant
stands still meanwhile (stopped, not enabled), it sends nothing more. `~/start` and `~/stop` are the switches; a second
`~/stop` ends the holding. The response (time, reference, position, drive) can be kept in a file, which
`evaluate --bench` reads.
"""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from hydraulic_control.errors import ControlError
from hydraulic_control.reference_parameters import PARAMETERS
from hydraulic_control.reference_run import ReferenceRun, StandstillWatch
from hydraulic_control.trajectories import MotionLimits
from hydraulic_interfaces.contract import NAMESPACE, REFERENCE_NODE
from hydraulic_interfaces.conversions import ReferenceEncoder, sample_from_messages
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.json_file import NewJson
from hydraulic_node_utils.nodes import diagnostics
from hydraulic_node_utils.nodes.callbacks import trigger, understood
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.serving import ServedNode, serve

HEALTH_PERIOD_S = 0.5
STATE_DEPTH = 10


class ReferenceNode(ServedNode):
    """Parameters, topics and services around a `ReferenceRun`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(REFERENCE_NODE, namespace=NAMESPACE, **options)
        self._table = ParameterTable(self, PARAMETERS, locked=lambda: True)
        self._output = NewJson(self._table["output"], ControlError)
        self._encode = ReferenceEncoder()
        self._reference = self.create_publisher(JointState, "reference", profile("reference"))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", profile("diagnostics"))
        self._armed: ReferenceRun | None = self._make() if self._table["autostart"] else None
        self._run: ReferenceRun | None = None
        self._held: float | None = None
        self._watch = StandstillWatch()
        self._end, self._failed = "idle", False
        self._heard = self._reported = time.monotonic()
        self.create_subscription(JointState, "state", self._on_state, profile("state", STATE_DEPTH))
        trigger(self, "~/start", self._start)
        trigger(self, "~/stop", self._stop)

    def watch(self) -> None:
        """What must happen without a message: notice silence, report health."""
        now = time.monotonic()
        if self._run is not None and now - self._heard > self._table["state_timeout"]:
            self._finish(f"broken off: no state for {now - self._heard:.2f} s", failed=True)
        if now - self._reported > HEALTH_PERIOD_S:
            self._reported = now
            self._publish_health()

    def interrupt(self, name: str) -> None:
        """SIGINT or SIGTERM: stand still where the reference is, and leave."""
        if self._run is not None:
            self._finish(f"broken off: {name}", failed=True)
        self.over = True

    def _make(self) -> ReferenceRun:
        v = self._table
        limits = MotionLimits(v["travel_limit"], v["velocity_limit"], v["acceleration_limit"])
        return ReferenceRun(v["kind"], v.values(), limits)

    def _on_state(self, message: JointState) -> None:
        sample = understood(self, "state", sample_from_messages, message)
        if sample is None:
            return
        self._heard = time.monotonic()
        if self._armed is not None and self._reference.get_subscription_count():
            self._run, self._armed, self._failed, self._end = self._armed, None, False, ""
            self._held = None
        if self._watch.stands(sample, self._held):
            error = 1e3 * abs((self._held or 0.0) - sample.position)
            self._finish(f"broken off: the plant stands at 0 V, {error:.1f} mm from its reference", failed=True)
            self._held = None
        try:
            now = self._run.answer(sample) if self._run is not None else None
        except ControlError as error:
            self._finish(f"refused: {error}", failed=True)
            return
        if now is not None:
            self._held = now.position
            self._reference.publish(self._encode(now.stamp_ns, now.position, now.velocity))
        elif self._held is not None:
            self._reference.publish(self._encode(sample.stamp_ns, self._held, 0.0))
        if self._run is not None and self._run.done:
            self._finish("played", failed=False)

    def _finish(self, end: str, failed: bool) -> None:
        run, self._run = self._run, None
        self._end, self._failed = f"{run.kind if run else 'reference'} {end}", failed
        (self.get_logger().error if failed else self.get_logger().info)(self._end)
        if run is not None and not failed:
            try:
                self._output.write({"kind": run.kind, "start_ns": run.start_ns, **run.response().as_document()})
            except ControlError as error:
                self._failed = True
                self.get_logger().error(str(error))
        self.exit_code = int(self._failed)
        self.over = self.over or self._table["exit_when_done"]
        self._publish_health()

    def _publish_health(self) -> None:
        state = f"plays {self._run.kind}" if self._run else "waits for states" if self._armed else self._end
        level = diagnostics.WARN if self._failed else diagnostics.OK
        values = {"last_run": self._end}
        row = diagnostics.row(f"{self.get_fully_qualified_name()}: run", level, state, values, "reference")
        self._diagnostics.publish(diagnostics.array(self.get_clock().now().nanoseconds, row))

    def _start(self) -> str:
        if self._run is not None or self._armed is not None:
            raise ControlError("a run is on, or waits to start")
        self._output.check()
        self._armed = self._make()
        return f"starting {self._armed.kind}, {self._armed.duration:g} s"

    def _stop(self) -> str:
        if self._run is None and self._armed is None and self._held is None:
            raise ControlError("nothing to stop")
        self._armed = None
        if self._run is not None:
            self._finish("broken off: asked to stop", failed=True)
        else:
            self._held = None
        return "stopped"


def main(argv: list[str] | None = None) -> int:
    """Run the node; exit code 0, 1 when a run was broken off, 2 for a bad parameter or trajectory."""
    return serve(ReferenceNode, "Play a reference trajectory for the controller.", PARAMETERS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
