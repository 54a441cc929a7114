"""How long an emergency stop takes: from the call of the service to 0 V in `state`, as a distribution.

    python benchmarks/emergency_stop.py [--stops 200] [--seed 1] [--only simulator]

The plant, a source that drives it with ±2 V for every state, and the one who stops it are processes of their own, by
the wall clock. A stop comes at a random instant while the piston moves; it counts from the moment before the request is
sent. "In state" is the stamp of the first state with 0 V, "heard" the moment at which that state has arrived; a later
state with a drive ends the benchmark. Plants: the simulator at 1 kHz, and the CAN driver with virtual devices at 500 Hz
over `udp_multicast`, and over SocketCAN where this kernel has a `vcan` interface that is up
(`ip link add dev vcan0 type vcan && ip link set vcan0 up`). Half a minute each.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

LIMIT_MS = 10.0
DRIVE_V = 2.0
MODEL = "sample_bench"
START_S, ANSWER_S, QUIET_S = 120.0, 10.0, 0.03
SOURCE = "emergency_stop"
DEVICES = "hydraulic_bringup.verbs.virtual_bench"
PLANTS = ("simulator", "udp_multicast", "vcan")
QUIETLY = ("--ros-args", "--log-level", "error")


def source() -> None:
    """Answer every state with a drive towards the middle of the stroke, until standard input closes."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from hydraulic_interfaces.contract import topic
    from hydraulic_interfaces.conversions import CommandEncoder, from_time, interface_class
    from hydraulic_interfaces.qos import profile
    from node_timing import spin

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node, joints = rclpy.create_node("emergency_stop_source"), interface_class("sensor_msgs/msg/JointState")
    publisher, encode = node.create_publisher(joints, topic("command"), profile("command")), CommandEncoder(SOURCE)

    def answer(state: Any) -> None:
        publisher.publish(encode(from_time(state.header.stamp), -DRIVE_V if state.position[0] > 0.0 else DRIVE_V))

    node.create_subscription(joints, topic("state"), answer, profile("state", 10))
    spin(node)


