"""Figures of merit, noise floor and resampling against values worked out by hand or known in the data."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_sysid.data.resampling import held_average, sampled
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.estimation.noise import noise_std, resolution

Y = [1.0, 2.0, 3.0, 4.0]
P = [1.0, 2.0, 3.0, 6.0]


def test_figures_worked_by_hand() -> None:
    assert metrics.mse(Y, P) == pytest.approx(1.0)
    assert metrics.rmse(Y, P) == pytest.approx(1.0)
    assert metrics.nrmse(Y, P) == pytest.approx(2.0 / np.sqrt(5.0))
    assert metrics.best_fit(Y, P) == pytest.approx(100.0 * (1.0 - 2.0 / np.sqrt(5.0)))
    assert metrics.r_squared(Y, P) == pytest.approx(1.0 - 4.0 / 5.0)
    # Ljung (16.25) with d/N = 1/10
    assert metrics.fpe(2.0, 6, 60) == pytest.approx(2.0 * 1.1 / 0.9)


def test_mean_of_the_measurement_fits_zero_percent_and_truth_hundred() -> None:
    assert metrics.best_fit(Y, np.full(4, 2.5)) == pytest.approx(0.0)
    assert metrics.best_fit(Y, Y) == 100.0


def test_still_signal_has_no_relative_error() -> None:
    assert np.isnan(metrics.nrmse(np.ones(5), np.zeros(5)))


@pytest.mark.parametrize("pair", [([1.0], [1.0, 2.0]), ([], []), ([1.0, np.nan], [1.0, 2.0])])
def test_bad_pairs_are_refused(pair: tuple[list[float], list[float]]) -> None:
    with pytest.raises(ValueError):
        metrics.mse(*pair)


def test_fpe_needs_more_samples_than_parameters() -> None:
    with pytest.raises(ValueError, match="6 samples"):
        metrics.fpe(1.0, 6, 6)


def test_cross_correlation_finds_the_delay() -> None:
    rng = np.random.default_rng(1)
    u = rng.standard_normal(5000)
    e = np.roll(u, 7)
    r = metrics.cross_correlation(u, e, 20)
    assert r.size == 41
    assert np.argmax(r) == 20 + 7
    assert r[27] == pytest.approx(1.0, abs=0.01)


def test_white_noise_stays_within_the_bound() -> None:
    e = np.random.default_rng(2).standard_normal(10000)
    r = metrics.autocorrelation(e, 200)
    assert r[0] == pytest.approx(1.0)
    outside = np.mean(np.abs(r[1:]) > 1.96 / np.sqrt(e.size))
    assert outside < 0.1


@pytest.mark.parametrize("sigma", [2e-5, 1e-3])
def test_noise_std_of_a_moving_rounded_signal(sigma: float) -> None:
    t = np.arange(0.0, 20.0, 1e-3)
    rng = np.random.default_rng(3)
    motion = 0.2 * np.sin(2 * np.pi * 0.7 * t) + 0.01 * np.sign(np.sin(2 * np.pi * 0.3 * t))
    lsb = 2.4e-5
    measured = np.round((motion + sigma * rng.standard_normal(t.size)) / lsb) * lsb
    expected = np.hypot(sigma, lsb / np.sqrt(12.0))
    assert noise_std(measured) == pytest.approx(expected, rel=0.05)
    assert resolution(measured) == pytest.approx(lsb, rel=1e-6)


def test_noise_std_of_a_rounded_still_signal_is_its_rounding() -> None:
    y = np.repeat([0.0, 0.01, 0.02], 200)
    assert noise_std(y) == pytest.approx(0.01 / np.sqrt(12.0))


def test_resampling_keeps_an_integrator_exact() -> None:
    """The slow samples of an integrating plant follow from the averaged drive, for any ratio of sampling times."""
    rng = np.random.default_rng(4)
    u, dt = rng.standard_normal(1000), 0.02
    y = np.concatenate(([0.0], np.cumsum(u)[:-1])) * dt
    for sampling_time in (0.02, 0.05, 0.1):
        slow_u, slow_y = held_average(u, dt, sampling_time), sampled(y, dt, sampling_time)
        assert slow_u.size == slow_y.size == round(1000 * dt / sampling_time)
        assert np.allclose(np.diff(slow_y), slow_u[:-1] * sampling_time, atol=1e-12)


@pytest.mark.parametrize(("sampling_time", "word"), [(0.01, "shorter"), (30.0, "longer")])
def test_resampling_says_what_it_cannot_do(sampling_time: float, word: str) -> None:
    for function in (held_average, sampled):
        with pytest.raises(ValueError, match=word):
            function(np.zeros(100), 0.1, sampling_time)
