"""A comparison finds nothing where there is nothing, and finds the right place where there is something."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.model_file import Model, load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.decimation import envelope
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.compare import ComparisonError, ModelSubject
from hydraulic_sysid.diagnosis.compare import compare as compare_subject
from hydraulic_sysid.diagnosis.compare.error_maps import Binning, error_map, folds_of, independent_samples
from hydraulic_sysid.diagnosis.compare.spectra import amplitude_density, noise_density
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

DT = 1e-3
NOISE = {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}


def compare(model: Model, *arguments: Any, **settings: Any) -> dict[str, Any]:
    return compare_subject(ModelSubject(model), *arguments, **settings)


def drive(seconds: float, seed: int) -> np.ndarray:
    """A few tones of a few volts."""
    t = np.arange(0.0, seconds, DT)
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, 4)
    tones = ((0.3, 1.5), (0.7, 1.0), (1.9, 0.8), (4.1, 0.5))
    return sum(a * np.sin(2 * np.pi * f * t + p) for (f, a), p in zip(tones, phases, strict=True))


def record_of(model: Model, seed: int = 0, seconds: float = 6.0, channels: tuple[str, ...] = tuple(NOISE)) -> Record:
    """What a bench with this model's physics would have measured."""
    u = drive(seconds, seed)
    run = Plant(model).simulate(u, DT)
    rng = np.random.default_rng(100 + seed)
    measured = {name: run[name] + NOISE[name] * rng.standard_normal(u.size) for name in channels}
    return Record(
        name=f"tones{seed}", time=DT * np.arange(u.size), dt=DT, channels={"drive": u, **measured}, source=Path("made"),
        description={},
    )  # fmt: skip


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


@pytest.fixture(scope="module")
def exact(model: Model) -> dict[str, Any]:
    return compare(model, [record_of(model, 0), record_of(model, 1)])


@pytest.fixture(scope="module")
def wrong(model: Model) -> dict[str, Any]:
    """The plant has a dead band that the model lacks."""
    plant = model.with_effect("valve_deadband", {"width": 0.02})
    return compare(model, [record_of(plant, 0), record_of(plant, 1)])


@pytest.mark.parametrize("mode", ["free_run", "horizon", "one_step"])
def test_exact_model_is_at_the_floor_everywhere(exact: dict[str, Any], mode: str) -> None:
    assert set(exact["summary"]) == {"position", "velocity", "pressure_a", "pressure_b", "load_pressure"}
    for channel, figures in exact["summary"].items():
        assert 0.7 < figures[mode]["ratio"] < 1.4, (channel, figures[mode])


def test_exact_model_is_called_so_and_nothing_is_claimed(exact: dict[str, Any]) -> None:
    assert exact["verdict"]["level"] == "explained"
    assert {f["kind"] for f in exact["findings"]} <= {"at_noise", "drift"}
    for maps in exact["error_maps"].values():
        for variable, m in maps.items():
            assert m["explained"] < max(0.1, m["chance_level"]), variable


def test_noise_is_found_in_the_data(exact: dict[str, Any]) -> None:
    for record in exact["records"]:
        for channel, sigma in NOISE.items():
            assert record["channels"][channel]["noise_std"] == pytest.approx(sigma, rel=0.1)
        assert record["channels"]["load_pressure"]["noise_std"] == pytest.approx(np.hypot(1.5e4, 1.5e4), rel=0.1)


def test_missing_dead_band_shows_over_the_drive_as_a_change_of_sign(wrong: dict[str, Any]) -> None:
    assert wrong["verdict"]["level"] != "explained"
    best = [f for f in wrong["findings"] if f["kind"] == "depends_on"][0]
    assert best["channel"] == "velocity"
    assert best["numbers"]["variable"] == "drive"
    assert best["numbers"]["explained"] > 0.5
    assert "changes sign with drive" in best["text"]
    m = wrong["error_maps"]["velocity"]["drive"]
    assert (m["mean"][m["center"] > 0.5] < 0.0).all()
    assert (m["mean"][m["center"] < -0.5] > 0.0).all()


def test_record_without_pressures_is_compared_in_position_and_velocity(model: Model) -> None:
    result = compare(model, [record_of(model, 2, channels=("position",))])
    assert set(result["summary"]) == {"position", "velocity"}
    assert result["summary"]["position"]["horizon"]["ratio"] < 1.5
    assert "load_pressure" not in result["variables"]


def test_horizon_restarts_from_the_measurement_and_free_run_drifts(model: Model) -> None:
    """A null bias of the plant makes the free run drift at a constant speed that the result tells."""
    record = record_of(model)
    biased = replace(record, channels={**record.channels, "drive": record["drive"] + 0.2})
    result = compare(model, [biased])
    free = result["records"][0]["channels"]["position"]["free_run"]
    horizon = result["records"][0]["channels"]["position"]["horizon"]
    gain = Plant(model).simulate(np.full(3000, 0.2), DT).velocity[-1]
    assert free["drift"] == pytest.approx(-gain, rel=0.1)
    assert free["rmse_detrended"] < 0.2 * free["rmse"]
    assert horizon["rmse"] == pytest.approx(0.475 * gain, rel=0.1)
    assert any(f["kind"] == "drift" for f in result["findings"])


