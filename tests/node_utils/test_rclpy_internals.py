"""What is used of rclpy beyond its documented interface stands in one module, and is checked before a node is made."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from hydraulic_node_utils.nodes import command_line, rclpy_internals

ROOT = Path(__file__).resolve().parents[2]


def test_this_rclpy_has_it_all() -> None:
    rclpy_internals.check()


def internals_of(tree: ast.AST) -> set[str]:
    """Modules and attributes of rclpy that are not meant for its users."""
    found = set()
    for node in ast.walk(tree):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        found |= {name for name in names if name.startswith(("rclpy.impl", "rclpy._"))}
        if isinstance(node, ast.Attribute) and node.attr in ("_parameter_overrides", "_service_change_state"):
            found.add(node.attr)
    return found


def test_it_is_used_in_one_place() -> None:
    files = [file for package in (ROOT / "ros_ws/src").iterdir() for file in (package / package.name).rglob("*.py")]
    using = {file.name for file in files if internals_of(ast.parse(file.read_text(encoding="utf-8")))}
    assert len(files) > 100 and using == {"rclpy_internals.py"}


def test_another_rclpy_is_refused_with_what_it_lacks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Older:
        def __init__(self) -> None:
            self._given: dict[str, str] = {}

    monkeypatch.setattr(rclpy_internals, "rclpy_implementation", SimpleNamespace(Subscription=object))
    monkeypatch.setattr(rclpy_internals, "Node", Older)
    with pytest.raises(SystemExit) as left:
        command_line.start(command_line.parser("a node", ()), [])
    assert left.value.code == 2
    said = capsys.readouterr().err
    assert "WaitSet.add_subscription, Subscription.take_message, Node._parameter_overrides;" in said
    assert re.search(r"rclpy \d+\.\d+\.\d+ has no .*; the bench is made for rclpy 7\.1", said)
