"""What the recorder loses and costs: state, three pressures and command at 1 kHz, as real processes.

    python benchmarks/recorder.py [--seconds 60] [--keep FOLDER]

The simulator is excited for the given time and recorded; what is lost is counted in the bag itself. Processor time
is that of the whole process, from its start to its exit: the share of a short run includes loading Python and ROS.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from domain_coordinator import domain_id
from mcap.reader import make_reader

from hydraulic_interfaces.contract import topic
from hydraulic_sysid.data.records import Record, read_records, to_bag

STREAMS = ("state", "pressure_a", "pressure_b", "pressure_supply", "command")
PERIOD_NS = 1_000_000

PLAN = """\
name: recorder_benchmark
signal: {{kind: random_phase_multisine, rms: 1.0, period: 10.0, frequency_min: 0.1, frequency_max: 80.0, seed: 1}}
duration: {seconds}
rate: 1000.0
fade_in: 0.25
fade_out: 0.25
centre: 0.0
centring_gain: 2.0
centring_limit: 0.5
travel_limit: 0.6
"""


def start(module: str, *parameters: str, options: tuple[str, ...] = ()) -> subprocess.Popen[bytes]:
    """A node as a process of its own."""
    arguments = [argument for parameter in parameters for argument in ("-p", parameter)]
    return subprocess.Popen([sys.executable, "-m", module, *options, "--ros-args", *arguments])


def record(folder: Path, seconds: float) -> dict[str, float]:
    """Record an experiment into ``folder``/bag; processor time and memory of the recorder."""
    plan = folder / "plan.yaml"
    plan.write_text(PLAN.format(seconds=seconds))
    plant = start("hydraulic_sim.nodes.simulator", "enable_on_activate:=true", options=("--autostart",))
    began = time.monotonic()
    recorder = start(
        "hydraulic_sysid.nodes.recorder",
        f"output:={folder / 'bag'}",
        "stop_on_experiment_end:=true",
        "exit_when_done:=true",
    )
    excitation = start(
        "hydraulic_sysid.nodes.excitation",
        f"plan:={plan}",
        "autostart:=true",
        "exit_when_done:=true",
        "listeners:=2",
        "start_timeout:=60.0",
    )
    try:
        if excitation.wait(seconds + 120.0):
            recorder.send_signal(signal.SIGINT)
            raise SystemExit("the excitation was not finished; see above")
        _, status, usage = os.wait4(recorder.pid, 0)
        recorder.returncode = os.waitstatus_to_exitcode(status)
        if recorder.returncode:
            raise SystemExit(f"the recorder ended with code {recorder.returncode}")
    finally:
        for process in (plant, recorder, excitation):
            if process.poll() is None:
                process.terminate()
                process.wait(10)
    wall = time.monotonic() - began
    return {"cpu_s": usage.ru_utime + usage.ru_stime, "wall_s": wall, "memory_mb": usage.ru_maxrss / 1024}


def completeness(bag: Path) -> None:
    """Messages of every stream, and how many are missing between the first and the last one.

    "lost" goes by the publisher's count of its messages, which is kept with each; "not sampled" by the stamps: an
    excitation that is held up leaves states unanswered.
    """
    numbers: dict[str, list[int]] = {name: [] for name in STREAMS}
    stamps: dict[str, list[int]] = {name: [] for name in STREAMS}
    names = {topic(name): name for name in STREAMS}
    with next(bag.glob("*.mcap")).open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(list(names), log_time_order=False):
            numbers[names[channel.topic]].append(message.sequence)
            stamps[names[channel.topic]].append(message.publish_time)
    print(f"{'topic':<16} {'messages':>9} {'lost':>6} {'not sampled':>12}")
    for name in STREAMS:
        counted, times = np.unique(numbers[name]), np.unique(stamps[name])
        lost = int(np.ptp(counted)) + 1 - counted.size
        unsampled = round(np.ptp(times) / PERIOD_NS) + 1 - times.size - lost
        print(f"{name:<16} {len(numbers[name]):>9} {lost:>6} {unsampled:>12}")


def timed_reading(bag: Path) -> Record:
    """The longest record in the bag, and how long reading it took."""
    began = time.perf_counter()
    records = read_records(bag, "split")
    longest = max(records, key=len)
    print(f"read in {time.perf_counter() - began:.2f} s: {len(records)} record(s), the longest {longest.duration:g} s")
    return longest


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--keep", type=Path, help="put the bag here")
    options = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with domain_id() as domain, tempfile.TemporaryDirectory() as name:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        folder = Path(name)
        cost = record(folder, options.seconds)
        completeness(folder / "bag")
        size = sum(file.stat().st_size for file in (folder / "bag").iterdir())
        share = 100.0 * cost["cpu_s"] / cost["wall_s"]
        print(f"recorder: {cost['cpu_s']:.1f} s processor over {cost['wall_s']:.1f} s ({share:.0f} % of one core)")
        print(f"          {cost['memory_mb']:.0f} MB memory, bag of {size / 1e6:.1f} MB")
        again = to_bag(timed_reading(folder / "bag"), folder / "again")
        timed_reading(again)
        if options.keep:
            shutil.copytree(folder / "bag", options.keep)
    return 0


if __name__ == "__main__":
    sys.exit(main())
