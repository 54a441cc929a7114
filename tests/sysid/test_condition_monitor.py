"""The node that follows the wear of an actuator over the bags of a folder."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.errors import FileError
from hydraulic_sysid.data.records import Record, save, to_bag
from hydraulic_sysid.monitoring.follow import Follower, Row, complete, rows

LEAKAGE = "internal_leakage.coefficient"


def bag(index: int, leakage: float) -> Record:
    """A second and a half of the sample bench."""
    rng = np.random.default_rng(index)
    t = np.arange(1500) * 1e-3
    drive = 4.0 * np.sin(2 * np.pi * (1.0 + 2.0 * t) * t + index)
    made = Plant(load_model("sample_bench")).with_parameters({LEAKAGE: leakage}).simulate(drive, 1e-3)
    channels = {"drive": made.drive, "position": made.position + 2e-5 * rng.standard_normal(t.size)}
    for name in ("pressure_a", "pressure_b"):
        channels[name] = made[name] + 1.5e4 * rng.standard_normal(t.size)
    return Record.sampled(f"bag_{index:02d}", 1e-3, channels)


def document(**changes: Any) -> dict[str, Any]:
    alarm = {"onset": "b7", "before": 1.0, "after": 2.0}
    parameter = {
        "key": LEAKAGE, "values": [1.0, 2.0], "errors": [0.1, 0.1], "unit": "m^3/(s*Pa)", "bags": ["b6", "b7"],
        "alarm": alarm, "wear": "piston seal", "trend": {"slope": 1.0}, "forecast": {"time": 12.0}, "limit": 5.0,
    }  # fmt: skip
    return {
        "bags": [{"name": "b6", "state": "done"}, {"name": "b7", "state": "failed"}], "time_unit": "bags",
        "verdict": {"text": "It has changed."}, "changed": [LEAKAGE], "parameters": [{**parameter, **changes}],
    }  # fmt: skip


def test_rows_say_what_the_document_says() -> None:
    first, leak = rows(document())
    assert (first.text, first.changed, first.figures["not_fitted"]) == ("It has changed.", True, "b7")
    assert leak == Row(LEAKAGE, "changed since b7: 1 → 2 m^3/(s*Pa)", True, leak.figures)
    assert leak.figures["limit_reached_at"] == "12" and leak.figures["wear"] == "piston seal"
    (_, quiet) = rows(document(alarm=None, trend=None, forecast=None))
    assert (quiet.text, quiet.changed) == ("no change", False)


def test_bags_that_are_still_recorded_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "bag_2").mkdir()
    (tmp_path / "bag_2" / "bag_2_0.mcap").touch()
    (tmp_path / "bag_1").mkdir()
    (tmp_path / "bag_1" / "metadata.yaml").touch()
    (tmp_path / "bag_0.csv").touch()
    assert [p.name for p in complete(str(tmp_path / "bag_*"))] == ["bag_0.csv", "bag_1"]
    with pytest.raises(FileError, match="pattern"):
        Follower("", tmp_path, [])


def finished(follower: Follower) -> dict[str, Any] | None:
    found = follower.poll()
    while follower.busy:
        time.sleep(0.05)
        found = follower.poll()
    return found


def test_a_follower_says_why_nothing_came_and_goes_on_with_the_next_bag(tmp_path: Path) -> None:
    options = ["--model", "sample_bench", "--watch", "internal_leakage"]
    follower = Follower(str(tmp_path / "bag_*"), tmp_path / "out", options, niceness=0)
    assert follower.poll() is None and not follower.busy  # no bag
    (tmp_path / "bag_00.csv").write_text("nothing")
    assert finished(follower) is None
    assert "bag_00.csv" in follower.problem and "Traceback" not in follower.problem
    assert follower.poll() is None and not follower.busy  # nothing new
    (tmp_path / "bag_00.csv").unlink()
    save(bag(0, 1e-12), tmp_path / "bag_00.csv")
    found = finished(follower)
    assert found is not None and follower.problem == "" and found["bags"][0]["state"] == "done"
    to_bag(bag(1, 1e-12), tmp_path / "bag_01")
    follower.poll()
    assert follower.busy and follower.bags == 2
    follower.close()
    assert not follower.busy


def test_the_node_tells_of_a_worn_seal(launch: Any, client: Any, wait_until: Any, tmp_path: Path) -> None:
    for i in range(6):
        save(bag(i, 1e-12 if i < 4 else 8e-11), tmp_path / f"bag_{i:02d}.csv")
    told = client.collect("/diagnostics")

    def last(end: str) -> Any:
        found = [s for m in told for s in m.status if s.name == f"/actuator/condition_monitor: {end}"]
        return found[-1] if found else None

    settings = {
        "model": "sample_bench", "bags": str(tmp_path / "bag_*"), "output": str(tmp_path / "out"),
        "watch": "internal_leakage", "baseline": 3, "limits": f"{LEAKAGE}=1e-9 m^3/(s*Pa)", "niceness": 0,
        "period": 0.2,
    }  # fmt: skip
    options = [part for key, value in settings.items() for part in ("-p", f"{key}:={value}")]
    process = launch("hydraulic_sysid.nodes.condition_monitor", "--ros-args", *options)
    wait_until(lambda: (row := last(LEAKAGE)) is not None and row, "a row of the leakage")
    row, whole = last(LEAKAGE), last("condition")
    assert row.level == whole.level == b"\x01"
    assert row.message.startswith("changed since bag_04")
    values = {v.key: v.value for v in row.values}
    assert abs(float(values["value"]) - 8e-11) < 1e-11 and "seal" in values["wear"]
    assert (tmp_path / "out" / "report.html").exists()
    process.interrupt()
    assert process.wait() == 0


def test_the_node_refuses_a_model_that_is_none(launch: Any) -> None:
    process = launch("hydraulic_sysid.nodes.condition_monitor", "--ros-args", "-p", "model:=nothing")
    assert process.wait() == 2
