"""Node `/actuator/recorder`: every topic of the contract, serialised as it comes, into a rosbag2 folder.

`~/status` (latched JSON) says "recording" once the bag is open and the subscriptions are up, with the number of
publishers of each topic and the stamp up to which the plant's streams have come (a plant in lockstep waits for it),
and "closed" once the bag is finished, with the number of messages per topic. To commands it listens once the plant's
states come: who waits for listeners to commands then loses no first sample.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from hydraulic_interfaces.contract import NAMESPACE, RECORDER_NODE
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes import command_line
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.taking_down import take_down
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_node_utils.scheduling import release_realtime_for_all, request_realtime_for_all
from hydraulic_sysid.data.bag import Recording, StopRule
from hydraulic_sysid.nodes._recorder_health import RecorderHealth
from hydraulic_sysid.nodes._recorder_intake import Intake

PARAMETERS = (
    ParameterSpec("output", "", "folder of the bag; it must not exist yet"),
    ParameterSpec("description", "", "free text that goes into the bag's metadata"),
    ParameterSpec("max_duration", 0.0, "close the bag after this time; 0: never", "s", 0.0, 1e6),
    ParameterSpec("stop_on_experiment_end", False, "close when an excitation run has finished or aborted"),
    ParameterSpec("exit_when_done", False, "leave once the bag is closed"),
    ParameterSpec("realtime_priority", 5, "FIFO priority of taking messages in where permitted, 0: none", "", 0, 98),
)
_POLL_S = 0.02
_STATUS_S = 0.05
_DIAGNOSTICS_S = 1.0


class Recorder(Node):
    """Opens the bag at once and records until `close`; `poll` does the work, some fifty times a second."""

    def __init__(self) -> None:
        """:raises ValueError: no output folder is given, it exists or cannot be made (BagError)."""
        super().__init__(RECORDER_NODE, namespace=NAMESPACE)
        values = ParameterTable(self, PARAMETERS, locked=lambda: True).values()
        if not values["output"]:
            raise ValueError("no folder given; say --ros-args -p output:=FOLDER")
        self._status = self.create_publisher(String, "~/status", profile("latched"))
        self._exit_when_done = values["exit_when_done"]
        if values["realtime_priority"]:  # threads to come inherit it: those that listen, and the one that writes
            request_realtime_for_all(values["realtime_priority"])
        self._rule = StopRule(values["max_duration"], values["stop_on_experiment_end"])
        custom = {"recorder": "hydraulic_sysid", "description": values["description"]}
        self._recording = Recording(Path(values["output"]).expanduser().absolute(), custom)
        self._intake = Intake(self, self._recording)
        self._health = RecorderHealth(self, self._recording)
        self.state = self._published = ""
        self._due = {_POLL_S: 0.0, _STATUS_S: 0.0, _DIAGNOSTICS_S: 0.0}

    @property
    def done(self) -> bool:
        """Whether the process may leave."""
        return self.state == "failed" or (self.state == "closed" and self._exit_when_done)

    def poll(self) -> None:
        """Take what has come, see whether to close, tell how things are."""
        if not self._is_due(_POLL_S):
            return
        clock = self.get_clock().now().nanoseconds
        if self.state in ("", "recording"):
            self._intake.drain()
            experiment, reached = self._intake.experiment, self._intake.reached_ns()
            reason = self._rule.reason(clock, time.monotonic_ns(), experiment, reached)
            if reason or self._recording.error:
                self.close(reason)
            elif self._is_due(_STATUS_S):
                self._tell("recording", publishers=self._intake.publishers(), reached_ns=reached)
        if self._is_due(_DIAGNOSTICS_S):
            self._health.publish(self.state, self._intake.missing(), clock)

    def close(self, reason: str) -> None:
        """Finish the bag, unless that has been done."""
        if self.state in ("closed", "failed"):
            return
        self._intake.drain()
        folder, missing = self._recording.folder, self._intake.missing()
        try:
            bag = self._recording.close(self._intake.experiment.custom_data())
        except Exception as error:
            self.get_logger().error(f"cannot write {folder}: {error}; save what is there: recover {folder}")
            self._tell("failed", error=str(error))
        else:
            figures = {"messages": bag.messages, "duration_s": bag.duration_ns * 1e-9, "bytes": bag.size}
            self._tell("closed", reason=reason, missing=missing, **figures)
            self.get_logger().info(f"closed {folder}: {sum(bag.messages.values())} messages ({reason})")

    def destroy_node(self) -> None:
        """Give back what goes before ordinary processes, too: the process may go on."""
        release_realtime_for_all()
        super().destroy_node()

    def _is_due(self, period: float) -> bool:
        if due := time.monotonic() >= self._due[period]:
            self._due[period] = time.monotonic() + period
        return due

    def _tell(self, state: str, **content: Any) -> None:
        self.state = state
        text = json.dumps({"state": state, "output": str(self._recording.folder), **content})
        if text != self._published:
            self._published = text
            self._status.publish(String(data=text))


def main(argv: list[str] | None = None) -> int:
    """Record until the end condition, SIGINT or SIGTERM; 0 done, 1 not everything written, 2 bad options."""
    command_line.start(command_line.parser(__doc__, PARAMETERS), argv)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    node = command_line.make(Recorder)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not (stop.is_set() or node.done):
        executor.spin_once(timeout_sec=_POLL_S)
        node.poll()
    node.close("signal")
    take_down(node, executor, code := int(node.state == "failed"))
    return code


if __name__ == "__main__":
    sys.exit(main())
