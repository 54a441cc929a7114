"""Identification of public measured records, where they are at hand (HYDRAULIC_DATASETS names their folder)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from hydraulic_sysid.data.records import read_records
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.identification import IdentificationSettings, identify
from hydraulic_sysid.linear.models import Arx, ArxOrder, StateSpace, TransferFunction
from valve_actuator import fit_valve_actuator

DATASETS = Path(os.environ.get("HYDRAULIC_DATASETS", "/nowhere"))
pytestmark = pytest.mark.skipif(
    not DATASETS.is_dir(), reason="HYDRAULIC_DATASETS does not name the folder of the public records"
)


def test_the_crane_of_the_literature() -> None:
    """First half to fit, last half in free run: the linear figure that is quoted, and the nonlinear model below it."""
    (record,) = read_records(DATASETS / "hydraulic_actuator_sjoberg" / "actuator.mat", "sjoberg_actuator")
    u, y = record["valve"], record["pressure"]
    linear = Arx(ArxOrder(3, 2, 1)).fit([u[:512]], [y[:512]], 1.0, "none")
    assert metrics.rmse(y[512:], linear.simulate(u[512:], y[512:])) == pytest.approx(1.01, abs=0.01)
    nonlinear = fit_valve_actuator([u[:512]], [y[:512]], 1.0)
    assert metrics.rmse(y[512:], nonlinear.simulate(u[512:], y[512:])) < 0.55


@pytest.mark.parametrize(
    ("file", "columns", "output", "structure", "free_run"),
    [
        ("HangingLoad.csv", "festo_hanging_load", "position", TransferFunction(), 80.0),
        ("HangingLoad.csv", "festo_hanging_load", "position", StateSpace(), 80.0),
        ("MotorRotation.csv", "festo_motor_rotation", "speed_signal", StateSpace(), 70.0),
    ],
)
def test_the_training_bench_in_free_run_and_one_step(file, columns, output, structure, free_run: float) -> None:
    """The last fifth, which the fit has not seen; one step ahead says little of a slow record, free run much."""
    records = read_records(DATASETS / "mataveid_festo_hydraulics" / file, columns)
    settings = IdentificationSettings(structure=structure, sampling_time=0.1, output=output)
    held = identify(records, settings=settings)[0]["test"]
    assert held["best_fit_free_run"] > free_run
    assert held["best_fit_one_step"] > 95.0
