"""Kills the processes of a running bench at random instants: 0 V within the watchdog, bag readable, next start clean.

    python benchmarks/kill_processes.py [--count 200] [--seed 2026]

Killed are in turn the plant, the recorder, and what commands: the excitation in the first half, the controller in the
second. Only what was killed is started again. After each kill is looked at:

- of what commands: when the drive in `state` is 0 V, from the kill on; at most the watchdog time and what was under way
  (``--allowance``); and that the plant goes on: how long it paused around the kill, beside how long without one;
- of the recorder: `recover` saves the bag, it can be read, no message is missing up to its last one, and that came a
  second before the kill at most;
- of the plant: the next one comes up disabled, and stays at 0 V while everybody goes on commanding, until `enable`.

Exit code 1 where something is not so.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from domain_coordinator import domain_id
from mcap.reader import make_reader
from std_msgs.msg import String

from abuse.running import SECOND, Observer, Process, RunningError
from hydraulic_control.reference_intake import PAUSE_S
from hydraulic_interfaces.contract import WATCHDOG_S, find_topic, topic
from hydraulic_interfaces.conversions import ReferenceEncoder, interface_class
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes import middleware
from hydraulic_sysid.data.bag.recovery import recover
from hydraulic_sysid.data.records import read_records

PLAN = """\
name: killed
signal: {kind: random_phase_multisine, rms: 1.0, period: 10.0, frequency_min: 0.1, frequency_max: 20.0, seed: 1}
duration: 120.0
rate: 1000.0
travel_limit: 0.6
rest_before: 0.0
"""
AMPLITUDE_M, FREQUENCY_HZ = 0.1, 0.5
PATIENCE_S = 120.0  # with a start on a busy machine
LOOK_NS = SECOND // 2
CRASH_S = 1.0  # what a crash may cost, as the recorder says


class Bench:
    """The processes, started when they are missed, and what is seen of them."""

    def __init__(self, folder: Path, rng: random.Random, allowance: float) -> None:
        self.folder, self.rng, self.allowance = folder, rng, allowance
        self.processes: dict[str, Process] = {}
        self.observer = Observer()
        self.problems: list[str] = []
        self.delays_ms: dict[str, list[float]] = {"excitation": [], "controller": []}
        self.pauses_ms: dict[str, list[float]] = {"before": [], "after": []}
        self.tails_s: list[float] = []
        self.bags = 0
        self.recorded: dict[str, int] = {}
        """Bag → stamp of the first state that the recorder said it had."""
        self.observer.node.create_subscription(String, "recorder/status", self._hear, profile("latched"))
        (folder / "plan.yaml").write_text(PLAN)
        row = find_topic("reference")
        self._references = self.observer.node.create_publisher(
            interface_class(row.type), topic("reference"), profile("reference")
        )
        self._encode = ReferenceEncoder()

    def close(self) -> None:
        """End everything."""
        for process in reversed(list(self.processes.values())):
            process.end()
        self.observer.close()

    def start(self, name: str) -> None:
        """Start a process."""
        module, parameters, options = {
            "plant": ("hydraulic_sim.nodes.simulator", (), ("--autostart",)),
            "recorder": ("hydraulic_sysid.nodes.recorder", (f"output:={self.bag}",), ()),
            "excitation": ("hydraulic_sysid.nodes.excitation", self._played(), ()),
            "controller": (
                "hydraulic_control.nodes.controller",
                ("autostart:=true", "gains:=npid", "age_limit:=0.5"),
                (),
            ),
        }[name]
        self.processes[name] = Process(name, self.folder, module, *parameters, options=options)

    @property
    def bag(self) -> Path:
        """What is being recorded."""
        return self.folder / f"bag{self.bags}"

    def _hear(self, message: String) -> None:
        said = json.loads(message.data)
        if said.get("reached_ns"):
            self.recorded.setdefault(said["output"], said["reached_ns"])

    def _played(self) -> tuple[str, ...]:
        return f"plan:={self.folder / 'plan.yaml'}", "autostart:=true", "exit_when_done:=true", "start_timeout:=60.0"

    def refer(self) -> None:
        """A reference of this instant."""
        now = time.time_ns()
        phase = 2.0 * math.pi * FREQUENCY_HZ * (now % (100 * SECOND)) / SECOND
        speed = 2.0 * math.pi * FREQUENCY_HZ * AMPLITUDE_M * math.cos(phase)
        self._references.publish(self._encode(now, AMPLITUDE_M * math.sin(phase), speed))

    def bring_up(self, source: str) -> None:
        """Everything runs, the plant is enabled and moves, and that is recorded."""
        for other in {"excitation", "controller"} - {source}:
            if other in self.processes:
                self.processes[other].end()
        for name in ("plant", "recorder", source):
            if name not in self.processes or not self.processes[name].runs:
                self.start(name)
        self.observer.wait(lambda: self.observer.plant_state(PATIENCE_S) == "active", "an active plant", PATIENCE_S)
        self.observer.enable()
        deadline = time.monotonic() + PATIENCE_S
        while not self.moves():
            if time.monotonic() > deadline:
                said = " | ".join(self.processes[source].said.splitlines()[-4:])
                raise RunningError(f"no drive of the {source} within {PATIENCE_S:g} s; it says: {said}")
            if not self.processes[source].runs:  # an excitation that gave up a plant which was killed
                self.start(source)
            if source == "controller":  # a reference that it has dropped is followed anew after a pause
                self.observer.each = lambda: None
                time.sleep(2.0 * PAUSE_S)
                self.observer.each = self.refer
            with contextlib.suppress(RunningError):
                self.observer.wait(self.moves, "a drive", 8.0)
        self.observer.wait(lambda: str(self.bag) in self.recorded, "a recorder that has states", PATIENCE_S)

    def moves(self) -> bool:
        """Whether a drive has been applied within the last tenth of a second."""
        return any(abs(drive) > 0.02 for _, _, drive, _ in self.observer.since(time.time_ns() - SECOND // 10))

    def kill(self, victim: str) -> None:
        """Kill, and look."""
        time.sleep(self.rng.uniform(0.0, 1.5))
        at = self.processes[victim].kill()
        if victim == "plant":
            self._after_plant()
        elif victim == "recorder":
            self._after_recorder(at)
        else:
            self._after_source(victim, at)

    def _after_source(self, victim: str, at: int) -> None:
        self.observer.wait(lambda: self.observer.since(at + LOOK_NS), f"states after the kill of the {victim}")
        seen = self.observer.since(at)
        last = max((stamp for _, stamp, drive, _ in seen if drive != 0.0), default=at)
        delay = (last - at) / SECOND
        self.delays_ms[victim].append(1e3 * delay)
        self.pauses_ms["before"].append(self._longest_pause(at - LOOK_NS, at))
        self.pauses_ms["after"].append(self._longest_pause(at, at + LOOK_NS))
        if delay > WATCHDOG_S + self.allowance:
            self.problems.append(f"{victim}: a drive was applied {1e3 * delay:.1f} ms after the kill")

    def _longest_pause(self, begin: int, end: int) -> float:
        """Between two states [ms]."""
        stamps = np.array([stamp for _, stamp, _, _ in self.observer.since(begin)])
        first = int(np.searchsorted(stamps, end))
        return float(1e-6 * np.diff(stamps[: first + 1]).max(initial=0))

    def _after_plant(self) -> None:
        begun = time.time_ns()
        self.start("plant")
        self.observer.wait(lambda: len(self.observer.since(begun)) > 300, "states of the next plant", PATIENCE_S)
        driven = [drive for _, _, drive, _ in self.observer.since(begun) if drive != 0.0]
        if driven:
            self.problems.append(f"plant: the next one applied {max(map(abs, driven)):.3g} V before it was enabled")

    def _after_recorder(self, at: int) -> None:
        bag = self.bag
        self.bags += 1
        last = self.recorded[str(bag)]
        try:
            recover(bag)
            runs = _sequences(bag)
            for publisher, numbers in enumerate(runs):
                counted = np.unique([number for number, _ in numbers])
                last = max(last, *(stamp for _, stamp in numbers))
                if lost := int(np.ptp(counted)) + 1 - counted.size:
                    self.problems.append(f"recorder: {lost} messages are missing in {bag.name}, run {publisher}")
            # Where a plant was killed or held up, a new record begins.
            for record in read_records(bag, "split") if runs else ():
                if not all(np.isfinite(values).all() for values in record.channels.values()):
                    self.problems.append(f"recorder: {record.name} is not finite")
        except HydraulicError as error:
            self.problems.append(f"recorder: {error}")
        self.tails_s.append((at - last) / SECOND)
        if self.tails_s[-1] > CRASH_S:
            self.problems.append(f"recorder: {bag.name} ends {self.tails_s[-1]:.2f} s before the kill")
        shutil.rmtree(bag)


def _sequences(bag: Path) -> list[list[tuple[int, int]]]:
    """Publisher's counts and stamps of `state`, for each plant that there was: its count begins anew."""
    runs: list[list[tuple[int, int]]] = [[]]
    with next(bag.glob("*.mcap")).open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages([topic("state")], log_time_order=False):
            if runs[-1] and message.sequence < runs[-1][-1][0]:
                runs.append([])
            runs[-1].append((message.sequence, message.publish_time))
    return [run for run in runs if run]


