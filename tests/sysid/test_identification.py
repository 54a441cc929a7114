"""An identification tells held-out data from fitted ones, and an unstable model from a poor one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_sysid.data.records import Record
from hydraulic_sysid.linear.identification import IdentificationSettings, identify
from hydraulic_sysid.linear.models import Arx, ArxOrder, IdentificationError

DT = 0.01


def record_of(y: np.ndarray, u: np.ndarray, name: str = "made") -> Record:
    time = DT * np.arange(u.size)
    return Record(name=name, time=time, dt=DT, channels={"drive": u, "position": y}, source=Path("made"))


def plant(n: int, seed: int, noise: float) -> Record:
    """A sampled second-order plant with known one-step noise."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(n), noise * rng.standard_normal(n)
    den = [1.0, -1.6, 0.64]
    return record_of(lfilter([0.0, 0.05, 0.04], den, u) + lfilter([1.0], den, e), u, f"made{seed}")


def test_final_prediction_error_foresees_the_error_on_test_data() -> None:
    settings = IdentificationSettings(Arx(ArxOrder(2, 2, 1)), sampling_time=DT, holdout=0.5)
    result, _ = identify([plant(8000, 1, 0.02)], settings=settings)
    assert result["test"]["mse_one_step"] == pytest.approx(result["test"]["fpe"], rel=0.1)
    assert result["test"]["fpe"] == pytest.approx(0.02**2, rel=0.1)
    tests = result["test"]["records"][0]["residual_tests"]
    assert np.mean(np.abs(tests["autocorrelation"][1:]) > tests["bound"]) < 0.2
    assert np.mean(np.abs(tests["cross_correlation"]) > tests["bound"]) < 0.2


def test_too_low_an_order_fails_the_residual_tests() -> None:
    settings = IdentificationSettings(Arx(ArxOrder(1, 1, 1)), sampling_time=DT, holdout=0.5)
    tests = identify([plant(8000, 2, 0.02)], settings=settings)[0]["test"]["records"][0]["residual_tests"]
    assert np.mean(np.abs(tests["autocorrelation"][1:]) > tests["bound"]) > 0.3


def test_the_test_part_has_no_say_in_the_fit() -> None:
    first = plant(1000, 3, 0.02)
    spoilt = np.concatenate((first["position"][:800], np.random.default_rng(0).standard_normal(200)))
    settings = IdentificationSettings(Arx(ArxOrder(2, 2, 1)), sampling_time=DT)
    clean, dirty = (identify([r], settings=settings)[0] for r in (first, record_of(spoilt, first["drive"])))
    assert clean["model"]["coefficients"] == dirty["model"]["coefficients"]
    assert dirty["test"]["best_fit_free_run"] < 50.0 < clean["test"]["best_fit_free_run"]


def test_unstable_model_is_called_unstable() -> None:
    u = np.random.default_rng(4).standard_normal(1500)
    y = lfilter([0.0, 1.0], [1.0, -1.05], u)
    result, _ = identify([record_of(y, u)], settings=IdentificationSettings(Arx(ArxOrder(1, 1, 1)), sampling_time=DT))
    assert result["verdict"]["level"] == "off"
    assert "unstable (pole at |z| = 1.05)" in result["verdict"]["text"]
    assert np.isnan(result["test"]["best_fit_free_run"])
    assert result["test"]["best_fit_one_step"] > 99.0


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        (IdentificationSettings(sampling_time=0.001), "shorter than the record's 0.01 s"),
        (IdentificationSettings(holdout=1.5), "between 0 and 1"),
        (IdentificationSettings(holdout=0.01), "too few"),
        (IdentificationSettings(output="pressure_a"), "no channel 'pressure_a'"),
    ],
)
def test_impossible_settings_say_why(settings: IdentificationSettings, word: str) -> None:
    with pytest.raises(IdentificationError, match=word):
        identify([plant(500, 5, 0.0)], settings=settings)


def test_no_record_is_an_error() -> None:
    with pytest.raises(IdentificationError, match="no record"):
        identify([])
