"""The recorder's row on `/diagnostics`."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes import diagnostics
from hydraulic_node_utils.nodes.diagnostics import ERROR, OK, WARN
from hydraulic_sysid.data.bag import Recording

# Ten seconds of the five streams at 1 kHz: the disk is not keeping up.
_QUEUE_WARNING = 50_000


class RecorderHealth:
    """Builds the diagnostics; rates are over the time since the last message."""

    def __init__(self, node: Node, recording: Recording) -> None:
        self._name, self._recording = node.get_fully_qualified_name(), recording
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", profile("diagnostics"))
        self._then = 0
        self._before: dict[str, int] = {}
        self._missing = 0

    def publish(self, state: str, missing: dict[str, int], now_ns: int) -> None:
        """Tell how things are; `missing` as of `Intake.missing`."""
        recording = self._recording
        received = dict(recording.received)
        elapsed = (now_ns - self._then) * 1e-9
        values: dict[str, object] = {
            "output": recording.folder,
            "received": sum(received.values()),
            "received_bytes": recording.bytes,
            "queued": recording.waiting,
            "missing": sum(missing.values()),
        }
        if self._then and elapsed > 0:
            for topic, count in received.items():
                values[f"rate_Hz {topic}"] = f"{(count - self._before.get(topic, 0)) / elapsed:.1f}"
        values.update({f"missing {topic}": count for topic, count in missing.items()})
        self._then, self._before = now_ns, received
        level, text = self._judge(state, sum(missing.values()))
        row = diagnostics.row(f"{self._name}: recording", level, text, values)
        self._publisher.publish(diagnostics.array(now_ns, row))

    def _judge(self, state: str, missing: int) -> tuple[bytes, str]:
        more, self._missing = missing - self._missing, missing
        if self._recording.error is not None:
            return ERROR, f"cannot write: {self._recording.error}"
        if more > 0:
            return WARN, f"{more} messages did not come"
        if self._recording.waiting > _QUEUE_WARNING:
            return WARN, f"{self._recording.waiting} messages wait for the disk"
        return OK, state