def run(bench: Bench, count: int) -> int:
    """Kill so many; how many it was."""
    done = told = 0
    for source in ("excitation", "controller"):
        victims = [victim for victim in ("plant", "recorder", source, source) for _ in range(-(-count // 8))]
        bench.rng.shuffle(victims)
        for victim in victims[: count - count // 2 if source == "excitation" else count // 2]:
            try:
                bench.bring_up(source)
                bench.kill(victim)
            except RunningError as error:
                bench.problems.append(f"before or after the kill of the {victim}: {error}")
                if len(bench.problems) > 10:
                    return done
            done += 1
            print(f"{done} of {count}: {victim}", *bench.problems[told:], file=sys.stderr, sep="; ", flush=True)
            told = len(bench.problems)
    return done


def main() -> int:
    """Run and print; 1 for any problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="kills (default 200)")
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--allowance", type=float, default=0.01, help="beyond the watchdog [s] (default 0.01)")
    options = parser.parse_args()
    middleware.set_up()
    began = time.monotonic()
    with domain_id() as domain, tempfile.TemporaryDirectory() as name:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        bench = Bench(Path(name), random.Random(options.seed), options.allowance)
        try:
            done = run(bench, options.count)
        finally:
            bench.close()
        tracebacks = [log.name for log in Path(name).glob("*.log") if "Traceback" in log.read_text(errors="replace")]
    print(f"seed {options.seed}: {done} kills in {time.monotonic() - began:.0f} s")
    for victim, delays in bench.delays_ms.items():
        if delays:
            figures = f"{statistics.median(delays):.1f} ms after the kill, at most {max(delays):.1f} ms"
            print(f"  {victim:<11} {len(delays):>3} times: last drive {figures}")
    for when, pauses in bench.pauses_ms.items():
        if pauses:
            figures = f"{statistics.median(pauses):.1f} ms in the median, {max(pauses):.1f} ms at most"
            print(f"  plant       longest pause within {LOOK_NS / SECOND:g} s {when} a kill: {figures}")
    if tails := bench.tails_s:
        figures = f"{statistics.median(tails):.2f} s before the kill, at most {max(tails):.2f} s"
        print(f"  recorder    {len(tails):>3} times: the bag ends {figures}")
    bench.problems += [f"a traceback in {log}" for log in tracebacks]
    print(f"  problems: {len(bench.problems)}", *bench.problems, sep="\n  ")
    return 1 if bench.problems else 0


if __name__ == "__main__":
    sys.exit(main())
