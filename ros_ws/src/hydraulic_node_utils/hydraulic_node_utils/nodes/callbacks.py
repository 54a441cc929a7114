"""What nodes answer to services and messages: errors of the user's become replies and warnings, in one place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from rclpy.node import Node
from std_srvs.srv import Trigger

from hydraulic_interfaces.conversions import MessageError
from hydraulic_interfaces.errors import HydraulicError

T = TypeVar("T")


def trigger(node: Node, name: str, action: Callable[[], str]) -> None:
    """Serve a trigger: ``action`` does what is asked and says what, or raises an error of the user's to refuse it."""

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message, response.success = action(), True
        except (HydraulicError, OSError) as error:
            response.message = f"refused: {error}"
        return response

    node.create_service(Trigger, name, answer)


def understood(node: Node, what: str, decode: Callable[[Any], T], message: Any) -> T | None:
    """What a message says; None, and a warning, for one that breaks the contract."""
    try:
        return decode(message)
    except MessageError as error:
        node.get_logger().warning(f"not a {what}: {error}", throttle_duration_sec=1.0)
        return None
