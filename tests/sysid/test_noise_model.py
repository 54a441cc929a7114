"""Noise of every kind is judged as 1 × noise, and what is not noise stays what it is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from hydraulic_sysid.estimation import noise_model
from hydraulic_sysid.estimation.noise import spikes
from hydraulic_sysid.estimation.noise_model import ChannelNoise, estimate, mains_lines
from hydraulic_sysid.estimation.projection import project_out

Array = np.ndarray

DT = 1e-3
SEGMENTS, SAMPLES = 60, 501


def low_passed(order: int, corner: float) -> Array:
    white = np.random.default_rng(1).standard_normal((SEGMENTS, 4 * SAMPLES))
    return lfilter(*butter(order, corner * 2.0 * DT), white, axis=1)[:, -SAMPLES:]


def quantised(step: float) -> Array:
    """Noise and a little motion through a converter, less the motion: what an exact model leaves."""
    draw = np.random.default_rng(2)
    motion = 20.0 * np.sin(0.05 * np.arange(SEGMENTS * SAMPLES)).reshape(SEGMENTS, SAMPLES)
    return np.round((motion + draw.standard_normal(motion.shape)) / step) * step - motion


KINDS = {
    "white": lambda: np.random.default_rng(0).standard_normal((SEGMENTS, SAMPLES)),
    "second order 400 Hz": lambda: low_passed(2, 400.0),
    "second order 200 Hz": lambda: low_passed(2, 200.0),
    "second order 100 Hz": lambda: low_passed(2, 100.0),
    "fourth order 400 Hz": lambda: low_passed(4, 400.0),
    "12 bit": lambda: quantised(2.0),
}


@pytest.mark.parametrize("kind", KINDS)
def test_whitened_noise_has_unit_variance_and_no_colour(kind: str) -> None:
    values = 1.5e4 * KINDS[kind]()
    noise = estimate([values[:30], values[30:]], DT)
    white = noise.whiten(values)
    assert 0.95 < np.sqrt(np.mean(white**2)) < 1.05
    assert noise.std == pytest.approx(np.std(values), rel=0.05)
    for lag in range(1, 13):  # a filter that ends in a zero at the Nyquist frequency is no autoregression of order 12
        assert abs(np.mean(white[:, :-lag] * white[:, lag:])) < 0.12, lag
    assert np.mean(white[:, 0] ** 2) == pytest.approx(1.0, abs=0.5)  # the first samples count like all others


def test_segments_that_hold_more_than_noise_do_not_raise_it() -> None:
    values = low_passed(2, 200.0)
    alone = estimate([values], DT)
    values[::3] += 20.0 * np.std(values) * np.sin(0.01 * np.arange(SAMPLES))
    with_errors = estimate([values], DT)
    assert with_errors.innovation == pytest.approx(alone.innovation, rel=0.05)
    assert with_errors.std == pytest.approx(alone.std, rel=0.1)


def test_a_slow_error_of_the_model_is_not_coloured_noise() -> None:
    """It is in every segment, so that none shows the noise alone; above the plant's band there is only noise."""
    white = np.random.default_rng(0).standard_normal((SEGMENTS, SAMPLES))
    slow = 3.0 * np.sin(2.0 * np.pi * 2.0 * DT * np.arange(SEGMENTS * SAMPLES)).reshape(white.shape)
    noise = estimate([white + slow], DT)
    assert noise.std < 1.4
    assert np.sqrt(np.mean(noise.whiten(slow) ** 2)) > 1.0


@pytest.mark.parametrize("corner", [100.0, 400.0])
def test_colour_is_the_inverse_of_whiten(corner: float) -> None:
    values = low_passed(2, corner)
    noise = estimate([values], DT)
    assert np.allclose(noise.colour(noise.whiten(values)), values, rtol=0.0, atol=1e-9)
    assert np.allclose(noise.whiten(noise.colour(values)), values, rtol=0.0, atol=1e-7)


def test_whitening_is_that_of_the_covariance() -> None:
    noise = estimate([low_passed(2, 200.0)], DT)
    whitener = noise.whiten(np.eye(40)[None])[0]
    covariance = np.linalg.inv(whitener.T @ whitener)
    assert covariance[0, : noise.order] == pytest.approx(noise.autocovariance[: noise.order], rel=1e-6, abs=1e-12)
    assert np.diag(covariance) == pytest.approx(np.full(40, noise.std**2), rel=1e-4)


def test_columns_are_whitened_like_residuals() -> None:
    noise, values = estimate([low_passed(2, 200.0)], DT), np.random.default_rng(3).standard_normal((4, 60, 3))
    each = np.stack([noise.whiten(values[..., k]) for k in range(3)], axis=-1)
    assert np.allclose(noise.whiten(values), each)


