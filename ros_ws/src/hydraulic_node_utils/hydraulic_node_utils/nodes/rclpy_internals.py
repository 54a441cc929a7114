"""What the nodes use of rclpy beyond its documented interface, in one place.

There is no public way to take a message without an executor, to know which parameters were given at the start of a
node, and to answer an impossible transition. All of it is the same in rclpy 7.1.0 to 7.1.6 (ROS 2 Jazzy); another
version is checked when a node starts, and refused with the name of what it lacks.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter

from hydraulic_interfaces.errors import HydraulicError

TESTED = "7.1 (ROS 2 Jazzy)"
_OVERRIDES, _CHANGE_STATE = "_parameter_overrides", "_service_change_state"


class RclpyVersionError(HydraulicError):
    """This rclpy lacks something that the nodes need."""


def check() -> None:
    """See that all is there, before a node is made.

    :raises RclpyVersionError: something is not.
    """
    needed = {
        "WaitSet.add_subscription": hasattr(getattr(rclpy_implementation, "WaitSet", None), "add_subscription"),
        "Subscription.take_message": hasattr(getattr(rclpy_implementation, "Subscription", None), "take_message"),
        f"Node.{_OVERRIDES}": _set_when_made(Node, _OVERRIDES),
        f"LifecycleNode.{_CHANGE_STATE}": _set_when_made(LifecycleNode, _CHANGE_STATE),
    }
    if lacking := [name for name, there in needed.items() if not there]:
        raise RclpyVersionError(f"rclpy {_version()} has no {', '.join(lacking)}; the bench is made for rclpy {TESTED}")


def wait_set(context: rclpy.Context) -> Any:
    """A wait set for one subscription."""
    return rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, context.handle)


def given_at_start(node: Node) -> Mapping[str, Parameter]:
    """Parameters given on the command line or when the node was made, declared or not."""
    return dict(getattr(node, _OVERRIDES))


def change_state_service(node: LifecycleNode) -> Any:
    """The service by which a managed node is taken through its transitions; its `callback` may be replaced."""
    return getattr(node, _CHANGE_STATE)


def _set_when_made(kind: type, name: str) -> bool:
    """Whether the class or one of its bases speaks of an attribute where it makes its objects."""
    makers = (getattr(vars(base).get("__init__"), "__code__", None) for base in kind.__mro__)
    return any(name in maker.co_names for maker in makers if maker is not None)


def _version() -> str:
    for name in ("ros-rclpy", "rclpy"):
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return "of an unknown version"