class Stopper:
    """A node that enables, stops and watches the plant from one thread."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from std_srvs.srv import SetBool, Trigger

        from hydraulic_interfaces.contract import service, topic
        from hydraulic_interfaces.conversions import from_time, interface_class
        from hydraulic_interfaces.qos import profile
        from hydraulic_node_utils.nodes.mailbox import Mailbox

        self._node, self._stamp = rclpy.create_node("emergency_stop_benchmark"), from_time
        joints = interface_class("sensor_msgs/msg/JointState")
        self._states = Mailbox(self._node, joints, topic("state"), profile("state", 1000))
        kinds = {"enable": SetBool, "emergency_stop": Trigger, "reset": Trigger}
        self._clients = {name: self._node.create_client(kind, service(name)) for name, kind in kinds.items()}
        self._kinds = kinds
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()

    def until(self, found: Any, patience: float, what: str) -> None:
        """Take states until `found(stamp, drive, heard)`, times in ns, is true of one."""
        give_up = time.monotonic() + patience
        while time.monotonic() < give_up:
            self._states.wait(0.01)
            for state in self._states.take():
                if found(self._stamp(state.header.stamp), state.effort[1], time.time_ns()):
                    return
        raise SystemExit(f"waited {patience:g} s in vain for {what}")

    def ask(self, name: str, **fields: object) -> Any:
        """Call a service; its answer, which must be yes."""
        if not self._clients[name].wait_for_service(START_S):
            raise SystemExit(f"no service {name}")
        future = self._clients[name].call_async(self._kinds[name].Request(**fields))
        self._executor.spin_until_future_complete(future, timeout_sec=ANSWER_S)
        if future.result() is None or not future.result().success:
            raise SystemExit(f"{name}: {future.result() or f'no answer within {ANSWER_S:g} s'}")
        return future

    def drive(self) -> None:
        """Have the plant driven: the service refuses until it is active, and the source is found."""
        give_up = time.monotonic() + START_S
        while True:
            try:
                self.ask("reset")
                self.ask("enable", data=True)
                break
            except SystemExit:
                if time.monotonic() > give_up:
                    raise
                time.sleep(0.2)
        self.until(lambda _, drive, __: abs(drive) > 0.5 * DRIVE_V, START_S, "a plant that is driven")

    def stop(self, wait: float) -> tuple[float, float]:
        """Stop the plant after `wait` [s]; time to 0 V in `state` and until that is heard [ms]."""
        end = time.time_ns() + round(wait * 1e9)
        self.until(lambda _, __, heard: heard > end, ANSWER_S, "states")
        called = time.time_ns()
        future = self._clients["emergency_stop"].call_async(self._kinds["emergency_stop"].Request())
        zero: list[int] = []

        def at_rest(stamp: int, drive: float, heard: int) -> bool:
            if drive == 0.0 and not zero and stamp >= called:
                zero.extend((stamp, heard))
            elif drive != 0.0 and zero:
                raise SystemExit(f"{drive:g} V {1e-6 * (stamp - zero[0]):.1f} ms after the stop")
            return bool(zero) and stamp > zero[0] + QUIET_S * 1e9

        self.until(at_rest, ANSWER_S, "0 V after the emergency stop")
        self._executor.spin_until_future_complete(future, timeout_sec=ANSWER_S)
        if future.result() is None or not future.result().success:
            raise SystemExit(f"emergency_stop: {future.result()}")
        stamp, heard = zero
        return 1e-6 * (stamp - called), 1e-6 * (heard - called)


@contextlib.contextmanager
def processes(*commands: Sequence[str]) -> Iterator[None]:
    """Children that are ended, last first; virtual devices are ready before the next one starts."""
    children: list[subprocess.Popen[str]] = []
    try:
        for command in commands:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            children.append(subprocess.Popen([sys.executable, *command], text=True, **pipes))
            words = children[-1].stdout
            assert words is not None
            if DEVICES in command and not any(line.startswith("ready:") for line in words):
                raise SystemExit("the virtual devices did not start")
            threading.Thread(target=words.read, daemon=True).start()
        yield
    finally:
        for child in reversed(children):
            assert child.stdin is not None
            child.stdin.close()
            child.terminate()
            child.wait(20.0)


def vcan() -> str:
    """Name of a virtual SocketCAN interface that is up; "" where there is none."""
    for place in sorted(Path("/sys/class/net").glob("vcan*")):
        if int((place / "flags").read_text(), 16) & 1:
            return place.name
    return ""


def commands(plant: str) -> list[list[str]]:
    """The processes of a plant; none where this machine does not have it."""
    if plant == "simulator":
        return [["-m", "hydraulic_sim.nodes.simulator", "--autostart", *QUIETLY, "-p", f"model:={MODEL}"]]
    port, name = random.SystemRandom().randrange(43200, 49000), vcan()
    channel = f"239.74.163.2:{port}" if plant == "udp_multicast" else name
    if not channel:
        return []
    interface = "udp_multicast" if plant == "udp_multicast" else "socketcan"
    place = ["--interface", interface, "--channel", channel]
    settings = ["-p", f"interface:={interface}", "-p", f"channel:={channel}"]
    return [
        ["-u", "-m", DEVICES, *place, "--model", MODEL],
        ["-m", "hydraulic_can_driver.nodes.can_driver", "--autostart", *QUIETLY, *settings],
    ]


def measure(plant: str, stops: int, seed: int) -> list[tuple[float, float]]:
    """Times [ms] of all stops, in `state` and heard."""
    import rclpy
    from domain_coordinator import domain_id

    from hydraulic_node_utils.nodes import middleware

    draw = random.Random(seed)
    with domain_id() as number:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        middleware.set_up()
        with processes(*commands(plant), [__file__, "--role", "source"]):
            rclpy.init(args=[])
            stopper = Stopper()
            found = []
            for _ in range(stops):
                stopper.drive()
                found.append(stopper.stop(draw.uniform(0.02, 0.06)))
            stopper.close()
            rclpy.shutdown()
    return found


def distribution(times: Sequence[float]) -> dict[str, float]:
    """Median, 95 % and maximum."""
    ordered = sorted(times)
    last = len(ordered) - 1
    return {"median": ordered[last // 2], "95 %": ordered[round(0.95 * last)], "max": ordered[-1]}


def main() -> int:
    """Print the figures of all plants; 1 where 0 V came later than 10 ms in any state."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stops", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the instants at which the stops come")
    parser.add_argument("--only", choices=PLANTS, action="append", help="plants; default: all that this machine has")
    parser.add_argument("--json", type=Path, help="write all times to this file")
    parser.add_argument("--role", choices=("source",), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.role:
        source()
        return 0
    results = {}
    print(f"{options.stops} stops each, seed {options.seed}; from the call of emergency_stop, in ms")
    print(f"{'':14s}{'0 V in state: median':>22s}{'95 %':>8s}{'max':>8s}{'heard: median':>16s}{'95 %':>8s}{'max':>8s}")
    for plant in options.only or PLANTS:
        if not commands(plant):
            print(f"{plant:14s}this machine has no vcan interface that is up: not measured", flush=True)
            continue
        results[plant] = found = measure(plant, options.stops, options.seed)
        cells = [distribution(column).values() for column in zip(*found, strict=True)]
        (a, b, c), (d, e, f) = cells
        print(f"{plant:14s}{a:22.2f}{b:8.2f}{c:8.2f}{d:16.2f}{e:8.2f}{f:8.2f}", flush=True)
    if options.json:
        options.json.write_text(json.dumps({"seed": options.seed, "ms": results}))
    late = {plant: sum(state > LIMIT_MS for state, _ in found) for plant, found in results.items()}
    print(f"later than {LIMIT_MS:g} ms in state: " + ", ".join(f"{plant} {n}" for plant, n in late.items()))
    return int(any(late.values()))


if __name__ == "__main__":
    sys.exit(main())
