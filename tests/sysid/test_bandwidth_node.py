"""The bandwidth measured by the excitation node on a running plant."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from std_msgs.msg import String  # noqa: E402

from hydraulic_interfaces.qos import profile  # noqa: E402
from hydraulic_sysid.excitation import Plan, save_plan  # noqa: E402
from hydraulic_sysid.excitation.signals.random_phase_multisine import RandomPhaseMultisine  # noqa: E402

BENCH = "moog_mcr_m_1002_bench"


def test_the_excitation_node_measures_it(
    launch: Any, client: Any, wait_until: Any, tmp_path: Path, compiled_physics: None
) -> None:
    """`measure_bandwidth` plays the probe on the running plant and publishes what it found."""
    drive = RandomPhaseMultisine(1.0, 2.0, 0.5, 100.0, seed=1, crest="low")
    rests = {"fade_in": 0.3, "fade_out": 0.3, "rest_before": 0.1, "rest_after": 0.1}
    plan = Plan("probe", drive, 0.2, duration=6.8, rate=250.0, **rests)
    save_plan(plan, tmp_path / "short.yaml")
    launch(
        "hydraulic_sim.nodes.simulator", "--autostart", "--ros-args", "-p", f"model:={BENCH}",
        "-p", "enable_on_activate:=true", "-p", "watchdog:=1.0", "-p", "rate:=250.0", "-p", "lockstep:=true",
    )  # fmt: skip
    launch(
        "hydraulic_sysid.nodes.excitation", "--ros-args", "-p", f"probe:={tmp_path / 'short.yaml'}",
        "-p", "state_timeout:=2.0",
    )  # fmt: skip
    heard: list[Any] = []
    client.node.create_subscription(String, "/actuator/excitation/bandwidth", heard.append, profile("latched"))
    client.wake()

    def begun() -> bool:
        answer = client.call("std_srvs/srv/Trigger", "/actuator/excitation/measure_bandwidth")
        return answer.success or "a run is on" in answer.message

    wait_until(begun, "the probe to begin")
    wait_until(lambda: heard, "the bandwidth")
    found = json.loads(heard[-1].data)
    assert found["event"] == "finished", found["reason"]
    assert 0.5 < found["position_bandwidth"] < 6.0
    assert found["velocity_gain"] == pytest.approx(0.0434, rel=0.03)
