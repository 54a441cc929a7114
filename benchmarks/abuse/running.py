"""A bench of real processes for benchmarks: start, kill, hear what the plant does, call its services."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from lifecycle_msgs.srv import GetState
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool, Trigger

from hydraulic_interfaces.contract import PLANT_NODE, absolute, find_topic, service, topic
from hydraulic_interfaces.conversions import interface_class
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes.mailbox import Mailbox

SECOND = 1_000_000_000
Sample = tuple[int, int, float, float]
"""Arrival and stamp [ns], drive [V], position [m]."""


class RunningError(RuntimeError):
    """The bench did not come to what was waited for."""


class Process:
    """A node as a process of its own, its output in a file."""

    def __init__(self, name: str, folder: Path, module: str, *parameters: str, options: tuple[str, ...] = ()) -> None:
        self.name, self.module = name, module
        self.log = folder / f"{name}.log"
        arguments = [argument for parameter in parameters for argument in ("-p", parameter)]
        with self.log.open("ab") as sink:
            command = [sys.executable, "-m", module, *options, "--ros-args", *arguments]
            self.popen = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=sink, stderr=subprocess.STDOUT)

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self.popen.poll() is None

    def kill(self) -> int:
        """SIGKILL; the wall clock [ns] just before it."""
        at = time.time_ns()
        self.popen.kill()
        self.popen.wait(60.0)
        return at

    def end(self, patience: float = 20.0) -> int:
        """Ask it to end; its exit code."""
        if self.runs:
            self.popen.send_signal(signal.SIGINT)
            try:
                self.popen.wait(patience)
            except subprocess.TimeoutExpired:
                self.kill()
        return int(self.popen.returncode)

    @property
    def said(self) -> str:
        """All that it printed."""
        return self.log.read_text(errors="replace")


class Observer:
    """A node beside the bench: keeps what the plant says, calls services, publishes what it is told to."""

    def __init__(self) -> None:
        rclpy.init(args=[])
        self.node = rclpy.create_node("observer", namespace="/actuator")
        kind = interface_class(find_topic("state").type)
        self._box = Mailbox(self.node, kind, topic("state"), profile("state", 5000))
        self.samples: deque[Sample] = deque(maxlen=100_000)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._leaving = threading.Event()
        self.each: Callable[[], None] = lambda: None
        """Called some 200 times a second."""
        self._threads = [threading.Thread(target=run, daemon=True) for run in (self._listen, self._spin)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Leave the graph."""
        self._leaving.set()
        for thread in self._threads:
            thread.join(5.0)
        self._executor.shutdown()
        with contextlib.suppress(Exception):
            self.node.destroy_node()
        rclpy.try_shutdown()

    def call(self, kind: Any, name: str, patience: float = 30.0, **fields: Any) -> Any:
        """The answer of a service, asked again where none comes.

        :raises RunningError: there is none.
        """
        client = self.node.create_client(kind, name)
        deadline = time.monotonic() + patience
        try:
            while time.monotonic() < deadline:
                if client.wait_for_service(timeout_sec=0.5):
                    future = client.call_async(kind.Request(**fields))
                    asked = time.monotonic()
                    while not future.done() and time.monotonic() < min(asked + 5.0, deadline):
                        time.sleep(0.005)
                    if future.done():
                        return future.result()
        finally:
            self.node.destroy_client(client)
        raise RunningError(f"{name} did not answer within {patience:g} s")

    def enable(self) -> None:
        """Let commands through, after a reset where something is latched."""
        if not self.call(SetBool, service("enable"), data=True).success:
            self.call(Trigger, service("reset"))
            answer = self.call(SetBool, service("enable"), data=True)
            if not answer.success:
                raise RunningError(f"the plant cannot be enabled: {answer.message}")

    def plant_state(self, patience: float = 30.0) -> str:
        """Lifecycle state of the plant."""
        answer = self.call(GetState, f"{absolute(PLANT_NODE)}/get_state", patience)
        return str(answer.current_state.label)

    def since(self, stamp_ns: int) -> list[Sample]:
        """Samples stamped later."""
        return [sample for sample in list(self.samples) if sample[1] > stamp_ns]

    def wait(self, condition: Callable[[], object], what: str, patience: float = 60.0) -> None:
        """Until the condition holds.

        :raises RunningError: it does not.
        """
        deadline = time.monotonic() + patience
        while not condition():
            if time.monotonic() > deadline:
                raise RunningError(f"waited {patience:g} s in vain for {what}")
            time.sleep(0.01)

    def _listen(self) -> None:
        while not self._leaving.is_set():
            for message in self._box.take():
                stamp = message.header.stamp
                at = stamp.sec * SECOND + stamp.nanosec
                self.samples.append((time.time_ns(), at, message.effort[1], message.position[0]))
            self.each()
            time.sleep(0.005)

    def _spin(self) -> None:
        while not self._leaving.is_set():
            self._executor.spin_once(timeout_sec=0.1)


def memory_mb(pid: int) -> float:
    """Resident memory of a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
