"""Nobody outside this machine finds a plant: two network namespaces with a cable between them are two machines."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

HERE = Path(__file__).parent
FIRST_EPHEMERAL = 32768


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def machines() -> Iterator[tuple[str, str]]:
    """Names of two network namespaces: 10.213.0.1 and 10.213.0.2."""
    if not shutil.which("ip"):
        pytest.skip("no command `ip`: no network namespaces")
    here, there = (f"bench{os.getpid()}{side}" for side in "ab")
    made = run("ip", "netns", "add", here)
    if made.returncode:
        pytest.skip(f"no network namespaces: {made.stderr.strip() or made.returncode}")
    try:
        steps = [
            f"ip netns add {there}",
            f"ip -n {here} link add eth0 type veth peer name eth0 netns {there}",
            *(f"ip -n {side} addr add 10.213.0.{n}/24 dev eth0" for n, side in ((1, here), (2, there))),
            *(f"ip -n {side} link set {device} up" for side in (here, there) for device in ("lo", "eth0")),
            *(f"ip -n {side} route add 224.0.0.0/4 dev eth0" for side in (here, there)),
        ]
        for step in steps:
            done = run(*step.split())
            if done.returncode:
                pytest.skip(f"{step}: {done.stderr.strip()}")
        yield here, there
    finally:
        for side in (here, there):
            run("ip", "netns", "del", side)


def inside(machine: str, *command: str) -> list[str]:
    """The command in a namespace, with a shared memory of its own as another machine has it."""
    line = f"mount -t tmpfs tmpfs /dev/shm && exec {shlex.join(command)}"
    return ["ip", "netns", "exec", machine, "sh", "-c", line]


class Lines:
    """A process and what it prints, line by line."""

    def __init__(self, command: list[str], log: Path, **variables: str) -> None:
        self.log = log
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=log.open("wb"),
            stderr=subprocess.STDOUT,
            env={**os.environ, **variables},
        )

    def said(self, line: str) -> bool:
        if self.process.poll() is not None:
            pytest.fail(self.log.read_text())
        return line in self.log.read_text().splitlines()

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


def addresses(pid: int) -> set[str]:
    """Where the UDP sockets of a process listen: hexadecimal IPv4 addresses, as the kernel writes them.

    Ports that the kernel has chosen are left out: the middleware sends from them and reads nothing.
    """
    sockets = {os.readlink(end) for end in Path(f"/proc/{pid}/fd").iterdir() if end.is_symlink()}
    rows = [line.split() for line in Path(f"/proc/{pid}/net/udp").read_text().splitlines()[1:]]
    ends = [row[1].split(":") for row in rows if f"socket:[{row[9]}]" in sockets]
    return {address for address, port in ends if int(port, 16) < FIRST_EPHEMERAL}


def test_a_stranger_with_our_address_finds_nothing(
    machines: tuple[str, str], wait_until: Any, tmp_path: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another plant, whose discovery alone is limited to its machine, shows that the stranger would."""
    from hydraulic_node_utils.nodes import middleware

    here, there = machines
    for name in middleware.VARIABLES:
        monkeypatch.delenv(name)  # a node sets itself up, however it is started
    shut, wide = str(ros_domain), str(ros_domain + 100)
    plant = [sys.executable, str(HERE / "integrator_plant.py"), "--autostart"]
    search = [sys.executable, str(HERE / "stranger.py"), shut, wide]
    former = {middleware.PROFILES[0]: str(Path(middleware.__file__).with_name("fastdds_network.xml"))}
    away = {middleware.RANGE: "SUBNET", "ROS_STATIC_PEERS": "10.213.0.1"}
    started: list[Lines] = []

    def start(machine: str, command: list[str], name: str, **variables: str) -> Lines:
        started.append(Lines(inside(machine, *command), tmp_path / name, **variables))
        return started[-1]

    try:
        safe = start(here, plant, "shut.log", ROS_DOMAIN_ID=shut)
        other = start(here, plant, "wide.log", ROS_DOMAIN_ID=wide, **former)
        outside = start(there, search, "outside.log", **away)
        local = start(here, search, "local.log", **{middleware.RANGE: "LOCALHOST"})
        begun = time.monotonic()
        wait_until(lambda: outside.said(f"found {wide}"), "the other plant found from outside")
        wait_until(lambda: local.said(f"found {shut}"), "the plant found on its own machine, by a node without profile")
        time.sleep(2.0 + time.monotonic() - begun)
        assert not outside.said(f"found {shut}")
        assert addresses(safe.process.pid) == {"0100007F"}, "127.0.0.1"
        assert "others on the network may reach it" in other.log.read_text()
        assert "network" not in safe.log.read_text()
    finally:
        for process in started:
            process.end()


RECEIVE = """
import sys
from hydraulic_can_driver.can_bus import open_can
bus = open_can("udp_multicast", "239.74.163.2:43117")
print("looking", flush=True)
while True:
    message = bus.recv(0.1)
    if message:
        print("frame", hex(message.arbitration_id), flush=True)
"""
SEND = """
import socket, sys, time
import can
from can.interfaces.udp_multicast.utils import pack_message
identifier, target, way = int(sys.argv[1]), sys.argv[2], sys.argv[3]
data = pack_message(can.Message(arbitration_id=identifier, data=[1], is_extended_id=False))
end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
end.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(way))
end.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 4)
for _ in range(20):
    end.sendto(data, (target, 43117))
    time.sleep(0.01)
"""


def test_frames_of_another_machine_do_not_reach_a_multicast_bus(
    machines: tuple[str, str], wait_until: Any, tmp_path: Path, ros_domain: int
) -> None:
    here, there = machines
    bus = Lines(inside(here, sys.executable, "-c", RECEIVE), tmp_path / "bus.log")
    try:
        wait_until(lambda: bus.said("looking"), "an open bus")
        frames = (
            (there, 0x101, "239.74.163.2", "10.213.0.2"),
            (there, 0x102, "10.213.0.1", "10.213.0.2"),
            (here, 0x103, "239.74.163.2", "127.0.0.1"),
        )
        for machine, identifier, target, way in frames:
            done = run(*inside(machine, sys.executable, "-c", SEND, str(identifier), target, way))
            assert done.returncode == 0, done.stderr
        wait_until(lambda: "frame" in bus.log.read_text(), "a frame")
        assert set(bus.log.read_text().split()) <= {"looking", "frame", "0x103"}, "only that of this machine"
    finally:
        bus.end()
