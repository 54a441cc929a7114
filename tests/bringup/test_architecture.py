"""The floors of the house: who may import whom, and where ROS may appear."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# A package and those below it: an import runs down, never up or sideways.
GROUND = {"hydraulic_interfaces", "hydraulic_node_utils"}
BELOW: dict[str, set[str]] = {
    "hydraulic_interfaces": set(),
    "hydraulic_node_utils": {"hydraulic_interfaces"},
    "hydraulic_plant_node": GROUND,
    "hydraulic_sim": {*GROUND, "hydraulic_plant_node"},
    "hydraulic_sysid": {*GROUND, "hydraulic_sim"},
    "hydraulic_control": {*GROUND, "hydraulic_plant_node", "hydraulic_sim"},
    "hydraulic_can_driver": {*GROUND, "hydraulic_plant_node"},
}
BELOW["hydraulic_bringup"] = set(BELOW)
BELOW["hydraulic_workbench"] = set(BELOW)

# The wings of hydraulic_sysid and those below each. The report shows result documents and knows nothing else.
WINGS_BELOW: dict[str, set[str]] = {
    "data": set(),
    "estimation": {"data"},
    "campaign": {"data"},
    "excitation": {"data", "estimation"},
    "linear": {"data", "estimation", "excitation"},
    "diagnosis": {"data", "estimation", "excitation", "linear"},
    "monitoring": {"data", "campaign", "estimation", "excitation", "linear", "diagnosis"},
    "report": {"data"},
}
WINGS_BELOW["verbs"] = WINGS_BELOW["nodes"] = set(WINGS_BELOW)
FOLDERS = {name: (ROOT / "ros_ws" / "src" / name).resolve() / name for name in BELOW}

# The contract is where messages become plain values; everything else that knows ROS is a node.
ROS_EXCEPTIONS = {"hydraulic_interfaces/conversions.py", "hydraulic_interfaces/qos.py"}
ROS_SUFFIXES = ("_msgs", "_srvs", "_interfaces")
ROS_NAMES = {"rclpy", "ament_index_python", "launch", "launch_ros", "rpyutils", "rosidl_parser"}


def modules(package: str) -> Iterator[Path]:
    """Python files of a package."""
    yield from sorted(FOLDERS[package].rglob("*.py"))


def imported(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and top-level name of every absolute import, also those inside functions and `import_module("…")`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.split(".")[0]
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            yield node.lineno, node.module.split(".")[0]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
            "import_module",
            "__import__",
        ):
            first = node.args[0] if node.args else None
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                yield node.lineno, first.value.split(".")[0]


def is_ros(name: str) -> bool:
    """Whether a module comes from ROS (the contract package is ours)."""
    return name in ROS_NAMES or (name.endswith(ROS_SUFFIXES) and name not in BELOW)


def floor_violations(package: str, file: Path, text: str) -> list[str]:
    """Imports of `file` that do not run down."""
    allowed = BELOW[package] | {package}
    return [
        f"{file}:{line} imports {name}"
        for line, name in imported(ast.parse(text))
        if name in BELOW and name not in allowed
    ]


def ros_violations(package: str, file: Path, text: str) -> list[str]:
    """Imports of ROS in a part of `file`'s package that must not know it."""
    place = file.relative_to(FOLDERS[package].parent)
    if place.parts[1] == "nodes" or place.as_posix() in ROS_EXCEPTIONS:
        return []
    return [f"{file}:{line} imports {name}" for line, name in imported(ast.parse(text)) if is_ros(name)]


@pytest.mark.parametrize("package", BELOW)
def test_imports_run_down(package: str) -> None:
    found = [v for file in modules(package) for v in floor_violations(package, file, file.read_text("utf-8"))]
    assert found == []


def wing_violations(file: Path, text: str) -> list[str]:
    """Imports of a module of hydraulic_sysid, absolute or relative, that do not run down between its wings."""
    place = file.relative_to(FOLDERS["hydraulic_sysid"])
    wing, folder = place.parts[0], ["hydraulic_sysid", *place.parts[:-1]]
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            base = folder[: len(folder) - node.level + 1] if node.level else []
            stem = [*base, *(node.module or "").split(".")] if node.module else base
            targets = [[*stem, alias.name] for alias in node.names]
        elif isinstance(node, ast.Import):
            targets = [alias.name.split(".") for alias in node.names]
        else:
            continue
        other = {t[1] for t in targets if t[0] == "hydraulic_sysid" and len(t) > 1} - {wing}
        found += [f"{place}:{node.lineno} imports {o}" for o in sorted(other) if o not in WINGS_BELOW[wing]]
    return found


def test_imports_between_wings_run_down() -> None:
    inside = [f for f in modules("hydraulic_sysid") if f.parent != FOLDERS["hydraulic_sysid"]]
    assert [v for file in inside for v in wing_violations(file, file.read_text("utf-8"))] == []


def test_bags_know_nothing_of_records() -> None:
    for file in sorted((FOLDERS["hydraulic_sysid"] / "data" / "bag").glob("*.py")):
        text = file.read_text("utf-8")
        assert not re.search(r"^\s*from (hydraulic_sysid\.data|\.)\.records", text, re.MULTILINE), file