def test_missing_samples_cost_exactly_their_degrees_of_freedom() -> None:
    values = low_passed(2, 200.0)[:8]
    noise = estimate([low_passed(2, 200.0)], DT)
    out = np.zeros(values.shape, dtype=bool)
    out[2, [0, 17, 18, 400]] = out[5, -1] = True

    def cost(v: Array) -> Array:
        white = noise.whiten(v)
        for row, basis in noise.missing(out):
            white[row] = project_out(basis, white[row][:, None])[:, 0]
        return np.sum(white**2, axis=1)

    wild = np.where(out, 1e3, values)
    assert np.allclose(cost(wild), cost(values), rtol=1e-6)  # whatever stands in their place
    assert {row: basis.shape[1] for row, basis in noise.missing(out)} == {2: 4, 5: 1}
    # What is left is that of the present samples by themselves: a dense covariance says the same.
    present = np.flatnonzero(~out[2])
    root = noise.whiten(np.eye(SAMPLES)[None])[0]
    covariance = np.linalg.inv(root.T @ root)[np.ix_(present, present)]
    assert cost(values)[2] == pytest.approx(values[2, present] @ np.linalg.solve(covariance, values[2, present]), 1e-5)


@pytest.mark.parametrize("line", [50.0, 60.0])
@pytest.mark.parametrize("size", [0.5, 3.0])
def test_mains_lines_are_found_in_noise(line: float, size: float) -> None:
    time = DT * np.arange(12000)
    white = np.random.default_rng(4).standard_normal(time.size)
    hum = size * np.sqrt(2.0) * np.sin(2.0 * np.pi * line * time + 0.3)
    assert mains_lines(white + hum, DT) == (line,)
    assert mains_lines(white, DT) == ()
    # Where blocks are left out, the line keeps its phase on the record's time; put end to end it would lose it.
    out = (np.arange(white.size) // 360) % 2 == 0
    assert mains_lines(np.where(out, 0.0, white + hum), DT) == (line,)


def test_outliers_stand_alone_and_errors_of_a_model_do_not() -> None:
    draw = np.random.default_rng(5)
    values = draw.standard_normal((SEGMENTS, SAMPLES))
    spoiled = draw.random(values.shape) < 1e-3
    spoiled[:, :2] = spoiled[:, -2:] = False
    found = noise_model.outliers(values + 50.0 * spoiled, ChannelNoise.white(1.0))
    assert found[spoiled].mean() > 0.95 and not found[~spoiled].any()
    error = 50.0 * np.exp(-0.5 * ((np.arange(SAMPLES) - 250.0) / 8.0) ** 2)
    assert not noise_model.outliers(values + error, ChannelNoise.white(1.0)).any()


def test_spikes_upon_an_error_of_a_model_are_found_in_the_readings() -> None:
    draw, time = np.random.default_rng(8), np.arange(SAMPLES)
    motion = 400.0 * np.sin(0.02 * time)
    error = 60.0 * np.sin(0.03 * time) + draw.standard_normal((SEGMENTS, SAMPLES))
    spoiled = draw.random(error.shape) < 2e-3
    spoiled[:, :2] = spoiled[:, -2:] = False
    left, white = error + 100.0 * spoiled, ChannelNoise.white(1.0)
    assert noise_model.outliers(left, white)[spoiled].mean() < 0.5
    assert noise_model.jumps(left, white, motion + left)[spoiled].mean() > 0.95
    assert not noise_model.jumps(left, white, motion + error).any(), "the readings say nothing of it"
    assert not noise_model.jumps(error, white, motion + error).any()


def test_spikes_are_found_and_peaks_of_pressure_are_not() -> None:
    draw, time = np.random.default_rng(6), DT * np.arange(8000)
    pressure = 5e6 + 2e6 * np.tanh((np.mod(time, 1.0) - 0.5) / 4e-3) + 8e3 * draw.standard_normal(time.size)
    for begin in range(600, 8000, 1000):  # three samples wide at half their height: a step closes the valve
        pressure += 3e6 * np.exp(-0.5 * ((np.arange(time.size) - begin) / 1.5) ** 2)
    assert not spikes(pressure).any()
    places = np.array([123, 1701, 4444, 7100])
    spoiled = pressure.copy()
    spoiled[places] += 50.0 * 8e3
    assert np.array_equal(np.flatnonzero(spikes(spoiled)), places)


def test_a_record_without_a_quiet_segment_says_nothing_of_the_noise() -> None:
    """All of it may be far off the others."""
    quiet = np.random.default_rng(6).standard_normal((30, 200))
    parts = [quiet, np.zeros((0, 200))]
    noise = estimate(parts, DT)
    assert noise.innovation == estimate([quiet], DT).innovation
    found = noise_model.loudness(parts, noise)
    assert np.array_equal(found[0], np.ones(30)) and found[1].shape == (0,)


def test_noise_that_is_louder_in_some_segments_has_its_strength_there() -> None:
    strength = np.repeat([1.0, 1.6], 30)
    loud = [strength[:, None] * np.random.default_rng(3).standard_normal((60, 500))]
    noise = estimate(loud, DT)
    (found,) = noise_model.loudness(loud, noise)
    level = found * noise.std
    assert np.abs(level / strength - 1.0).max() < 0.15 and abs(np.mean(level / strength) - 1.0) < 0.03
    steady = [np.random.default_rng(4).standard_normal((60, 500))]
    assert np.array_equal(noise_model.loudness(steady, estimate(steady, DT))[0], np.ones(60))
