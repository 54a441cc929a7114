"""The SROS2 policy of a bench on a network: what it allows is what the nodes do, and no more than the contract says."""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as Tree
from pathlib import Path
from typing import Any

import pytest
import rclpy

from hydraulic_control.nodes.controller import ControllerNode
from hydraulic_control.nodes.reference import ReferenceNode
from hydraulic_control.nodes.relay import RelayNode
from hydraulic_interfaces.contract import SERVICES, TOPICS
from hydraulic_plant_node.nodes.plant_node import PlantNode
from hydraulic_sim.nodes.simulator import Simulator
from hydraulic_sysid.nodes.condition_monitor import ConditionMonitor
from hydraulic_sysid.nodes.estimator import Estimator
from hydraulic_sysid.nodes.excitation import ExcitationNode
from hydraulic_sysid.nodes.recorder import Recorder

POLICY = Path(__file__).parents[2] / "docs" / "security" / "policy.xml"
SOURCES = {"controller", "excitation", "relay"}
MADE = {
    "plant": lambda: PlantNode(Simulator()),
    "controller": ControllerNode,
    "reference": ReferenceNode,
    "relay": RelayNode,
    "excitation": ExcitationNode,
    "estimator": Estimator,
    "condition_monitor": ConditionMonitor,
    "recorder": Recorder,
}


def full(name: str, node: str) -> str:
    if name.startswith("~"):
        return f"/actuator/{node}{name[1:]}"
    return name if name.startswith("/") else f"/actuator/{name}"


@pytest.fixture(scope="module")
def policy() -> dict[str, dict[str, set[str]]]:
    """Node → what ("publish", "subscribe", "reply", "request") → full names."""
    found: dict[str, dict[str, set[str]]] = {}
    for enclave in Tree.parse(POLICY).getroot().iter("enclave"):
        (profile,) = enclave.iter("profile")
        node = profile.attrib["node"]
        assert enclave.attrib["path"] == f"{profile.attrib['ns']}/{node}" == f"/actuator/{node}"
        found[node] = {what: set() for what in ("publish", "subscribe", "reply", "request")}
        for block in profile:
            ((what, rule),) = block.attrib.items()
            assert rule == "ALLOW"
            found[node][what] |= {full(str(entry.text), node) for entry in block}
    return found


def publishers(policy: dict[str, dict[str, set[str]]], name: str) -> set[str]:
    return {node for node, allowed in policy.items() if full(name, "") in allowed["publish"]}


def test_every_topic_of_the_contract_has_the_publishers_that_it_names(policy: dict[str, Any]) -> None:
    for row in TOPICS:
        allowed = publishers(policy, row.name)
        if row.publisher == "source":
            assert allowed == SOURCES
        elif row.publisher != "every node":
            assert allowed == {row.publisher}, row.name


def test_only_the_operator_may_enable_stop_reset_and_set(policy: dict[str, Any]) -> None:
    for row in SERVICES:
        name = full(row.name, "")
        assert {node for node, allowed in policy.items() if name in allowed["request"]} == {"operator"}
        assert {node for node, allowed in policy.items() if name in allowed["reply"]} == {"plant"}
    assert all(not allowed["request"] for node, allowed in policy.items() if node != "operator")
    assert not publishers(policy, "command") & {"operator"}


@pytest.mark.parametrize("name", list(MADE))
def test_a_node_may_do_all_that_it_does(policy: dict[str, Any], name: str, tmp_path: Path) -> None:
    rclpy.init(args=["--ros-args", "-p", f"output:={tmp_path / 'bag'}"] if name == "recorder" else [])
    try:
        node = MADE[name]()
        does = {
            "publish": {full(p.topic, name) for p in node.publishers},
            "subscribe": {full(s.topic, name) for s in node.subscriptions},
            "reply": {full(s.srv_name, name) for s in node.services},
            "request": {full(c.srv_name, name) for c in node.clients},
        }
        for what, names in does.items():
            assert names <= policy[name][what], what
        assert does["publish"] and does["reply"]
        if isinstance(node, Recorder):
            node.close("the test has ended")
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


def test_the_permissions_made_of_it_are_those_of_the_policy(policy: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("sros2")
    keys = tmp_path / "keys"
    for arguments in (["create_keystore", str(keys)], ["generate_artifacts", "-k", str(keys), "-p", str(POLICY)]):
        made = subprocess.run(["ros2", "security", *arguments], capture_output=True, text=True, check=False)
        assert made.returncode == 0, made.stdout + made.stderr
    for node, allowed in policy.items():
        folder = keys / "enclaves" / "actuator" / node
        assert {"cert.pem", "key.pem", "governance.p7s", "permissions.p7s"} <= {file.name for file in folder.iterdir()}
        permissions = Tree.parse(folder / "permissions.xml").getroot()
        assert permissions.findtext(".//default") == "DENY"
        expected = {
            "publish": {f"rt{name}" for name in allowed["publish"]}
            | {f"rr{name}Reply" for name in allowed["reply"]}
            | {f"rq{name}Request" for name in allowed["request"]},
            "subscribe": {f"rt{name}" for name in allowed["subscribe"]}
            | {f"rq{name}Request" for name in allowed["reply"]}
            | {f"rr{name}Reply" for name in allowed["request"]},
        }
        for what, topics in expected.items():
            given = {str(entry.text) for block in permissions.iter(what) for entry in block.iter("topic")}
            assert given == topics | {"ros_discovery_info"}, f"{node}: {what}"


@pytest.mark.parametrize(
    "module", ["hydraulic_sim.nodes.simulator", "hydraulic_control.nodes.controller", "hydraulic_sysid.nodes.recorder"]
)
def test_enforced_without_its_keys_a_node_does_not_start(module: str, tmp_path: Path) -> None:
    """Also where the middleware was built without security: it must not run unprotected instead."""
    security = {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(tmp_path),
    }
    (tmp_path / "enclaves" / "actuator" / "plant").mkdir(parents=True)
    options = ["--ros-args", "--enclave", "/actuator/plant", "-p", f"output:={tmp_path / 'bag'}"]
    environment = {**os.environ, **security, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", module, *options]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=200.0)
    assert ended.returncode == 2
    assert "security" in ended.stderr.splitlines()[-1].lower()
    assert "Traceback" not in ended.stderr
