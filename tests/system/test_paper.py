"""The paper's study through the node graph, with short records: real processes, from the excitation to the page."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hydraulic_sysid.data.records import read_records
from hydraulic_sysid.excitation import load_plan

pytest.importorskip("rclpy")

pytestmark = [pytest.mark.timeout(900), pytest.mark.thorough]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """Folder, document and output of `paper --quick`."""
    folder = tmp_path_factory.mktemp("paper")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "COLUMNS": "120"}
    command = [sys.executable, "-m", "hydraulic_bringup.verbs.paper", "--quick", "--out", str(folder / "run")]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=880)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "run", json.loads((folder / "run" / "paper.json").read_text(encoding="utf-8")), done.stdout


@pytest.mark.parametrize("kind", ["chirp", "multisine"])
def test_the_papers_band_is_played_through_the_graph_as_predicted(run: Any, kind: str) -> None:
    out, document, _ = run
    (entry,) = (e for e in document["excitations"] if e["name"] == kind)
    assert entry["origin"] == "sim through the node graph"
    (record,) = read_records(out / kind)
    plan = load_plan(out / "plans" / f"{kind}.yaml")
    assert record.description["experiment"]["event"] == "finished"
    assert record.description["experiment"]["plan"]["prediction"] == plan.as_mapping()["prediction"]
    assert plan.prediction is not None
    # The bench does what the rehearsal said, but for the start.
    assert record["position"].max() < plan.prediction.position_max + 0.1
    assert record["position"].min() > plan.prediction.position_min - 0.1
    assert 0.8 < abs(record["drive"]).max() / plan.prediction.drive_peak < 1.1


def test_a_short_record_of_the_band_still_gives_good_models(run: Any) -> None:
    for row in run[1]["models"]:
        assert row["best_fit"] > 98.0
    assert {e["origin"] for e in run[1]["excitations"] if e["band"] != "in"} == {"rehearsed on the model"}


def test_page_and_tables_are_there(run: Any) -> None:
    assert "Open the report" in run[2]
    assert "best fit, test data" in run[2]
    page = (run[0] / "report.html").read_text(encoding="utf-8")
    assert "<script src" not in page
