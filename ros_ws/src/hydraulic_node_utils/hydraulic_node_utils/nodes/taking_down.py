"""The end of a node's process: what the node said last arrives, then the middleware is closed."""

from __future__ import annotations

import time

import rclpy
from rclpy.duration import Duration
from rclpy.executors import Executor
from rclpy.node import Node

from hydraulic_node_utils.nodes.exit_guard import exit_guard

DELIVERY_S = 4.0
"""Patience with subscribers. A packet that got lost is sent again after the next heartbeat of Fast DDS: 50 ms later
(`middleware`), or 3 s by default. While one is missing, those after it are not handed over; nor are they once the
publisher has gone."""


def take_down(node: Node, executor: Executor, code: int) -> None:
    """Close the node of a process that leaves with `code`, once its subscribers have what it published last."""
    give_up = time.monotonic() + DELIVERY_S
    for publisher in node.publishers:
        publisher.wait_for_all_acked(Duration(seconds=max(give_up - time.monotonic(), 0.0)))
    with exit_guard(code):
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
