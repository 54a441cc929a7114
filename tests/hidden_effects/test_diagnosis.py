"""A few benches of the catalogue, as a user would have them diagnosed (all of it: benchmarks/diagnosis_matrix.py)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hidden_effects import benches, scoring, settings
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.search import diagnose

SECONDS = 10.0
RIGHT_FIRST = (
    benches.Bench("single", ("coulomb_friction",), "strong", 1),
    pytest.param(benches.Bench("single", ("valve_deadband",), "mild", 1), marks=pytest.mark.thorough),
)


def diagnosed(bench: benches.Bench, folder, count: int = 1) -> dict[str, Any]:
    """By the first half of its first record, or of so many: it does for what is looked for here."""
    place = benches.write(bench, folder)
    model = load_model(place / "model.yaml")
    records = read_all(sorted(place.glob("*.csv.gz"))[:count])
    return diagnose(model, [r.window(0.0, SECONDS) for r in records]).result


def examined(bench: benches.Bench, folder) -> dict[str, Any]:
    result = diagnosed(bench, folder)
    return scoring.judge(bench.answer(), result) | {"text": result["verdict"]["text"]}


@pytest.mark.timeout(600)
@pytest.mark.parametrize("bench", RIGHT_FIRST, ids=lambda b: b.name)
def test_the_hidden_effect_is_named_first(bench, tmp_path):
    marks = examined(bench, tmp_path)
    assert marks["right_first"], marks
    assert marks["parameters"], marks


@pytest.mark.thorough
@pytest.mark.timeout(600)
def test_the_step_of_a_coarse_sensor_is_read_off_its_readings(tmp_path):
    """It is seen and not fitted, so it has no interval."""
    bench = benches.Bench("single", ("sensor_quantisation",), "mild", 1)
    result = diagnosed(bench, tmp_path, 2)
    assert result["verdict"]["effects"] == ["sensor_quantisation"], result["verdict"]
    step, noise = result["effects"][0]["parameters"]
    assert step["value"] == pytest.approx(bench.truth()["sensor_quantisation"]["step"], rel=1e-4)
    assert 0.0 < noise["value"] < 0.2 * step["value"], "the reading before its converter is not without noise"
    for shown in result["worst_segments"]:  # and the curves of the report come in steps, but for the noise at an edge
        off = {}
        for which in ("before", "after"):
            codes = shown["channels"]["position"][which] / step["value"]
            off[which] = np.abs(codes - np.round(codes))
        assert np.median(off["after"]) < 0.05, "evenly spread they would be 0.25 off"
        assert off["before"].max() > 0.1


@pytest.mark.thorough
@pytest.mark.timeout(600)
def test_the_step_of_a_coarse_sensor_is_named_where_a_noise_model_would_do(tmp_path):
    """Where the position alone is seen, an effect that is missing beside it hides in the noise that it passes for."""
    setting = settings.Setting("medium", "converter", "closed", "right")
    bench = benches.Bench("pair", ("viscous_asymmetry", "sensor_quantisation"), "mild", 8900100002, setting)
    assert diagnosed(bench, tmp_path, 4)["verdict"]["effects"] == ["sensor_quantisation"]


@pytest.mark.timeout(600)
def test_nothing_is_named_where_nothing_is_missing(tmp_path):
    marks = examined(benches.Bench("none", seed=1), tmp_path)
    assert marks["silent"], marks


@pytest.mark.thorough
@pytest.mark.timeout(600)
def test_what_no_library_lists_is_said_to_be_outside(tmp_path):
    marks = examined(benches.Bench("unknown", ("worn_barrel_leakage",), "strong", 1), tmp_path)
    assert marks["said_so"] and marks["right_subsystem"], marks
