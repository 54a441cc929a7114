"""A motor axis without hydraulics: an independent one with a hidden effect, and the measured one where it is there."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from hidden_effects import axis
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.search import diagnose

MEASURED = os.environ.get("EMPS_DATA", "")  # DATA_EMPS.mat of the nonlinear benchmark


def model_in(folder: Path):
    path = folder / "model.yaml"
    path.write_text(axis.MODEL)
    return load_model(path)


@pytest.fixture(params=[0.0, 40.0], ids=["complete", "asymmetric"])
def diagnosed(request, tmp_path):
    table = axis.run(np.random.default_rng(1), viscous_difference=request.param)
    path = tmp_path / "axis.csv"
    np.savetxt(path, np.stack(list(table.values()), axis=1), "%.7f", ",", header=",".join(table), comments="")
    return request.param, diagnose(model_in(tmp_path), read_all([path])).result


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
@pytest.mark.skipif(not MEASURED, reason="EMPS_DATA names no DATA_EMPS.mat")
def test_the_measured_axis_misses_an_effect_of_its_force_balance(tmp_path):
    result = diagnose(model_in(tmp_path), read_all([MEASURED], "emps")).result
    assert result["verdict"]["kind"] in ("missing", "indistinguishable"), result["verdict"]
    assert result["verdict"]["subsystem"] == "force", result["verdict"]
    assert result["effects"][0]["residual_after"] < result["effects"][0]["residual_before"]
