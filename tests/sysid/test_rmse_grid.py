"""The RMSE grid: its drives, its errors on a plant that a model knows exactly, its honesty about the stops."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.linear.models import fit_transfer_function
from hydraulic_sysid.linear.validation import SHAPES, Grid, periodic, records_rmse, rmse_grid


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_reach_the_amplitude_and_have_mean_zero(shape: str) -> None:
    drive = periodic(shape, 3.0, 2.0, 5.0, 1e-3)
    assert drive.size == 5000
    assert np.abs(drive).max() == pytest.approx(3.0, rel=0.01)
    assert abs(drive.mean()) < 0.02
    np.testing.assert_allclose(drive[:500], drive[500:1000], atol=1e-9)


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(load_model("moog_mcr_m_1002_bench"))


@pytest.fixture(scope="module")
def model(plant: Plant):
    t = 1e-3 * np.arange(20_000)
    u = 2.0 * sum(np.sin(2 * np.pi * f * t + p) for f, p in ((0.15, 0.0), (0.75, 1.0), (3.0, 2.0)))
    return fit_transfer_function([u], [plant.simulate(u, 1e-3)["position"]], 1e-3)


def test_every_drive_is_tried_away_from_the_stops(plant: Plant, model) -> None:
    cells = rmse_grid({"tf": model}, plant, Grid((1.0, 10.0), (0.05, 1.0), periods=2))
    assert len(cells) == 4 * 2 * 2
    by = {(c["shape"], c["amplitude"], c["frequency"]): c for c in cells}
    assert by["sine", 1.0, 1.0]["models"]["tf"]["best_fit"] > 99.0
    assert by["sine", 1.0, 1.0]["models"]["tf"]["rmse"] < 0.01 * by["sine", 1.0, 1.0]["std"]
    # Full drive for ten seconds is more than the stroke.
    assert not by["square", 10.0, 0.05]["within_travel"]
    assert by["square", 10.0, 0.05]["models"]["tf"]["best_fit"] < 90.0
    assert all(c["within_travel"] for c in cells if c["amplitude"] == 1.0)


def test_measured_records_are_tried_alike(plant: Plant, model) -> None:
    drive = periodic("sine", 2.0, 1.0, 5.0, 1e-3)
    record = Record.sampled("sine", 1e-3, {"drive": drive, "position": plant.simulate(drive, 1e-3)["position"]})
    (row,) = records_rmse({"tf": model}, [record])
    assert row["name"] == "sine" and row["models"]["tf"]["best_fit"] > 99.0


@pytest.mark.parametrize(("change", "word"), [({"shapes": ("star",)}, "star"), ({"amplitudes": (0.0,)}, "positive")])
def test_impossible_grids_say_why(change: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        Grid(**{"amplitudes": (1.0,), "frequencies": (1.0,), **change})
