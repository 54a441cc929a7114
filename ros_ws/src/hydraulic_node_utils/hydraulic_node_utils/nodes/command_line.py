"""The command line that all nodes have: ROS arguments, and a help text that lists the parameters."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from hydraulic_interfaces.errors import one_line
from hydraulic_node_utils.nodes import middleware, rclpy_internals
from hydraulic_node_utils.nodes.log_callers import know_log_callers
from hydraulic_node_utils.parameter_spec import ParameterSpec

N = TypeVar("N")


def parser(description: str, parameters: Sequence[ParameterSpec]) -> argparse.ArgumentParser:
    """A parser for what is no ROS argument; its help lists the parameters."""
    rows = [f"  {spec.name} = {spec.default!r} {spec.unit}: {spec.description}" for spec in parameters]
    return argparse.ArgumentParser(
        description=description,
        epilog="parameters (--ros-args -p name:=value):\n" + "\n".join(rows),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def start(options: argparse.ArgumentParser, argv: list[str] | None) -> argparse.Namespace:
    """Read the command line (`argv`, or that of the process) and start rclpy, found on this machine only.

    To be called before the node is made, while nothing is kept waiting yet. Signals are left to the caller.
    Leaves with exit code 2 for options that do not exist or are malformed, and on an rclpy that the nodes cannot use.
    """
    arguments = sys.argv if argv is None else [sys.argv[0], *argv]
    middleware.set_up()
    try:
        rclpy_internals.check()
    except rclpy_internals.RclpyVersionError as error:
        options.exit(2, f"{error}\n")
    try:
        given = options.parse_args(remove_ros_args(arguments)[1:])
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy has no common base for what it says about its arguments
        options.error(f"ROS arguments: {one_line(error)}")
    know_log_callers()
    return given


def make(node: Callable[[], N]) -> N:
    """The node, once `start` has been called; leaves with exit code 2 where it or the middleware refuses to be made."""
    try:
        return node()
    except (ParameterException, ValueError, OSError, RuntimeError) as error:  # the last: of rcl
        print(f"{Path(sys.argv[0]).stem}: {one_line(error)}", file=sys.stderr)
        rclpy.try_shutdown()
        sys.exit(2)
