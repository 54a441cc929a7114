"""Timing of a plant node as a process among others: lost samples, period jitter, delivery.

    python benchmarks/node_timing.py [--seconds 60] [--plant hydraulic_sim.nodes.simulator]

One process is the plant, one answers every state with a command as a controller does, one takes all five
streams raw as a recorder does. The same two then listen to a bare rclpy loop that builds and publishes the
same messages, so that the figures of the node stand beside those of the middleware on this machine.
"""

from __future__ import annotations

import argparse
import json
import os
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import rclpy
from domain_coordinator import domain_id
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool

from hydraulic_interfaces.contract import find_topic, service, topic
from hydraulic_interfaces.conversions import (
    CommandEncoder,
    interface_class,
    sample_to_messages,
)
from hydraulic_interfaces.qos import profile
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.nodes.mailbox import Mailbox

STREAMS = ("state", "pressure_a", "pressure_b", "pressure_supply", "command")
PERIOD_NS = 1_000_000


def stamp_of(raw: bytes) -> int:
    """Stamp of a serialised stamped message."""
    seconds, nanoseconds = struct.unpack_from("<iI", raw, 4)
    return int(seconds * 10**9 + nanoseconds)


def percentiles(values: list[float]) -> dict[str, float]:
    """Median, p99 and maximum."""
    ordered = sorted(values)
    return {"p50": ordered[len(ordered) // 2], "p99": ordered[int(len(ordered) * 0.99)], "max": ordered[-1]}


def spin(node: rclpy.node.Node) -> None:
    """Serve a node until standard input closes."""
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not ended.is_set():
        executor.spin_once(timeout_sec=0.1)


def record() -> dict[str, object]:
    """Take all streams raw; per stream how many came and how many stamps are missing in between."""
    node = rclpy.create_node("timing_recorder", namespace="/actuator")
    boxes = {n: Mailbox(node, interface_class(find_topic(n).type), topic(n), profile(n, 5000), True) for n in STREAMS}
    stamps: dict[str, list[int]] = {name: [] for name in STREAMS}
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    while not ended.wait(0.01):
        for name, box in boxes.items():
            stamps[name].extend(map(stamp_of, box.take()))
    return {"received": {name: len(times) for name, times in stamps.items()}, "gaps": gaps(stamps)}


def gaps(stamps: dict[str, list[int]]) -> dict[str, int]:
    """Periods missing between the first and the last stamp of each stream."""
    return {
        name: round((times[-1] - times[0]) / PERIOD_NS) + 1 - len(times) if times else -1
        for name, times in stamps.items()
    }


def control(answer: bool) -> dict[str, object]:
    """Answer every state with a command; delivery is from the state's stamp to here, in ms."""
    node = rclpy.create_node("timing_controller", namespace="/actuator")
    publisher = node.create_publisher(interface_class(find_topic("command").type), topic("command"), profile("command"))
    encode = CommandEncoder("timing")
    delays: list[float] = []
    count = [0]

    def on_state(raw: bytes) -> None:
        stamp = stamp_of(raw)
        delays.append((time.time_ns() - stamp) * 1e-6)
        if answer:
            publisher.publish(encode(stamp, 0.1))
            count[0] += 1

    node.create_subscription(
        interface_class(find_topic("state").type), topic("state"), on_state, profile("state"), raw=True
    )
    spin(node)
    return {"delivery_ms": percentiles(delays), "sent": count[0]}


def bare(seconds: float) -> dict[str, object]:
    """The plainest rclpy program: build and publish the messages, sleep until the next deadline."""
    node = rclpy.create_node("bare", namespace="/actuator")
    names = STREAMS[:4]
    publishers = [node.create_publisher(interface_class(find_topic(n).type), topic(n), profile(n)) for n in names]
    while min(p.get_subscription_count() for p in publishers) < 1 or publishers[0].get_subscription_count() < 2:
        time.sleep(0.05)
    time.sleep(0.5)
    ticks: list[int] = []
    origin = time.monotonic_ns() + PERIOD_NS
    wall = time.time_ns() - time.monotonic_ns()
    for index in range(round(seconds * 1e9 / PERIOD_NS)):
        due = origin + index * PERIOD_NS
        rest = due - time.monotonic_ns()
        if rest > 0:
            time.sleep(rest * 1e-9)
        ticks.append(time.monotonic_ns())
        sample = PlantSample(due + wall, 0.0, 0.0, 0.0, 0.0, 0.0, 7e6, 7e6, 14e6)
        for publisher, message in zip(publishers, sample_to_messages(sample), strict=True):
            publisher.publish(message)
    jitter = [abs(b - a - PERIOD_NS) * 1e-6 for a, b in zip(ticks, ticks[1:], strict=False)]
    return {"jitter_ms": percentiles(jitter), "sent": len(ticks)}


def role(name: str, *arguments: str) -> subprocess.Popen[str]:
    """This file in another process, in one of the roles above."""
    command = [sys.executable, __file__, "--role", name, *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def finish(process: subprocess.Popen[str]) -> dict[str, dict[str, float]]:
    """Close the input of a role, and its result."""
    output, _ = process.communicate(timeout=60)
    return json.loads(output)


def transition(node: rclpy.node.Node, number: int) -> None:
    """One lifecycle transition of the plant."""
    ask(node, ChangeState, "/actuator/plant/change_state", transition=Transition(id=number))


def ask(node: rclpy.node.Node, kind: type, name: str, **fields: object) -> None:
    """Call a service; SystemExit if it refuses."""
    client = node.create_client(kind, name)
    if not client.wait_for_service(60.0):
        raise SystemExit(f"no service {name}")
    future = client.call_async(kind.Request(**fields))
    rclpy.spin_until_future_complete(node, future, timeout_sec=120.0)
    if future.result() is None or not future.result().success:
        raise SystemExit(f"{name} refused: {future.result()}")


def measure_plant(plant: str, seconds: float, extra: list[str]) -> dict[str, object]:
    """The plant node with a controller and a recorder."""
    program = [plant] if plant.endswith(".py") else ["-m", plant]
    process = subprocess.Popen([sys.executable, *program, *extra], stdin=subprocess.DEVNULL)
    recorder, controller = role("record"), role("control", "--answer")
    node = rclpy.create_node("timing", namespace="/actuator")
    heard = []
    kind = interface_class(find_topic("diagnostics").type)
    node.create_subscription(kind, topic("diagnostics"), heard.append, profile("diagnostics"))
    try:
        transition(node, Transition.TRANSITION_CONFIGURE)
        while node.count_subscribers(topic("state")) < 2 or node.count_subscribers(topic("command")) < 2:
            time.sleep(0.05)
        # Discovery has matched the end points here, not yet necessarily there.
        time.sleep(2.0)
        transition(node, Transition.TRANSITION_ACTIVATE)
        ask(node, SetBool, service("enable"), data=True)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.2)
        timing = next(s for m in reversed(heard) for s in m.status if s.name.endswith("timing"))
        command = next(s for m in reversed(heard) for s in m.status if s.name.endswith("command"))
        transition(node, Transition.TRANSITION_DEACTIVATE)
        time.sleep(0.5)
    finally:
        process.terminate()
        process.wait(10)
    values = {entry.key: entry.value for entry in timing.values}
    result = {"jitter_ms": {key: float(values[f"run_jitter_{key}_ms"]) for key in ("p50", "p99", "max")}}
    result |= {key: values[key] for key in ("overruns", "skipped", "lateness_max_ms")}
    result["commands"] = {e.key: e.value for e in command.values if e.value not in ("0", "")}
    return result | finish(recorder) | finish(controller)


def measure_bare(seconds: float) -> dict[str, object]:
    """The bare loop with the same listeners."""
    recorder, controller = role("record"), role("control")
    loop = role("bare", "--seconds", str(seconds))
    output, _ = loop.communicate(timeout=seconds + 60)
    time.sleep(0.5)
    return finish(recorder) | finish(controller) | json.loads(output)


def line(name: str, result: dict[str, object]) -> str:
    """One row of the table."""
    jitter, delivery, missing = result["jitter_ms"], result["delivery_ms"], dict(result["gaps"])
    # A command is lost if it was sent and not recorded, not if the controller had no state to answer.
    missing["command"] = result["sent"] - result["received"]["command"] if result["received"]["command"] else 0
    lost = sum(missing.values())
    cells = [f"{jitter[key]:8.3f}" for key in ("p50", "p99", "max")] + [f"{delivery[k]:8.3f}" for k in ("p50", "p99")]
    return f"{name:24s} {lost:6d} {' '.join(cells)}"


def main() -> int:
    """Run the benchmark, or one of its roles."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--bare-seconds", type=float, default=20.0)
    parser.add_argument("--plant", default="hydraulic_sim.nodes.simulator", help="module or script of the plant node")
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    parser.add_argument("--role", choices=("record", "control", "bare"), help=argparse.SUPPRESS)
    parser.add_argument("--answer", action="store_true", help=argparse.SUPPRESS)
    options, extra = parser.parse_known_args()
    if options.role:
        rclpy.init(args=[])
        tasks = {
            "record": record,
            "control": lambda: control(options.answer),
            "bare": lambda: bare(options.seconds),
        }
        print(json.dumps(tasks[options.role]()))
        return 0
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with domain_id() as number:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        rclpy.init(args=[])
        results = {"plant node": measure_plant(options.plant, options.seconds, extra)}
        if options.bare_seconds > 0:
            results["bare rclpy"] = measure_bare(options.bare_seconds)
    print(f"{options.seconds:g} s at 1 kHz, {os.cpu_count()} cores; five streams recorded (bare: four)")
    print(f"{'':24s} {'lost':>6s} {'period jitter p50, p99, max [ms]':>26s} {'delivery p50, p99 [ms]':>18s}")
    for name, result in results.items():
        print(line(name, result))
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
