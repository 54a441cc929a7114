"""Running a managed plant node as a process: options, signals, orderly end."""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback

from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from hydraulic_node_utils.nodes import command_line
from hydraulic_node_utils.nodes.taking_down import take_down
from hydraulic_plant_node.nodes.plant_node import PlantNode, parameters_of
from hydraulic_plant_node.plant_backend import PlantBackend

_SPIN_S = 1.0
_PATIENCE_S = 5.0
_LOOP_PATIENCE_S = 1.0


def run_plant(backend: PlantBackend, description: str, argv: list[str] | None = None) -> int:
    """Run the plant node over `backend` until SIGINT or SIGTERM; exit code 0, 1, or 2 for bad options.

    Three threads: this one waits for a signal, one serves ROS, the plant loop runs in its own. A signal leads
    through the lifecycle's shutdown while everything still works, so the last thing the plant sees, and tells, is 0 V.
    Where that is not possible, because the thread that serves ROS or the plant loop does not return, the code is 1.
    """
    parser = command_line.parser(description, parameters_of(backend))
    parser.add_argument("--autostart", action="store_true", help="configure and activate at start")
    parser.add_argument("--lockstep", action="store_true", help="plant time waits for the answer to each state")
    options = command_line.start(parser, argv)
    overrides = [Parameter(name, value=True) for name in ("autostart", "lockstep") if getattr(options, name)]
    node = command_line.make(lambda: PlantNode(backend, parameter_overrides=overrides))
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
        # Loading or compiling takes long, with the plant inactive; but an active one may hang in a call as well.
        ended = node.end_loop(_LOOP_PATIENCE_S)
        print(f"leaving in the middle of a call that does not return; {_end(ended)}", file=sys.stderr, flush=True)
        os._exit(1)
    if node.state != "finalized":
        node.trigger_shutdown()
    ended = node.end_loop(_LOOP_PATIENCE_S)
    if not ended:
        print(_end(ended), file=sys.stderr)
    code = 0 if ended else 1
    take_down(node, executor, code)
    return code


def _end(ended: bool) -> str:
    return "the plant loop has ended" if ended else "the plant loop hangs: the plant may not be at 0 V"


def _serve(executor: SingleThreadedExecutor, node: PlantNode, stop: threading.Event) -> None:
    while not stop.is_set():
        try:
            executor.spin_once(timeout_sec=_SPIN_S)
        except Exception:
            # A callback that fails must not take the services, and with them the emergency stop, away.
            node.get_logger().error(f"a callback failed:\n{traceback.format_exc()}")
