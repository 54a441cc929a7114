"""Frequency responses on systems whose response, noise and distortion are known, and beside scipy."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject
from scipy import signal

from hydraulic_node_utils.cli import run_verb
from hydraulic_sysid.data.records import Record, save
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.signals.odd_random_phase_multisine import OddRandomPhaseMultisine
from hydraulic_sysid.excitation.signals.random_phase_multisine import RandomPhaseMultisine
from hydraulic_sysid.linear.frequency_response import (
    FrequencyResponseError,
    best_linear_approximation,
    etfe,
    periods_of,
    welch,
)
from hydraulic_sysid.linear.frequency_response.document import respond

DT = 1e-3
NUM, DEN = signal.butter(2, 20.0, fs=1.0 / DT)


def white(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(count)


def test_welch_is_that_of_scipy() -> None:
    u = white(20_000)
    y = signal.lfilter(NUM, DEN, u) + 0.1 * white(20_000, 2)
    found = welch(u, y, DT, 0.5, integrating=False)
    options = {"fs": 1.0 / DT, "nperseg": 500, "detrend": "constant"}
    f, cross = signal.csd(u, y, **options)
    np.testing.assert_allclose(found.frequency, f[1:])
    np.testing.assert_allclose(found.response, (cross / signal.welch(u, **options)[1])[1:], rtol=1e-10)
    np.testing.assert_allclose(found.coherence, signal.coherence(u, y, **options)[1][1:], rtol=1e-10)


def test_the_empirical_estimate_of_a_periodic_drive_is_the_response() -> None:
    u = np.tile(white(2000), 4)
    y = signal.lfilter(NUM, DEN, u)[-2000:]
    found = etfe(u[-2000:], y, DT, 2.0, integrating=False)
    inner = slice(5, 60)
    expected = signal.freqz(NUM, DEN, found.frequency, fs=1.0 / DT)[1]
    np.testing.assert_allclose(found.response[inner], expected[inner], rtol=0.05)
    assert found.coherence[inner].min() > 0.99


def test_the_deviation_says_how_far_the_estimate_is_off() -> None:
    inside = []
    for seed in range(8):
        u = white(30_000, 2 * seed)
        y = signal.lfilter(NUM, DEN, u) + 0.3 * white(30_000, 2 * seed + 1)
        found = welch(u, y, DT, 1.0, integrating=False)
        part = slice(1, 20)
        expected = signal.freqz(NUM, DEN, found.frequency[part], fs=1.0 / DT)[1]
        inside.append(np.abs(found.response[part] - expected) / found.deviation[part])
    assert np.mean(np.square(inside)) == pytest.approx(1.0, abs=0.35)


def test_an_integrator_that_drifts_is_seen_through() -> None:
    """A position that runs away over the record, by 20 times its motion, has the response of an integrator."""
    u = white(40_000) + 0.5
    y = np.concatenate(([0.0], np.cumsum(u)[:-1])) * DT
    found = welch(u, y, DT, 2.0)
    band = (found.frequency > 1.0) & (found.frequency < 100.0)
    expected = DT / (np.exp(2j * np.pi * found.frequency[band] * DT) - 1.0)
    np.testing.assert_allclose(found.response[band], expected, rtol=0.02)
    assert found.coherence[band].min() > 0.999


@pytest.mark.parametrize("segment", [1e-3, 30.0])
def test_a_segment_must_fit(segment: float) -> None:
    with pytest.raises(FrequencyResponseError, match="segment"):
        welch(white(1000), white(1000), DT, segment)


def multisine(kind: type, seed: int, periods: int = 5, highest: float = 40.0) -> Plan:
    drive = kind(rms=1.0, period=2.0, frequency_min=0.5, frequency_max=highest, seed=seed)
    return Plan("drive", drive, 1.0, duration=2.0 * periods + 1.0, fade_in=0.5, fade_out=0.5, rest_after=0.05)


def record(plan: Plan, plant: Callable[[np.ndarray], np.ndarray], noise: float = 0.0, seed: int = 0) -> Record:
    drive = plan.open_loop
    position = plant(drive) + noise * white(drive.size, seed)
    description = {"experiment": {"plan": plan.as_mapping()}}
    return Record.sampled(f"r{seed}", DT, {"drive": drive, "position": position}, description=description)


def linear(u: np.ndarray) -> np.ndarray:
    return signal.lfilter(NUM, DEN, u)


def test_the_noise_of_a_linear_plant_is_found_and_no_distortion() -> None:
    sigma = 0.05
    records = [record(multisine(OddRandomPhaseMultisine, s), linear, sigma, s) for s in range(1, 9)]
    found = best_linear_approximation([periods_of(r) for r in records])
    expected = signal.freqz(NUM, DEN, found.frequency, fs=1.0 / DT)[1]
    off = np.abs(found.response - expected)
    assert np.sqrt(np.mean(off**2 / found.noise**2)) == pytest.approx(1.0, abs=0.2)
    # Amplitude of a line of white noise in the mean of P periods of N samples: E|2X/N|² = 4σ²/(N·P).
    line = sigma * np.sqrt(4.0 / (2000 * found.periods))
    assert np.sqrt(np.mean(found.output_noise**2)) == pytest.approx(line, rel=0.15)
    assert found.odd is not None and found.even is not None and found.total is not None
    for lines in (found.odd, found.even):
        assert np.sqrt(np.mean(lines.amplitude**2)) == pytest.approx(line, rel=0.15)
    assert np.sqrt(np.mean(found.total**2)) == pytest.approx(np.sqrt(np.mean(found.noise**2)), rel=0.25)


@pytest.mark.parametrize(("power", "shows", "silent"), [(2, "even", "odd"), (3, "odd", "even")])
def test_even_and_odd_distortion_fall_on_their_own_lines(power: int, shows: str, silent: str) -> None:
    plan = multisine(OddRandomPhaseMultisine, 3)
    found = best_linear_approximation([periods_of(record(plan, lambda u: u + 0.1 * u**power))])
    level = {name: np.sqrt(np.mean(getattr(found, name).amplitude ** 2)) for name in ("odd", "even")}
    # The same from the drive's own powers, line by line.
    u = plan.signal.sample(np.arange(2000) * DT)
    known = 0.1 * 2.0 / 2000 * np.abs(np.fft.rfft(u**power))
    lines = np.rint(getattr(found, shows).frequency * 2.0).astype(int)
    np.testing.assert_allclose(getattr(found, shows).amplitude, known[lines], rtol=1e-3, atol=1e-9)
    assert level[silent] < 1e-6 * level[shows]


def test_the_best_linear_approximation_of_a_cubic_and_its_distortion() -> None:
    """For a normally distributed drive of variance σ² the BLA of u + a·u³ is 1 + 3·a·σ² (Bussgang)."""
    a = 0.1
    records = [
        record(multisine(RandomPhaseMultisine, s, highest=100.0), lambda u: u + a * u**3, 0.01, s) for s in range(1, 17)
    ]
    found = best_linear_approximation([periods_of(r) for r in records])
    assert np.mean(found.response.real) == pytest.approx(1.0 + 3.0 * a, abs=0.02)
    assert found.distortion is not None and found.total is not None
    # What differs between the realisations, measured directly.
    each = np.array([np.fft.rfft(p.output[0]) / np.fft.rfft(p.drive[0]) for p in map(periods_of, records)])
    spread = np.std(each[:, np.rint(found.frequency * 2.0).astype(int)], axis=0, ddof=1)
    assert np.sqrt(np.mean(found.distortion**2)) == pytest.approx(np.sqrt(np.mean(spread**2)), rel=0.1)
    assert np.sqrt(np.mean(found.total**2)) > 5.0 * np.sqrt(np.mean(found.noise**2))


def test_a_drift_between_the_periods_is_no_noise() -> None:
    plan = multisine(OddRandomPhaseMultisine, 3)

    def drifting(u: np.ndarray) -> np.ndarray:
        return np.concatenate(([0.0], np.cumsum(u + 2.0)[:-1])) * DT

    one = record(plan, drifting)
    # The drive that is recorded lacks the constant, as that of a valve with a null bias does.
    found = best_linear_approximation([periods_of(one)])
    expected = DT / (np.exp(2j * np.pi * found.frequency * DT) - 1.0)
    np.testing.assert_allclose(found.response, expected, rtol=1e-3)
    assert found.odd is not None
    assert found.odd.amplitude.max() < 1e-3 * found.output.max()


def test_periods_of_a_record_without_a_plan_are_told() -> None:
    plan = multisine(RandomPhaseMultisine, 1)
    known = record(plan, linear)
    bare = Record.sampled("bare", DT, dict(known.channels))
    with pytest.raises(FrequencyResponseError, match="give its period"):
        periods_of(bare)
    found = periods_of(bare.window(0.0, 11.0), period=2.0, start=1.0)
    np.testing.assert_array_equal(found.harmonics, periods_of(known).harmonics)
    with pytest.raises(FrequencyResponseError, match="no multiple"):
        periods_of(bare, period=1.23456)
    with pytest.raises(FrequencyResponseError, match="no two whole periods"):
        periods_of(bare, period=8.0)


def test_realisations_must_share_period_and_lines() -> None:
    one, other = (record(multisine(RandomPhaseMultisine, 1, highest=h), linear) for h in (20.0, 40.0))
    with pytest.raises(FrequencyResponseError, match="realisations share"):
        best_linear_approximation([periods_of(one), periods_of(other)])


def test_the_document_says_how_nonlinear_the_plant_is() -> None:
    plan = multisine(OddRandomPhaseMultisine, 3)
    result = respond([record(plan, lambda u: linear(u) + 0.03 * linear(u) ** 3, 1e-4)], output="position")
    assert result["method"] == "bla"
    assert result["levels_db"]["odd_distortion"] > -40.0
    assert result["levels_db"]["even_distortion"] is None or result["levels_db"]["even_distortion"] < -60.0
    assert result["verdict"]["level"] == "close"
    assert "No linear model can fit" in result["verdict"]["text"]
    assert 90.0 < result["linear_fit_limit"] < 99.9
    clean = respond([record(plan, linear, 1e-4)])
    assert clean["verdict"]["level"] == "explained"


def test_what_no_linear_model_can_fit_is_what_the_best_one_leaves() -> None:
    """The plant's best linear approximation is its filter times a constant, which is fitted here over the played
    lines."""
    told, left = [], []
    for seed in range(1, 13):
        one = record(multisine(OddRandomPhaseMultisine, seed), lambda u: linear(u) + 0.05 * linear(u) ** 3)
        told.append(100.0 - respond([one])["linear_fit_limit"])
        cut = periods_of(one)
        output, drive = np.fft.rfft(cut.output[0]), np.fft.rfft(cut.drive[0])
        shape = np.zeros_like(output)
        lines = cut.harmonics
        shape[lines] = signal.freqz(NUM, DEN, lines * cut.spacing, fs=1.0 / DT)[1] * drive[lines]
        constant = np.vdot(shape, output) / np.vdot(shape, shape)
        band = slice(lines.min(), lines.max() + 1)
        rest = np.sum(np.abs(output - constant * shape)[band] ** 2) / np.sum(np.abs(output[band]) ** 2)
        left.append(100.0 * np.sqrt(rest))
    assert np.mean(told) == pytest.approx(np.mean(left), rel=0.1)


def test_the_verb_writes_document_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = multisine(OddRandomPhaseMultisine, 3)
    one = record(plan, linear, 1e-3)
    file = save(Record.sampled("r", DT, {"drive": one["drive"], "position": one["position"]}), tmp_path / "r.csv")
    arguments = ["frequency_response", "--record", str(file)]
    periodic = ["--period", "2", "--start", "1", "--out", str(tmp_path / "bla")]
    assert run_verb("hydraulic_sysid", [*arguments, *periodic]) == 0
    assert run_verb("hydraulic_sysid", [*arguments, "--out", str(tmp_path / "welch")]) == 0
    documents = [json.loads((tmp_path / n / "frequency_response.json").read_text()) for n in ("bla", "welch")]
    assert [d["method"] for d in documents] == ["bla", "welch"]
    assert documents[1]["levels_db"] is None
    for document in documents:
        assert_cannot_inject(document)
    assert "Plotly" in (tmp_path / "bla" / "report.html").read_text(encoding="utf-8")
    assert run_verb("hydraulic_sysid", [*arguments, "--output", "pressure_a", "--out", str(tmp_path / "none")]) == 2
    assert "no channel 'pressure_a'" in capsys.readouterr().err
