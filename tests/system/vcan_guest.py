"""What runs on the machine with the CAN interface: virtual devices, driver node, recorder, excitation and candump.

    python vcan_guest.py CHANNEL FOLDER

One process imports everything and forks the others, since importing is what takes longest on an emulated machine. Into
FOLDER go the frames as candump saw them, the bag, the logs, and `result.json` with the exit codes.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import hydraulic_sysid.nodes.excitation
import hydraulic_sysid.nodes.recorder
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.nodes import can_driver
from hydraulic_can_driver.virtual import Reading, VirtualBench
from hydraulic_node_utils.nodes.log_callers import know_log_callers
from hydraulic_node_utils.scheduling import request_realtime

# What the virtual hydraulics do; the identification has to find it.
GAIN, LAG, START = 0.02, 0.6, 0.1  # (m/s)/V, s, m
LISTENERS = Path("/proc/net/can/rcvlist_all")  # who receives every frame of an interface: candump, once it is up
READY_S, RUN_S, END_S = 200.0, 500.0, 60.0


class FirstOrderCylinder:
    """Velocity follows GAIN · drive with the time constant LAG, exactly."""

    def __init__(self) -> None:
        self._position, self._velocity = START, 0.0

    def step(self, drive: float, dt: float) -> Reading:
        now = Reading(self._position, self._velocity, 7e6, 7e6, 14e6, drive / 10.0)
        goal, decay = GAIN * drive, math.exp(-dt / LAG)
        self._position += goal * dt + (self._velocity - goal) * LAG * (1.0 - decay)
        self._velocity = goal + (self._velocity - goal) * decay
        return now


class Children:
    """Forked processes, each with a log of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.codes: dict[str, int] = {}
        self._running: dict[str, int] = {}

    def start(self, name: str, program: Callable[[], int]) -> None:
        pid = os.fork()
        if pid:
            self._running[name] = pid
            return
        sink = os.open(self._folder / f"{name}.log", os.O_WRONLY | os.O_CREAT)
        os.dup2(sink, 1)
        os.dup2(sink, 2)
        code = 70
        try:
            code = program()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)

    def log(self, name: str) -> str:
        path = self._folder / f"{name}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    def wait(self, name: str, patience: float) -> int | None:
        """Exit code once it has ended; None if it does not in time. Another one that fails ends the waiting."""
        end = time.monotonic() + patience
        while name not in self.codes and time.monotonic() < end:
            self._reap()
            if any(self.codes.values()):
                break
            time.sleep(0.25)
        return self.codes.get(name)

    def until(self, condition: Callable[[], object], patience: float) -> None:
        """Wait; gives up when a child has ended."""
        end = time.monotonic() + patience
        while not condition() and time.monotonic() < end and not self.codes:
            self._reap()
            time.sleep(0.25)

    def interrupt(self, name: str) -> None:
        if name in self._running:
            os.kill(self._running[name], signal.SIGINT)
            self.wait(name, END_S)

    def kill(self) -> None:
        for pid in self._running.values():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def _reap(self) -> None:
        for name, pid in list(self._running.items()):
            ended, status = os.waitpid(pid, os.WNOHANG)
            if ended:
                del self._running[name]
                self.codes[name] = os.waitstatus_to_exitcode(status)


def devices(folder: Path, channel: str) -> int:
    """The virtual devices; says at the end in which state they were left."""
    leave = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: leave.set())
    bench = VirtualBench(replace(load_bus(folder / "bus.yaml"), channel=channel), None, FirstOrderCylinder())
    request_realtime(30)  # devices do not wait for each other's programs; the bench's threads inherit it
    with bench:
        print("ready", flush=True)
        leave.wait()
        left = {"drive": bench.drive, "state": bench.valve.machine.state.label, "position": bench.reading.position}
        left |= {"error": str(bench.error or ""), "syncs": bench.syncs}
        (folder / "devices.json").write_text(json.dumps(left))
    return 0


def parameters(**values: object) -> list[str]:
    """Command line of a node."""
    settings = [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
    return ["--ros-args", *settings]


def run(channel: str, folder: Path, children: Children) -> None:
    """Those that listen first: they start while nothing keeps the processors busy yet."""
    recorder = parameters(output=folder / "bag", stop_on_experiment_end=True, exit_when_done=True)
    children.start("recorder", lambda: hydraulic_sysid.nodes.recorder.main(recorder))
    # Commands are some samples under way here: not a plant that does something else for 0.6 s.
    excitation = parameters(
        plan=folder / "plan.yaml", autostart=True, exit_when_done=True, listeners=2, start_timeout=RUN_S,
        state_timeout=10.0, applied_tolerance=10.0,
    )  # fmt: skip
    children.start("excitation", lambda: hydraulic_sysid.nodes.excitation.main(excitation))
    children.start("devices", lambda: devices(folder, channel))
    children.until(lambda: "ready" in children.log("devices") and (folder / "bag").exists(), READY_S)
    plant = parameters(bus=folder / "bus.yaml", channel=channel, watchdog=10.0, enable_on_activate=True)
    children.start("plant", lambda: can_driver.main(["--autostart", *plant]))
    children.wait("excitation", RUN_S)
    children.wait("recorder", END_S)
    children.interrupt("plant")
    children.interrupt("devices")


def listened_to(channel: str) -> bool:
    """Whether somebody receives every frame of the interface."""
    lines = LISTENERS.read_text().splitlines()
    return any(line.split()[:1] == [channel] for line in lines)


def main() -> int:
    channel, folder = sys.argv[1], Path(sys.argv[2])
    begun = time.monotonic()
    know_log_callers()  # forked, the others know it
    with (folder / "candump.log").open("wb") as sink:
        # -L: log format, with the kernel's time of reception to the microsecond.
        witness = subprocess.Popen(["candump", "-L", channel], stdout=sink)
        children = Children(folder)
        children.until(lambda: listened_to(channel), READY_S)
        try:
            run(channel, folder, children)
        finally:
            children.kill()
            witness.terminate()
            witness.wait()
    result = {"codes": children.codes, "seconds": time.monotonic() - begun}
    (folder / "result.json").write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
