"""Timing of the CAN driver's node against virtual devices in another process: late cycles, jitter, load.

    python benchmarks/can_timing.py [--seconds 60] [--rate 500] [--interface udp_multicast --channel 239.74.163.2:PORT]

Late is a cycle whose SYNC was off its instant by more than a quarter of the period, whose frames were not all there in
time, or that had to be left out. A bare loop of python-can then does the same between two processes (drive and SYNC
out, five frames back), and a bare timer waits for the same instants and does nothing, so that the figures of the node
stand beside those of library and machine. All three keep idle processors awake. On SocketCAN the kernel sends the
node's SYNC; the bare loop always sends its own. Two minutes and a half of a quiet machine at the default settings.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import can

from hydraulic_can_driver.can_bus import hears_itself, open_can
from hydraulic_can_driver.supervision import LATE
from hydraulic_plant_node.pacing import Pacer, Wakefulness, request_realtime

SYNC, DRIVE, ANSWERS = 0x80, 0x510, (0x490, 0x1A0, 0x1B0, 0x1B1, 0x1B2)
WITHIN = 0.8
PATIENCE_S = 120.0


def cpu_seconds(pid: int) -> float:
    """Processor time a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def quantiles(values: list[float]) -> dict[str, float]:
    """Median, p99 and maximum."""
    ordered = sorted(values)
    return {"p50": ordered[len(ordered) // 2], "p99": ordered[int(len(ordered) * 0.99)], "max": ordered[-1]}


def said(process: subprocess.Popen[str], text: str) -> None:
    """Wait until a child has printed a line with `text`."""
    assert process.stdout is not None
    for line in process.stdout:
        if text in line:
            threading.Thread(target=process.stdout.read, daemon=True).start()
            return
    raise SystemExit(f"{process.args} ended without {text!r}")


def child(*command: str) -> subprocess.Popen[str]:
    """A child whose output is read line by line."""
    return subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)


def node(options: argparse.Namespace) -> dict[str, Any]:
    """The node's own counts after the run, and the load of both processes, per cent of a core."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from domain_coordinator import domain_id
    from rclpy.executors import SingleThreadedExecutor

    with domain_id() as domain:
        os.environ |= {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        place = ["--interface", options.interface, "--channel", options.channel]
        verb = ("-m", "hydraulic_bringup.verbs.virtual_bench")
        devices = child("-u", *verb, *place, "--rate", str(options.rate), "--model", "sample_bench")
        said(devices, "ready:")
        settings = {"interface": options.interface, "channel": options.channel, "rate": float(options.rate)}
        parameters = [text for key, value in settings.items() for text in ("-p", f"{key}:={value}")]
        driver = child("-m", "hydraulic_can_driver.nodes.can_driver", "--autostart", "--ros-args", *parameters)
        latest: dict[str, str] = {}

        def take(message: DiagnosticArray) -> None:
            for status in message.status:
                latest.update({entry.key: entry.value for entry in status.values})

        rclpy.init()
        listener = rclpy.create_node("can_timing")
        listener.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
        executor = SingleThreadedExecutor()
        executor.add_node(listener)

        def spin_until(moment: float) -> None:
            while time.monotonic() < moment:
                executor.spin_once(timeout_sec=0.2)

        deadline = time.monotonic() + PATIENCE_S
        while int(latest.get("cycles", 0)) < 2 * options.rate:
            if time.monotonic() > deadline or driver.poll() is not None:
                raise SystemExit(f"the node does not run: {latest}")
            spin_until(time.monotonic() + 0.2)
        before = dict(latest)
        used = cpu_seconds(driver.pid), cpu_seconds(devices.pid)
        began = time.monotonic()
        spin_until(began + options.seconds)
        took = time.monotonic() - began
        load = [100.0 * (cpu_seconds(p.pid) - u) / took for p, u in zip((driver, devices), used, strict=True)]
        after = dict(latest)
        for process in (driver, devices):
            process.terminate()
            process.wait(20.0)
        listener.destroy_node()
        rclpy.shutdown()
    counts = {key: int(after[key]) - int(before[key]) for key in ("cycles", "cycles_missed", "syncs_late", "skipped")}
    bad = counts["cycles_missed"] + counts["syncs_late"] + counts["skipped"]
    return {
        **counts,
        "late_percent": 100.0 * bad / max(counts["cycles"] + counts["skipped"], 1),
        "jitter_ms": {q: float(after[f"run_jitter_{q}_ms"]) for q in ("p50", "p99", "max")},
        "sync_deviation_max_ms": float(after["sync_deviation_max_ms"]),
        "sync": after["sync"],
        "scheduling": after["scheduling"],
        "bus_load_percent": float(after["bus_load_percent"]),
        "driver_cpu_percent": load[0],
        "devices_cpu_percent": load[1],
        "fault": after["fault"],
    }


def answer(options: argparse.Namespace) -> None:
    """The far end of the bare loop: five frames for every SYNC, until standard input closes."""
    request_realtime(30)
    bus = open_can(options.interface, options.channel)

    def take(message: can.Message) -> None:
        if message.arbitration_id == SYNC:
            for cob_id in ANSWERS:
                bus.send(can.Message(arbitration_id=cob_id, data=bytes(4), is_extended_id=False))

    notifier = can.Notifier(bus, [take], 0.1)
    print("ready:", flush=True)
    sys.stdin.read()
    notifier.stop()
    bus.shutdown()


def bare(options: argparse.Namespace) -> dict[str, Any]:
    """The same cycle with python-can alone: no CANopen, no ROS, no checks."""
    peer = child(__file__, "--role", "answer", "--interface", options.interface, "--channel", options.channel)
    said(peer, "ready:")
    bus = open_can(options.interface, options.channel)
    scheduling = request_realtime(20)
    here: set[int] = set()
    complete = threading.Event()

    def take(message: can.Message) -> None:
        here.add(message.arbitration_id)
        if here.issuperset(ANSWERS):
            complete.set()

    notifier = can.Notifier(bus, [take], 0.1)
    wait, period = Pacer().wait, round(1e9 / options.rate)
    origin, used, began = time.monotonic_ns() + period, time.process_time(), time.monotonic()
    jitter: list[float] = []
    late, last = 0, 0
    count = round(options.seconds * options.rate)
    for number in range(count):
        due = origin + number * period
        now = wait(due)
        jitter.append(abs(now - last - period) * 1e-6 if last else 0.0)
        last = now
        here.clear()
        complete.clear()
        for cob_id, size in ((DRIVE, 4), (SYNC, 0)):
            bus.send(can.Message(arbitration_id=cob_id, data=bytes(size), is_extended_id=False))
        in_time = complete.wait(WITHIN * period * 1e-9)
        late += not in_time or now - due > LATE * period
    load = 100.0 * (time.process_time() - used) / (time.monotonic() - began)
    notifier.stop()
    bus.shutdown()
    assert peer.stdin is not None
    peer.stdin.close()
    peer.wait(10.0)
    return {
        "cycles": count,
        "late_percent": 100.0 * late / count,
        "jitter_ms": quantiles(jitter),
        "scheduling": scheduling,
        "cpu_percent": load,
        "hears_itself": hears_itself(options.interface),
    }


def timer(options: argparse.Namespace) -> dict[str, Any]:
    """Waiting alone: what scheduler and machine leave to anybody."""
    request_realtime(20)
    wait, period = Pacer().wait, round(1e9 / options.rate)
    origin = time.monotonic_ns() + period
    count = round(options.seconds * options.rate)
    behind = [wait(origin + number * period) - origin - number * period for number in range(count)]
    late = sum(ns > LATE * period for ns in behind)
    return {"cycles": count, "late_percent": 100.0 * late / count, "behind_ms": quantiles([ns * 1e-6 for ns in behind])}


def main() -> None:
    """Run all and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=int, default=500)
    parser.add_argument("--interface", default="udp_multicast")
    parser.add_argument("--channel", default=f"239.74.163.2:{random.randrange(43200, 49000)}")
    parser.add_argument("--role", choices=("all", "answer"), default="all", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.role == "answer":
        answer(options)
        return
    figures = {"node": node(options)}
    awake = Wakefulness()
    figures |= {"bare python-can": bare(options), "bare timer": timer(options)}
    awake.release()
    for peer in ("bare python-can", "bare timer"):
        late = figures[peer]["late_percent"]
        figures["node"][f"late / {peer}"] = figures["node"]["late_percent"] / late if late else math.inf
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
