"""What the environment tells the middleware is understood, and gives way to what the user says."""

from __future__ import annotations

import os
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
rclpy.create_node("profiled").create_publisher(String, "said", 1).publish(String(data="well"))
"""


def test_fast_dds_reads_its_profile_without_a_complaint(ros_domain: int, tmp_path: Any) -> None:
    def complaints(profile: str) -> str:
        variables = {**os.environ, "FASTRTPS_DEFAULT_PROFILES_FILE": profile}
        command = [sys.executable, "-c", PROCESS]
        done = subprocess.run(command, env=variables, capture_output=True, text=True, check=True)
        return done.stdout + done.stderr

    assert complaints(middleware.VARIABLES["FASTRTPS_DEFAULT_PROFILES_FILE"]) == ""
    (tmp_path / "bad.xml").write_text(
        '<dds><profiles><data_writer profile_name="bad"><times><beat/></times></data_writer></profiles></dds>'
    )
    assert "XMLPARSER" in complaints(str(tmp_path / "bad.xml")), "one that is not understood would be complained of"


def test_the_users_own_environment_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in middleware.VARIABLES:
        monkeypatch.setenv(name, "theirs")
    middleware.set_up()
    assert {os.environ[name] for name in middleware.VARIABLES} == {"theirs"}
