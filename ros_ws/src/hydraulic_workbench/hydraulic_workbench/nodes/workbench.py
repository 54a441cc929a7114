"""``workbench``: the bench in a browser. Serves one page on 127.0.0.1, whose address it prints; ends with Ctrl-C.

Without options it has a ROS domain of its own, and the page starts the plant: a simulator, virtual CAN devices, or the
real bench. With --attach it shows the plant that runs in the domain of this terminal.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import os
import signal
import socket
import sys
import webbrowser
from collections.abc import Mapping
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions

from hydraulic_bringup.demo.online import private_domain, timestamped_folder
from hydraulic_interfaces.contract import NAMESPACE
from hydraulic_node_utils import cli
from hydraulic_node_utils.nodes import middleware
from hydraulic_node_utils.nodes.log_callers import know_log_callers
from hydraulic_sim.trust import add_trust_option
from hydraulic_workbench.access import Access
from hydraulic_workbench.bench import Bench, Settings
from hydraulic_workbench.nodes._graph_link import GraphLink, take_out
from hydraulic_workbench.nodes._node_calls import NodeCalls
from hydraulic_workbench.server import Server, listen

RUNS = Path("runs")
_links: list[GraphLink] = []


def main(argv: list[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; 0 then, 2 for bad options."""
    code = cli.run(_parser(), _workbench, argv)
    for link in _links:
        take_out(link, code)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = cli.parser("workbench", str(__doc__))
    add = parser.add_argument
    add("--folder", metavar="DIR", type=Path, help="of records, runs and models (default: a new one in runs)")
    add("--open", metavar="DIR", type=Path, nargs="+", default=[], help="show the records and results of other folders")
    add("--port", metavar="N", type=cli.count, help="of this machine (default: a free one from 8642 on)")
    add("--attach", action="store_true", help="show the plant that runs in this ROS domain already")
    add("--namespace", default=NAMESPACE, help="of the actuator (default %(default)s)")
    add("--read-only", action="store_true", help="nobody can change anything; the stop button works")
    add("--hide", metavar="EFFECT", default="", help="what the guess mode hides (default: drawn)")
    add("--no-browser", action="store_true", help="print the address only")
    add_trust_option(parser)
    return parser


def _workbench(options: argparse.Namespace) -> None:
    for folder in options.open:
        if not folder.is_dir():
            raise cli.UsageError(f"--open {folder}: there is no such folder")
    middleware.set_up()
    if options.attach or "ROS_DOMAIN_ID" in os.environ:
        _serve(options, os.environ)
    else:
        with private_domain() as env:
            _serve(options, env)


def _serve(options: argparse.Namespace, env: Mapping[str, str]) -> None:
    sock = listen(options.port)
    folder = options.folder or timestamped_folder(RUNS, "workbench")
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    know_log_callers()
    asyncio.run(_run(options, Settings(folder, options.open, options.hide, options.attach), sock, env))


async def _run(options: argparse.Namespace, settings: Settings, sock: socket.socket, env: Mapping[str, str]) -> None:
    leave = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, leave.set)
    link = GraphLink("/" + options.namespace.strip("/"))
    _links.append(link)
    bench = Bench(settings, NodeCalls(link), link.ring, link.intake, env)
    server = Server(bench, Access(sock.getsockname()[1], options.read_only), sock)
    link.start(bench.heard)
    try:
        await server.begin()
        _print(server, settings.folder, env)
        if not options.no_browser and (env.get("DISPLAY") or env.get("WAYLAND_DISPLAY")):
            await asyncio.to_thread(webbrowser.open, next(iter(server.addresses().values())))
        await bench.begin()
        gc.freeze()  # looking through all that was loaded would hold up samples and stop
        await leave.wait()
    finally:
        await server.end()
        await bench.end()


def _print(server: Server, folder: Path, env: Mapping[str, str]) -> None:
    words = {"operate": "open", "watch": "to watch only"}
    for role, address in server.addresses().items():
        print(f"{words[role]}: {address}", flush=True)
    print(f"folder: {folder}   ROS domain: {env.get('ROS_DOMAIN_ID', '0')}   Ctrl-C ends it", flush=True)


if __name__ == "__main__":
    sys.exit(main())
