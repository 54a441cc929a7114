"""A managed node that answers an impossible transition instead of dying of it."""

from __future__ import annotations

from typing import Any

from rclpy.lifecycle import LifecycleNode

from hydraulic_node_utils.nodes.rclpy_internals import change_state_service


def guard_transitions(node: LifecycleNode) -> None:
    """Make the node refuse (success false) a transition that its state does not have.

    Without this, rclpy raises out of the executor and the client waits for ever: a stray `activate` would
    take an active plant down.
    """
    service = change_state_service(node)
    change_state = service.callback

    def guarded(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except RuntimeError as error:  # of which the errors of rcl are
            node.get_logger().warning(f"transition refused: {error}")
            response.success = False
            return response

    service.callback = guarded
