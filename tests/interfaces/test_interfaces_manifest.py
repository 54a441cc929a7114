"""The manifest of hydraulic_interfaces declares no ROS package that its sources do not name."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

PACKAGE = Path(__file__).parents[2] / "ros_ws" / "src" / "hydraulic_interfaces"


def test_every_declared_ros_package_is_used() -> None:
    root = ElementTree.parse(PACKAGE / "package.xml").getroot()
    declared = {str(entry.text) for entry in root.iter("exec_depend") if not str(entry.text).startswith("python3-")}
    sources = "\n".join(file.read_text(encoding="utf-8") for file in (PACKAGE / PACKAGE.name).rglob("*.py"))
    # Imported, or the package of a message type that is found by its name ("std_srvs/srv/Trigger").
    used = set(re.findall(r"^(?:from|import) (\w+)|\"(\w+)/(?:msg|srv)/", sources, flags=re.MULTILINE))
    assert declared and declared <= {name for pair in used for name in pair}