@pytest.mark.parametrize(
    ("place", "text", "found"),
    [
        ("data/bag/reader.py", "from hydraulic_sysid.linear.models import arx", 1),
        ("data/bag/reader.py", "from ...estimation import noise", 1),
        ("report/page.py", "from hydraulic_sysid import diagnosis, data", 1),
        ("diagnosis/search/search.py", "from ..calibrate import document\nimport hydraulic_sysid.linear.models", 0),
        ("verbs/diagnose.py", "from hydraulic_sysid.diagnosis.search import diagnose", 0),
        ("nodes/recorder.py", "from hydraulic_sysid.verbs import recover", 1),
    ],
)
def test_the_wing_rule_sees(place: str, text: str, found: int) -> None:
    assert len(wing_violations(FOLDERS["hydraulic_sysid"] / place, text)) == found


@pytest.mark.parametrize("package", BELOW)
def test_pure_logic_knows_no_ros(package: str) -> None:
    found = [v for file in modules(package) for v in ros_violations(package, file, file.read_text("utf-8"))]
    assert found == []


def test_the_controller_runs_without_the_simulation() -> None:
    """Tuning and evaluation run the plant's model; the laws and the nodes that close a loop on a real bench do not."""
    pytest.importorskip("rclpy")
    program = (
        "import sys; sys.modules['hydraulic_sim'] = None\n"
        "from hydraulic_control.nodes import controller, reference, relay\n"
        "from hydraulic_control.controller import Controller; Controller().step(1e-3, 0.0, 0.0, 0.0)"
    )
    path = os.pathsep.join(p for p in sys.path if p)
    subprocess.run([sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": path}, check=True, timeout=500)


def private_imports(file: Path, text: str) -> list[str]:
    """Imports of private modules or names of our packages."""
    return [
        f"{file}:{node.lineno} imports {node.module}.{alias.name}"
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in BELOW
        for alias in node.names
        if any(part.startswith("_") for part in (*str(node.module).split("."), alias.name))
    ]


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "examples"])
def test_what_is_private_is_not_imported_from_outside(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files
    assert [v for file in files for v in private_imports(file, file.read_text("utf-8"))] == []


def test_the_private_rule_sees() -> None:
    text = "from hydraulic_sim.plant import Plant, _run\nfrom hydraulic_sysid.verbs._options import run"
    assert len(private_imports(Path("test_x.py"), text)) == 2


def test_every_package_has_modules() -> None:
    assert all(list(modules(package)) for package in BELOW)


def test_the_entry_needs_only_the_standard_library() -> None:
    entry = FOLDERS["hydraulic_bringup"] / "entry"
    allowed = sys.stdlib_module_names | {"hydraulic_bringup"}
    for file in sorted(entry.rglob("*.py")):
        names = {name for _, name in imported(ast.parse(file.read_text("utf-8")))}
        assert names <= allowed, f"{file}: {names - allowed}"


def test_the_entry_stands_alone() -> None:
    """It runs before anything is installed: of its own package it imports only itself."""
    entry = FOLDERS["hydraulic_bringup"] / "entry"
    for file in sorted(entry.rglob("*.py")):
        depth = len(file.relative_to(entry).parts)
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level:
                assert node.level <= depth, f"{file}:{node.lineno} leaves the entry"


@pytest.mark.parametrize(
    ("package", "place", "text", "found"),
    [
        ("hydraulic_sim", "plant.py", "from hydraulic_sysid import arx", 1),
        ("hydraulic_control", "kernel.py", "import hydraulic_sysid.arx", 1),
        ("hydraulic_control", "simulation.py", "import hydraulic_sim.plant", 0),
        ("hydraulic_can_driver", "devices.py", "def f():\n    import hydraulic_sim", 1),
        ("hydraulic_sim", "plant.py", "import importlib\nimportlib.import_module('hydraulic_bringup.x')", 1),
        ("hydraulic_sysid", "compare.py", "from hydraulic_sim.plant import Plant", 0),
        ("hydraulic_bringup", "verbs/demo.py", "import hydraulic_sim, hydraulic_control", 0),
    ],
)
def test_the_floor_rule_sees(package: str, place: str, text: str, found: int) -> None:
    assert len(floor_violations(package, FOLDERS[package] / place, text)) == found


@pytest.mark.parametrize(
    ("package", "place", "text", "found"),
    [
        ("hydraulic_sim", "plant.py", "import rclpy", 1),
        ("hydraulic_sim", "plant.py", "from sensor_msgs.msg import JointState", 1),
        ("hydraulic_sysid", "verbs/recover.py", "import builtin_interfaces.msg", 1),
        ("hydraulic_sim", "nodes/simulator.py", "import rclpy", 0),
        ("hydraulic_interfaces", "conversions.py", "from std_msgs.msg import Bool", 0),
        ("hydraulic_interfaces", "contract.py", "from std_msgs.msg import Bool", 1),
        ("hydraulic_sim", "plant.py", "import hydraulic_interfaces", 0),
    ],
)
def test_the_ros_rule_sees(package: str, place: str, text: str, found: int) -> None:
    assert len(ros_violations(package, FOLDERS[package] / place, text)) == found
