"""What recorders say of how far they are, and what strangers say on their topic."""

from __future__ import annotations

import json
from typing import Any

import pytest

from hydraulic_plant_node.recorders import Recorders


def status(output: str, reached_ns: Any, state: str = "recording") -> str:
    return json.dumps({"output": output, "state": state, "reached_ns": reached_ns})


def test_the_slowest_one_that_records_counts() -> None:
    recorders = Recorders()
    assert recorders.recorded_ns() is None
    recorders.hear(status("a", 300))
    recorders.hear(status("b", 200))
    assert recorders.recorded_ns() == 200
    recorders.hear(status("b", 400))
    assert recorders.recorded_ns() == 300
    recorders.hear(status("a", 300, "finished"))
    assert recorders.recorded_ns() == 400
    recorders.forget()
    assert recorders.recorded_ns() is None


STRANGE = [
    "",
    "{",
    "[]",
    "3",
    "null",
    "[" * 100_000,
    "{}",
    '{"output": "x"}',
    '{"output": ["x"], "state": "recording"}',
]


@pytest.mark.parametrize("text", STRANGE, ids=lambda text: text[:12] or "empty")
def test_what_is_no_status_changes_nothing(text: str) -> None:
    recorders = Recorders()
    recorders.hear(status("a", 300))
    recorders.hear(text)
    assert recorders.recorded_ns() == 300


@pytest.mark.parametrize("reached_ns", [None, "soon", 1.5, True, [1], 0])
def test_a_recorder_that_does_not_say_how_far_it_is_is_not_waited_for(reached_ns: Any) -> None:
    recorders = Recorders()
    recorders.hear(status("a", reached_ns))
    assert recorders.recorded_ns() is None
