"""The layouts of other tools show topics and services of the contract, and nothing else."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

from hydraulic_interfaces.contract import NAMESPACE, SERVICES, find_topic

LAYOUTS = Path(__file__).resolve().parents[2] / "ros_ws" / "src" / "hydraulic_workbench" / "layouts"


def test_foxglove_shows_what_the_contract_has() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    panels = layout["configById"]
    shown = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    assert len(shown) >= 8
    for path in shown:
        name = re.fullmatch(rf"{NAMESPACE}/(\w+)\.(position|velocity|effort|fluid_pressure)(\[\d\])?", path)
        assert name and find_topic(name[1]).publisher, path
    called = {panel["serviceName"] for panel in panels.values() if "serviceName" in panel}
    assert called == {f"{NAMESPACE}/{service.name}" for service in SERVICES}
    placed = re.findall(r'"((?:Plot|CallService|DiagnosticSummary)![a-z]+)"', json.dumps(layout["layout"]))
    assert sorted(placed) == sorted(panels), "every panel is placed once"


def test_plotjuggler_shows_what_the_contract_has() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    selected = {topic.attrib["value"] for topic in root.iter("topic")}
    assert len(curves) >= 8
    for name in curves:
        topic = "/".join(name.split("/")[:3])
        assert find_topic(topic.removeprefix(f"{NAMESPACE}/")).type and topic in selected, name
