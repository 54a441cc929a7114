"""The manifests of the library packages declare no ROS package that their sources do not name."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

SOURCES = Path(__file__).parents[2] / "ros_ws" / "src"


@pytest.mark.parametrize("name", ["hydraulic_interfaces", "hydraulic_node_utils", "hydraulic_plant_node"])
def test_every_declared_ros_package_is_used(name: str) -> None:
    package = SOURCES / name
    root = ElementTree.parse(package / "package.xml").getroot()
    declared = {str(entry.text) for entry in root.iter("exec_depend") if not str(entry.text).startswith("python3-")}
    sources = "\n".join(file.read_text(encoding="utf-8") for file in (package / name).rglob("*.py"))
    # Imported, or the package of a message type that is found by its name ("std_srvs/srv/Trigger").
    used = set(re.findall(r"^(?:from|import) (\w+)|\"(\w+)/(?:msg|srv)/", sources, flags=re.MULTILINE))
    assert declared and declared <= {name for pair in used for name in pair}
