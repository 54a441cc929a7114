"""Subscriptions that an executor does not serve: their messages wait until somebody takes them.

An executor wakes the interpreter and rebuilds its wait set for every message. A loop that takes what has come
once per cycle spends a fraction of that, and nothing competes with its deadlines.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile

from hydraulic_node_utils.nodes import rclpy_internals


class _NotServed(CallbackGroup):
    """Keeps its entities out of every executor's wait set."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        return


class Mailbox:
    """A subscription to be emptied by hand; `raw` gives serialised bytes instead of messages.

    At most `qos.depth` messages wait, the oldest go first. All calls must come from one thread.
    """

    def __init__(self, node: Node, kind: Any, name: str, qos: QoSProfile, raw: bool = False) -> None:
        self._raw, self._context = raw, node.context
        self._wait_set: Any = None
        self._subscription = node.create_subscription(
            kind, name, lambda message: None, qos, callback_group=_NotServed(), raw=raw
        )

    def wait(self, seconds: float) -> None:
        """Return when a message waits, or after that time."""
        if self._wait_set is None:
            self._wait_set = rclpy_internals.wait_set(self._context)
        with self._subscription.handle:
            self._wait_set.clear_entities()
            self._wait_set.add_subscription(self._subscription.handle)
            self._wait_set.wait(round(seconds * 1e9))

    def take(self) -> Iterator[Any]:
        """Every waiting message, oldest first."""
        handle, kind, raw = self._subscription.handle, self._subscription.msg_type, self._raw
        with handle:
            while (taken := handle.take_message(kind, raw)) is not None:
                yield taken[0]

    def take_with_info(self) -> Iterator[tuple[Any, dict[str, int | None]]]:
        """Every waiting message, oldest first, with the middleware's account of it.

        Keys: `source_timestamp` and `received_timestamp` [ns since the epoch], `publication_sequence_number`.
        """
        handle, kind, raw = self._subscription.handle, self._subscription.msg_type, self._raw
        with handle:
            while (taken := handle.take_message(kind, raw)) is not None:
                yield taken

    @property
    def publishers(self) -> int:
        """Number of publishers that this subscription is connected with."""
        return int(self._subscription.get_publisher_count())
