"""What the environment tells the middleware is understood, and gives way to what the user says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import Any

import pytest

from hydraulic_node_utils.nodes import middleware

pytest.importorskip("rclpy")

PROCESS = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("profiled")
node.create_publisher(String, "said", 1).publish(String(data="well"))
"""


def test_fast_dds_reads_its_profile_without_a_complaint(ros_domain: int, tmp_path: Any) -> None:
    def complaints(profile: str) -> str:
        variables = {**os.environ, "FASTRTPS_DEFAULT_PROFILES_FILE": profile}
        command = [sys.executable, "-c", PROCESS]
        done = subprocess.run(command, env=variables, capture_output=True, text=True, check=True)
        return done.stdout + done.stderr

    local = middleware.VARIABLES[middleware.PROFILES[0]]
    assert complaints(local) == ""
    assert complaints(middleware.variables({middleware.RANGE: "SUBNET"})[middleware.PROFILES[0]]) == ""
    (tmp_path / "bad.xml").write_text(
        '<dds><profiles><data_writer profile_name="bad"><times><beat/></times></data_writer></profiles></dds>'
    )
    assert "XMLPARSER" in complaints(str(tmp_path / "bad.xml")), "one that is not understood would be complained of"


def test_nobody_is_listened_to_in_shared_memory(ros_domain: int) -> None:
    """The middleware's threads are named after the port that they listen to."""
    ask = """
from pathlib import Path
for file in Path("/proc/self/task").glob("*/comm"):
    print(file.read_text().strip())
"""
    done = subprocess.run([sys.executable, "-c", PROCESS + ask], capture_output=True, text=True, check=True)
    listening = {name.rpartition(".")[0] for name in done.stdout.split() if re.fullmatch(r"dds\.\w+\.\d{4,}", name)}
    assert listening == {"dds.udp"}


LOCAL = middleware.VARIABLES[middleware.PROFILES[0]]
NETWORK = LOCAL.replace("fastdds", "fastdds_network")


@pytest.mark.parametrize(
    ("given", "added", "reached"),
    [
        ({}, middleware.VARIABLES, False),
        ({middleware.RANGE: "OFF"}, {middleware.PROFILES[0]: LOCAL}, False),
        ({middleware.RANGE: "SUBNET"}, {middleware.PROFILES[0]: NETWORK}, True),
        ({middleware.PROFILES[0]: "theirs.xml"}, {middleware.RANGE: "LOCALHOST"}, True),
        ({middleware.PROFILES[1]: "theirs.xml", middleware.RANGE: "LOCALHOST"}, {}, True),
        ({middleware.PROFILES[0]: "", middleware.RANGE: ""}, {}, True),
    ],
)
def test_the_users_own_environment_is_kept(
    given: dict[str, str], added: dict[str, str], reached: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (middleware.RANGE, *middleware.PROFILES):
        monkeypatch.setenv(name, "before")  # so that it is restored
        monkeypatch.delenv(name)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    middleware.set_up()
    seen = {name: os.environ[name] for name in (middleware.RANGE, *middleware.PROFILES) if name in os.environ}
    assert seen == given | added
    assert bool(middleware.reach(os.environ, "rmw_fastrtps_cpp")) is reached


def test_another_middleware_is_its_own_affair() -> None:
    assert "rmw_cyclonedds_cpp" in middleware.reach(middleware.VARIABLES, "rmw_cyclonedds_cpp")
