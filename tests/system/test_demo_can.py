"""The demo over virtual CAN devices: the same job, the same output, another plant."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from system.test_demo import PATIENCE_S, Demo, Finished, finished

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import read_records
from hydraulic_sysid.estimation.metrics import best_fit

pytest.importorskip("rclpy")
pytestmark = [pytest.mark.timeout(PATIENCE_S + 60.0), pytest.mark.thorough]

AS_BUILT = Path(str(resources.files("hydraulic_bringup.demo") / "models" / "as_built.yaml"))


@pytest.fixture(name="run", scope="module")
def run_fixture(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """One whole quick run over CAN."""
    return finished(Demo.start(tmp_path_factory.mktemp("can"), "--quick", "--plant", "can"))


def test_it_ends_well_and_leaves_no_process(run: Finished) -> None:
    logs = "\n".join(log.read_text() for log in (run.out / "logs").glob("*.log"))
    assert run.code == 0, run.errors + run.output + logs
    assert run.left == {}
    assert "start the virtual CAN devices" in run.output
    assert str(run.out / "report.html") in run.output


def test_the_valve_is_left_disabled_before_its_power_is(run: Finished) -> None:
    log = (run.out / "logs" / "devices.log").read_text()
    states = [line for line in log.splitlines() if line.startswith("valve: state")]
    assert [state.rpartition(" ")[2] for state in states[:3]] == ["disabled", "hold", "active"]
    assert states[-1] == "valve: state init"
    assert "emcy" not in log
    assert log.index(states[-1]) < log.index("valve: power off")


@pytest.mark.parametrize("name", ["chirp", "multisine"])
def test_the_record_is_that_of_the_plant_behind_the_devices(run: Finished, name: str) -> None:
    """Drive and position of one stamp belong together: the plant's own model on the recorded drive gives the record."""
    (record,) = read_records(run.out / name)  # in which no sample is missing
    assert record.dt == pytest.approx(2e-3)
    assert {"command", "drive", "position", "velocity", "spool", "pressure_a", "pressure_b"} <= set(record.channels)
    assert record.description["experiment"]["event"] == "finished"
    plant = Plant(load_model(AS_BUILT))
    drive, position = np.asarray(record["drive"]), np.asarray(record["position"])
    start = float(position[0])  # measured with noise, so once more from where all samples say that it was
    again = plant.simulate(drive, record.dt, plant.initial_state(position=start))
    start += float(np.mean(position - again.position))
    again = plant.simulate(drive, record.dt, plant.initial_state(position=start))
    assert best_fit(position, again.position) > 98.5
    assert best_fit(record["velocity"], again.velocity) > 99.9


def test_what_was_hidden_is_found_over_can_as_well(run: Finished) -> None:
    compared: dict[str, Any] = run.result("compare")
    assert compared["model"]["name"] == "moog_mcr_m_1002_bench"
    assert compared["verdict"]["level"] == "off"
    assert compared["summary"]["velocity"]["horizon"]["ratio"] > 3.0
    identified = run.result("identify")
    assert [r["name"] for r in identified["test"]["records"]] == ["multisine"]
    assert identified["test"]["best_fit_one_step"] > 60.0
