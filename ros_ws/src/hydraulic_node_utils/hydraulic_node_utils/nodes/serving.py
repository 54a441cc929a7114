"""The process around a node that answers a stream: arguments, signals, executor."""

from __future__ import annotations

import gc
import signal
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.executors import Executor
from rclpy.node import Node

from hydraulic_node_utils.nodes import command_line
from hydraulic_node_utils.nodes.taking_down import take_down
from hydraulic_node_utils.parameter_spec import ParameterSpec

WATCH_PERIOD_S = 0.05


class Served:
    """What `serve` asks of a node, plain or managed; it is left with `exit_code` when it sets `over`."""

    over = False
    exit_code = 0

    def watch(self) -> None:
        """Called after every callback and at least every WATCH_PERIOD_S, also when no message comes."""

    def interrupt(self, name: str) -> None:
        """Called on SIGINT or SIGTERM (`name`), once: set `over`, now or when things are in order."""
        self.over = True

    def close(self) -> None:
        """Called last, while publishers still work; what it publishes arrives."""


class ServedNode(Served, Node):
    """A plain node that `serve` runs."""


def serve(
    make_node: Callable[[], Any],
    description: str,
    parameters: Sequence[ParameterSpec],
    argv: list[str] | None,
) -> int:
    """Run the node (`Served`) until it is over; its exit code."""
    command_line.start(command_line.parser(description, parameters), argv)
    node = command_line.make(make_node)
    caught: list[str] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda signum, _: caught.append(signal.Signals(signum).name))
    gc.freeze()  # looking through all that was loaded would cost a collection 10 ms and more
    executor = fast_executor()
    executor.add_node(node)
    told = False
    try:
        while not node.over:
            executor.spin_once(timeout_sec=WATCH_PERIOD_S)
            if caught and not told:
                told = True
                node.interrupt(caught[0])
            node.watch()
    finally:
        node.close()
        take_down(node, executor, node.exit_code)
    return node.exit_code


def fast_executor() -> Executor:
    """The events executor where rclpy has it (a third of the processor time at 1 kHz), else the usual one."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor()
    return EventsExecutor()
