"""A motor axis without hydraulics: an independent one with a hidden effect, and the measured one where it is there."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from hidden_effects import axis
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import Record, read_all
from hydraulic_sysid.diagnosis.search import diagnose
from hydraulic_sysid.diagnosis.search.force_balance import force_shares

MEASURED = os.environ.get("EMPS_DATA", "")  # DATA_EMPS.mat of the nonlinear benchmark


def model_in(folder: Path):
    path = folder / "model.yaml"
    path.write_text(axis.MODEL)
    return load_model(path)


def diagnosis_of(folder: Path, seed: int, **axis_values: float):
    table = axis.run(np.random.default_rng(seed), **axis_values)
    path = folder / "axis.csv"
    np.savetxt(path, np.stack(list(table.values()), axis=1), "%.9f", ",", header=",".join(table), comments="")
    return diagnose(model_in(folder), read_all([path])).result


@pytest.fixture(params=[0.0, 40.0], ids=["complete", "asymmetric"])
def diagnosed(request, tmp_path):
    return request.param, diagnosis_of(tmp_path, 1, viscous_difference=request.param)


@pytest.mark.timeout(300)
def test_a_motor_axis_is_diagnosed_from_drive_and_position(diagnosed):
    difference, result = diagnosed
    if not difference:
        assert result["verdict"]["kind"] == "complete", result["verdict"]
        return
    assert result["verdict"]["kind"] == "missing", result["verdict"]
    first = result["effects"][0]
    assert first["name"] == "viscous_asymmetry" and result["verdict"]["effects"] == ["viscous_asymmetry"]
    (found,) = (p for p in first["parameters"] if p["key"] == "viscous_asymmetry.difference")
    assert found["value"] == pytest.approx(difference, rel=0.1)
    assert result["verdict"]["subsystem"] == "force"


@pytest.mark.timeout(300)
@pytest.mark.thorough
@pytest.mark.parametrize("difference", [0.0, 35.0], ids=["complete", "asymmetric"])
def test_a_sensor_that_shows_every_newton_is_judged_by_the_force(difference, tmp_path):
    """Of a force that wanders by 1 N the position shows fifty times its noise: by that, nothing is told apart."""
    result = diagnosis_of(
        tmp_path, 4, viscous_difference=difference, noise=5e-8, step=1e-8, disturbance=1.0
    )  # fmt: skip
    verdict = result["verdict"]
    assert verdict["kind"] == ("missing" if difference else "complete"), verdict
    assert verdict["effects"] == (["viscous_asymmetry"] if difference else [])
    assert "stop" not in verdict["text"], verdict["text"]
    if difference:
        assert "forces are compared" in verdict["text"] and verdict["subsystem"] == "force"
        (found,) = (p for p in result["parameters"] if p["key"] == "viscous_asymmetry.difference")
        assert found["value"] == pytest.approx(difference, rel=0.15)


def test_forces_are_not_compared_where_nothing_is_free_or_too_short(tmp_path):
    model, table = model_in(tmp_path), axis.run(np.random.default_rng(4))
    record = Record.sampled("axis", 1.0 / axis.RATE, {"drive": table["command_V"], "position": table["position_m"]})
    assert force_shares(model, [record.window(0.0, 0.9)], []) == []
    fixed = model
    for key in model.free_keys():
        fixed = fixed.with_entry(key, free=False)
    assert not fixed.free_keys() and force_shares(fixed, [record], []) == []


@pytest.mark.timeout(300)
@pytest.mark.skipif(not MEASURED, reason="EMPS_DATA names no DATA_EMPS.mat")
def test_the_measured_axis_misses_a_viscous_friction_that_depends_on_direction(tmp_path):
    result = diagnose(model_in(tmp_path), read_all([MEASURED], "emps")).result
    assert result["verdict"]["kind"] == "missing", result["verdict"]
    assert result["verdict"]["effects"] == ["viscous_asymmetry"], result["verdict"]
    assert result["verdict"]["subsystem"] == "force", result["verdict"]
    assert result["effects"][0]["residual_after"] < result["effects"][0]["residual_before"]