def test_error_growth_ends_where_the_horizon_table_begins(wrong: dict[str, Any]) -> None:
    for record in wrong["records"]:
        growth = record["error_growth"]
        assert growth["lead_time"][-1] == pytest.approx(0.5)
        assert growth["position"]["rms"][-1] == pytest.approx(
            record["channels"]["position"]["horizon"]["rmse"], rel=0.2
        )
        assert growth["position"]["exact_rms"][-1] < growth["position"]["rms"][-1]


def test_what_cannot_be_compared_is_named(model: Model) -> None:
    record = record_of(model, seconds=0.8)
    with pytest.raises(ComparisonError, match="tones0: 0.8 s long"):
        compare(model, [record])
    without = replace(record, channels={"drive": record["drive"]})
    with pytest.raises(ComparisonError, match="no channel 'position'"):
        compare(model, [without])
    with pytest.raises(ComparisonError, match="shorter than ten samples"):
        compare(model, [record], horizon=0.005)
    with pytest.raises(ComparisonError, match="no record"):
        compare(model, [])


def test_explained_share_is_one_for_the_cause_and_zero_for_a_bystander() -> None:
    rng = np.random.default_rng(5)
    time = [np.arange(0.0, 10.0, DT), np.arange(0.0, 10.0, DT)]
    folds = folds_of(time)
    cause, other = rng.standard_normal(20000), rng.standard_normal(20000)
    error = np.sign(cause) + 0.01 * rng.standard_normal(20000)
    assert error_map(error, Binning.of(cause), folds).explained > 0.9
    assert abs(error_map(error, Binning.of(other), folds).explained) < 0.02
    assert np.isnan(error_map(error, Binning.of(cause), np.zeros(20000, dtype=int)).explained)


def test_slow_error_has_few_independent_samples() -> None:
    rng = np.random.default_rng(9)
    folds = np.repeat([0, 1], 10_000)
    white = rng.standard_normal(20_000)
    assert independent_samples(white, folds) == pytest.approx(20_000, rel=0.3)
    slow = np.repeat(rng.standard_normal(40), 500)
    assert independent_samples(slow, folds) == pytest.approx(40, rel=0.5)
    # By chance alone, such an error may look explained; the map says how far.
    for seed in range(5):
        variable = np.repeat(np.random.default_rng(seed).standard_normal(40), 500)
        m = error_map(slow, Binning.of(variable), folds)
        assert m.chance_level > 0.1
        assert m.explained < m.chance_level


def test_map_statistics_and_missing_samples() -> None:
    values = np.repeat([0.0, 1.0, 2.0], 1000)
    error = np.repeat([1.0, -2.0, np.nan], 1000)
    m = error_map(error, Binning.of(values, np.array([-0.5, 0.5, 1.5, 2.5])), np.arange(3000) % 2)
    assert m.center.tolist() == [0.0, 1.0]
    assert m.count.tolist() == [1000, 1000]
    assert m.mean.tolist() == [1.0, -2.0]
    assert m.rms.tolist() == [1.0, 2.0]
    assert m.explained == pytest.approx(1.0)


def test_velocity_filter_is_longer_for_slow_motion_and_reports_its_noise() -> None:
    t = np.arange(0.0, 10.0, DT)
    rng = np.random.default_rng(6)
    noise = 2e-5 * rng.standard_normal(t.size)
    slow = VelocityFilter.for_signal(0.1 * np.sin(2 * np.pi * 0.2 * t) + noise, DT, 2e-5)
    fast = VelocityFilter.for_signal(2e-3 * np.sin(2 * np.pi * 30.0 * t) + noise, DT, 2e-5)
    assert slow.window > 2 * fast.window
    inner = slice(100, -100)
    assert np.std(slow(noise)[inner]) == pytest.approx(2e-5 * slow.noise_gain, rel=0.1)
    true = 2e-3 * 2 * np.pi * 30.0 * np.cos(2 * np.pi * 30.0 * t)
    clean = 2e-3 * np.sin(2 * np.pi * 30.0 * t)
    assert np.abs(fast(clean) - true)[inner].max() < 0.05 * true.max()


def test_noise_density_is_what_welch_measures() -> None:
    noise = 3.0 * np.random.default_rng(7).standard_normal(200_000)
    frequency, density = amplitude_density(noise, DT)
    assert np.median(density / noise_density(frequency, 3.0, DT)) == pytest.approx(1.0, abs=0.03)
    derivative = VelocityFilter(DT, 21)
    frequency, density = amplitude_density(derivative(noise), DT)
    band = frequency < 40.0
    assert np.median((density / noise_density(frequency, 3.0, DT, derivative))[band]) == pytest.approx(1.0, abs=0.05)


def test_envelope_keeps_every_peak_in_order() -> None:
    rng = np.random.default_rng(8)
    t = np.arange(10_007) * DT
    y = rng.standard_normal(t.size)
    y[5003] = 50.0
    y[5004] = -50.0
    y[:3] = np.nan
    te, ye = envelope(t, y, 200)
    assert te.size <= 400
    assert (np.diff(te) > 0.0).all()
    assert ye.max() == 50.0
    assert ye.min() == -50.0
    short = envelope(t[:100], y[:100])
    assert short[0].size == 97
