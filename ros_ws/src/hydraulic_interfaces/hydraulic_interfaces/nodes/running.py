"""Running a managed plant node as a process: options, signals, orderly end."""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from hydraulic_interfaces.nodes import command_line
from hydraulic_interfaces.nodes.exit_guard import exit_guard
from hydraulic_interfaces.nodes.plant_node import PARAMETERS, PlantNode
from hydraulic_interfaces.plant_backend import PlantBackend

_SPIN_S = 1.0
_PATIENCE_S = 5.0


def run_plant(backend: PlantBackend, description: str, argv: list[str] | None = None) -> int:
    """Run the plant node over `backend` until SIGINT or SIGTERM; exit code 0, or 2 for bad options.

    Three threads: this one waits for a signal, one serves ROS, the plant loop runs in its own. A signal leads
    through the lifecycle's shutdown while everything still works, so the last thing the plant sees is 0 V.
    """
    parser = command_line.parser(description, (*PARAMETERS, *backend.parameters()))
    parser.add_argument("--autostart", action="store_true", help="configure and activate at start")
    options = command_line.start(parser, argv)
    overrides = [Parameter("autostart", value=True)] if options.autostart else []
    try:
        node = PlantNode(backend, parameter_overrides=overrides)
    except (ParameterException, ValueError) as error:
        print(f"bad parameter: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    server = threading.Thread(target=_serve, args=(executor, node, stop), name="ros", daemon=True)
    server.start()
    stop.wait()
    executor.wake()
    server.join(_PATIENCE_S)
    if server.is_alive():
        # A transition that takes long (loading, compiling) holds the thread; the plant is not active then.
        print("leaving in the middle of a transition", file=sys.stderr, flush=True)
        os._exit(0)
    if node.state != "finalized":
        node.trigger_shutdown()
    with exit_guard(0):
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _serve(executor: SingleThreadedExecutor, node: PlantNode, stop: threading.Event) -> None:
    while not stop.is_set():
        try:
            executor.spin_once(timeout_sec=_SPIN_S)
        except Exception:
            # A callback that fails must not take the services, and with them the emergency stop, away.
            node.get_logger().error(f"a callback failed:\n{traceback.format_exc()}")
