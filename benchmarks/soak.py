"""A bench at 1 kHz for a long time under load: memory, lost messages, missed instants.

    python benchmarks/soak.py [--minutes 30] [--load N]

Simulator, controller (on a moving reference), estimator and recorder run as processes of their own; ``--load``
further processes keep a core busy each (default: as many as the machine has). Every 10 s the resident memory of each
process is read. Its growth is the slope of a straight line from the third minute on (the last half of a shorter run);
flat is less than ``--flat`` MB in 10 minutes. Lost is what the publisher has counted and the bag does not hold.
Exit code 1 where memory grows, a message is lost, a process ends or prints a traceback.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from domain_coordinator import domain_id
from mcap.reader import make_reader

from abuse.running import SECOND, Observer, Process, memory_mb
from hydraulic_interfaces.contract import find_topic, topic
from hydraulic_interfaces.conversions import ReferenceEncoder, interface_class
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes import middleware

STREAMS = ("state", "pressure_a", "pressure_b", "pressure_supply", "command")
PERIOD_S = 10.0
BUSY = "while True: sum(range(1000))"


def start(folder: Path) -> list[Process]:
    """The nodes."""
    return [
        Process("plant", folder, "hydraulic_sim.nodes.simulator", options=("--autostart",)),
        Process("recorder", folder, "hydraulic_sysid.nodes.recorder", f"output:={folder / 'bag'}"),
        Process("estimator", folder, "hydraulic_sysid.nodes.estimator"),
        Process(
            "controller",
            folder,
            "hydraulic_control.nodes.controller",
            "autostart:=true",
            "gains:=npid",
            "age_limit:=0.5",
        ),
    ]


def slope(times: list[float], values: list[float]) -> float:
    """Growth per 10 minutes, of the part that counts."""
    begin = min(180.0, 0.5 * times[-1])
    chosen = [(t, v) for t, v in zip(times, values, strict=True) if t >= begin]
    if len(chosen) < 3:
        return math.nan
    return float(600.0 * np.polyfit(*zip(*chosen, strict=True), 1)[0])


def lost(bag: Path) -> dict[str, tuple[int, int]]:
    """Messages of each stream, and how many are missing by the publisher's count."""
    names = {topic(name): name for name in STREAMS}
    numbers: dict[str, list[int]] = {name: [] for name in STREAMS}
    with next(bag.glob("*.mcap")).open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(list(names), log_time_order=False):
            numbers[names[channel.topic]].append(message.sequence)
    counted = {name: np.unique(found) for name, found in numbers.items()}
    return {name: (len(found), int(np.ptp(found)) + 1 - len(found)) for name, found in counted.items() if len(found)}


class Run:
    """The bench while it runs."""

    def __init__(self, folder: Path, load: int) -> None:
        self.processes = start(folder)
        self.busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(load)]
        self.observer = Observer()
        row = find_topic("reference")
        node = self.observer.node
        self._references = node.create_publisher(interface_class(row.type), topic("reference"), profile("reference"))
        self._encode = ReferenceEncoder()
        self.timing: dict[str, str] = {}
        node.create_subscription(DiagnosticArray, topic("diagnostics"), self._hear, profile("diagnostics"))
        self.times: list[float] = []
        self.memory: dict[str, list[float]] = {process.name: [] for process in self.processes}

    def begin(self) -> None:
        """Until everything moves."""
        self.observer.wait(lambda: self.observer.plant_state(120.0) == "active", "an active plant", 120.0)
        self.observer.each = self._refer
        self.observer.enable()
        moves = lambda: any(abs(drive) > 0.02 for _, _, drive, _ in list(self.observer.samples)[-200:])  # noqa: E731
        self.observer.wait(moves, "a drive", 120.0)

    def watch(self, seconds: float) -> None:
        """Look at the memory from time to time; ends early where a process does."""
        began = time.monotonic()
        while (passed := time.monotonic() - began) < seconds and all(p.runs for p in self.processes):
            self.times.append(passed)
            for process in self.processes:
                self.memory[process.name].append(memory_mb(process.popen.pid))
            time.sleep(min(PERIOD_S, seconds / 6.0, max(seconds - passed, 0.0)))

    def end(self) -> dict[str, int]:
        """Exit codes."""
        self.observer.each = lambda: None
        for busy in self.busy:
            busy.kill()
            busy.wait()
        codes = {process.name: process.end(60.0) for process in reversed(self.processes)}
        self.observer.close()
        return codes

    def _refer(self) -> None:
        now = time.time_ns()
        phase = math.pi * (now % (100 * SECOND)) / SECOND
        self._references.publish(self._encode(now, 0.1 * math.sin(phase), 0.1 * math.pi * math.cos(phase)))

    def _hear(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("timing") and "plant" in status.name:
                self.timing = {entry.key: entry.value for entry in status.values}


def main() -> int:
    """Run and print; 1 for any problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--load", type=int, default=os.cpu_count() or 1, help="busy processes beside the bench")
    parser.add_argument("--flat", type=float, default=2.0, help="growth that counts as none [MB in 10 min] (default 2)")
    options = parser.parse_args()
    middleware.set_up()
    problems: list[str] = []
    with domain_id() as domain, tempfile.TemporaryDirectory() as name:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        run = Run(Path(name), options.load)
        try:
            run.begin()
            run.watch(60.0 * options.minutes)
        finally:
            codes = run.end()
        counted = lost(Path(name) / "bag")
        problems += [f"{process} ended with code {code}" for process, code in codes.items() if code]
        problems += [f"a traceback in {log.name}" for log in Path(name).glob("*.log") if "Traceback" in log.read_text()]
    print(f"{run.times[-1] / 60.0:.1f} min at 1 kHz, {options.load} busy processes beside, {os.cpu_count()} cores")
    places = [round(part * (len(run.times) - 1) / 5.0) for part in range(6)]
    print(f"{'MB after [min]':<16}", *(f"{run.times[place] / 60.0:>7.1f}" for place in places), " MB/10 min")
    for process, values in run.memory.items():
        growth = slope(run.times, values)
        print(f"{process:<16}", *(f"{values[place]:>7.1f}" for place in places), f"{growth:>10.2f}")
        if growth > options.flat:
            problems.append(f"the {process} grows by {growth:.2f} MB in 10 minutes, flat is {options.flat:g}")
    print(f"{'topic':<16} {'messages':>9} {'lost':>6}")
    for stream, (count, missing) in counted.items():
        print(f"{stream:<16} {count:>9} {missing:>6}")
        if missing:
            problems.append(f"{missing} messages of {stream} are lost")
    if "state" not in counted:
        problems.append("no state was recorded")
    kept = ("overruns", "skipped", "lateness_max_ms", "run_jitter_p99_ms")
    print("plant: ", ", ".join(f"{key} {run.timing[key]}" for key in kept if key in run.timing))
    print(f"problems: {len(problems)}", *problems, sep="\n  ")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
