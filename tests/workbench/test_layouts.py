"""The layouts of other tools show topics and services of the contract, in the tools' own formats."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hydraulic_interfaces.contract import NAMESPACE, PISTON, SERVICES, SERVOVALVE, find_topic, topic
from hydraulic_interfaces.conversions import interface_class

LAYOUTS = Path(__file__).resolve().parents[2] / "ros_ws" / "src" / "hydraulic_workbench" / "layouts"
JOINTS = {
    "command": (SERVOVALVE,),
    "reference": (PISTON,),
    **dict.fromkeys(("state", "predicted_state", "residual"), (PISTON, SERVOVALVE)),
}
"""Names in the messages of the contract's joint states, in their order."""

FOXGLOVE_KEYS = {
    "Plot": {
        "paths", "minXValue", "maxXValue", "minYValue", "maxYValue", "showLegend", "legendDisplay",
        "floatingLegendPosition", "showPlotValuesInLegend", "showXAxisLabels", "showYAxisLabels", "isSynced",
        "xAxisVal", "xAxisPath", "xAxisLabel", "timeWindowMode", "playbackBarPosition", "yAxisLabel",
        "followingViewWidth", "sidebarDimension",
    },
    "CallService": {
        "serviceName", "requestPayload", "layout", "buttonText", "buttonTooltip", "buttonColor", "editingMode",
        "timeoutSeconds",
    },
    "DiagnosticSummary": {
        "minLevel", "pinnedIds", "topicToRender", "hardwareIdFilter", "sortByLevel", "secondsUntilStale",
    },
}  # fmt: skip
"""Settings of panels, as foxglove-sdk 0.30 (`foxglove.layouts`) names them; besides, each may have a title."""
FOXGLOVE_PATH_KEYS = {"value", "enabled", "timestampMethod", "color", "label", "lineSize", "showLine", "lineStyle"}
FOXGLOVE_CHOICES = {
    "legendDisplay": {"floating", "top", "left"},
    "xAxisVal": {"timestamp", "index", "custom", "currentCustom"},
    "timeWindowMode": {"automatic", "sliding", "fixed"},
    "playbackBarPosition": {"center", "right"},
    "timestampMethod": {"receiveTime", "publishTime", "headerStamp", "customField"},
    "layout": {"vertical", "horizontal"},
}

FOXGLOVE = json.loads((LAYOUTS / "foxglove.json").read_text())
PLOTJUGGLER = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
PATHS = [path for panel in FOXGLOVE["configById"].values() for path in panel.get("paths", ())]
CURVES = [curve.attrib["name"] for curve in PLOTJUGGLER.iter("curve")]


def topic_of(name: str) -> str:
    """The contract's short name of a full one."""
    short = name.removeprefix(f"{NAMESPACE}/")
    assert topic(short) == name
    return short


@pytest.mark.parametrize("path", [path["value"] for path in PATHS])
def test_a_path_of_foxglove_is_a_field_of_a_topic(path: str) -> None:
    found = re.fullmatch(r"(/[\w/]+)\.(\w+)(?:\[(\d)\])?", path)
    assert found, path
    name = topic_of(found[1])
    message = interface_class(find_topic(name).type)
    assert found[2] in message.get_fields_and_field_types()
    assert (found[3] is not None) == (name in JOINTS), "of an array an element, of a number none"
    if found[3] is not None:
        assert int(found[3]) < len(JOINTS[name])


@pytest.mark.parametrize("curve", CURVES)
def test_a_curve_of_plotjuggler_is_a_field_of_a_topic(curve: str) -> None:
    """Of a JointState PlotJuggler makes curves TOPIC/JOINT/FIELD, of other messages TOPIC/FIELD."""
    *names, last = curve.removeprefix(f"{NAMESPACE}/").split("/")
    name = topic_of(f"{NAMESPACE}/{names[0]}")
    assert last in interface_class(find_topic(name).type).get_fields_and_field_types()
    if name in JOINTS:
        assert len(names) == 2 and names[1] in JOINTS[name]
    else:
        assert len(names) == 1
    assert f"{NAMESPACE}/{name}" in selected_topics()


def selected_topics() -> list[str]:
    """Topics that PlotJuggler subscribes to, as its plug-in reads them: one attribute, separated by semicolons."""
    selected = PLOTJUGGLER.find("Plugins/plugin[@ID='ROS2 Topic Subscriber']/selected_topics")
    assert selected is not None
    return selected.attrib["value"].split(";")


def test_foxglove_knows_every_setting() -> None:
    for name, panel in FOXGLOVE["configById"].items():
        keys = FOXGLOVE_KEYS[name.partition("!")[0]]
        assert set(panel) - {"foxglovePanelTitle"} <= keys, name
    for path in PATHS:
        assert set(path) <= FOXGLOVE_PATH_KEYS
    for entry in (*FOXGLOVE["configById"].values(), *PATHS):
        for key, choices in FOXGLOVE_CHOICES.items():
            assert key not in entry or entry[key] in choices, entry


def test_foxglove_places_every_panel_once() -> None:
    def placed(node: object) -> list[str]:
        if isinstance(node, str):
            return [node]
        assert isinstance(node, dict) and node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
        return placed(node["first"]) + placed(node["second"])

    assert sorted(placed(FOXGLOVE["layout"])) == sorted(FOXGLOVE["configById"])


def test_foxglove_has_the_services_on_buttons_that_show_at_once() -> None:
    called = [panel for panel in FOXGLOVE["configById"].values() if "serviceName" in panel]
    assert sorted(panel["serviceName"] for panel in called) == sorted(f"{NAMESPACE}/{one.name}" for one in SERVICES)
    for panel in called:
        json.loads(panel["requestPayload"])
        assert panel["editingMode"] is False, "else the button hides behind the text of the request"
    shown = [panel["topicToRender"] for panel in FOXGLOVE["configById"].values() if "topicToRender" in panel]
    assert shown == [topic("diagnostics")]


def test_plotjuggler_reads_what_it_needs() -> None:
    subscriber = PLOTJUGGLER.find("previouslyLoaded_Streamer")
    assert subscriber is not None and subscriber.attrib["name"] == "ROS2 Topic Subscriber"
    for splitter in PLOTJUGGLER.iter("DockSplitter"):
        assert len(splitter) == int(splitter.attrib["count"]) == len(splitter.attrib["sizes"].split(";"))
        assert splitter.attrib["orientation"] in ("-", "|")
    for plot in PLOTJUGGLER.iter("plot"):
        assert plot.attrib["mode"] == "TimeSeries" and plot.find("range") is not None
    for name in selected_topics():
        topic_of(name)
