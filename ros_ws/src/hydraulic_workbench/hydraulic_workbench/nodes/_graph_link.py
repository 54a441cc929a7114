"""The node of the workbench in a thread of its own: samples into a ring, texts and diagnostics to the server, calls."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from hydraulic_interfaces.contract import RECORDER_NODE
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.json_file import json_object
from hydraulic_node_utils.nodes.taking_down import take_down
from hydraulic_workbench.columns import COLUMNS, PATIENCE_S
from hydraulic_workbench.diagnostics import Row
from hydraulic_workbench.nodes._sample_intake import SampleIntake
from hydraulic_workbench.sample_ring import SampleRing

NODE = "workbench"
FRAME_S = 1.0 / 30.0
_RING_ROWS = 120_000  # two minutes at 1 kHz
_TEXTS = {"description": "description", "experiment": "experiment", f"{RECORDER_NODE}/status": "latched"}

Listener = Callable[[str, Any], None]


class GraphLink:
    """Made in the thread of the running loop, which is told what comes."""

    def __init__(self, namespace: str) -> None:
        self._loop, self.namespace = asyncio.get_running_loop(), namespace
        self._listener: Listener | None = None
        self.ring = SampleRing(_RING_ROWS, len(COLUMNS), round(PATIENCE_S * 1e9))
        self.node = Node(NODE, namespace=namespace)
        self.intake = SampleIntake(self.node, self.ring)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, profile("diagnostics", 50))
        for topic, qos in _TEXTS.items():
            self.node.create_subscription(String, topic, self._text_listener(topic), profile(qos))
        self._leaving = False
        self._thread = threading.Thread(target=self._spin, name="graph", daemon=True)

    def start(self, listener: Listener) -> None:
        """Begin to listen; ``listener(name, content)`` is called in the loop's thread with what comes.

        Names: "samples" (number of the first row that is not complete), "diagnostics" (rows), and the last part of a
        topic of texts (its JSON object).
        """
        self._listener = listener
        self._thread.start()

    def stop(self) -> None:
        """Listen no more; the node is left to whoever ends the process."""
        self._leaving = True
        self._executor.wake()
        self._thread.join(2.0)

    @property
    def executor(self) -> SingleThreadedExecutor:
        """For taking the node down."""
        return self._executor

    def _spin(self) -> None:
        due = time.monotonic()
        while not self._leaving:
            self._executor.spin_once(timeout_sec=max(due - time.monotonic(), 0.0))
            if time.monotonic() >= due:
                due = max(due + FRAME_S, time.monotonic())
                self.intake.drain()
                end = self.ring.complete(self.intake.awaited())
                self._tell("samples", end)

    def _tell(self, name: str, content: Any) -> None:
        if self._listener is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._listener, name, content)

    def _text_listener(self, topic: str) -> Callable[[String], None]:
        return lambda message: self._tell(topic.rpartition("/")[2], json_object(message.data))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        rows = [
            Row(row.name, row.level[0], row.message, {pair.key: pair.value for pair in row.values}, now)
            for row in message.status
        ]
        self._tell("diagnostics", rows)


def take_out(link: GraphLink, code: int) -> None:
    """The last thing of the process: leave the graph."""
    link.stop()
    take_down(link.node, link.executor, code)
