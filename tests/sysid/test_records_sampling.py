"""Even stamps give their period, also when they jitter or were rounded; uneven ones are named."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_sysid.data.records.sampling import IrregularTimeError, gaps, sampling


@pytest.mark.parametrize("dt", [0.001, 0.02, 1 / 4096, 1 / 3000, 1.0, 0.0025, 1e-6])
def test_exact_stamps_give_the_exact_period(dt: float) -> None:
    found = sampling(5.0 + dt * np.arange(20_000)).dt
    assert found == pytest.approx(dt, rel=1e-9)
    assert sampling(dt * np.arange(20_000)).deviation_max < 1e-6 * dt


def test_jitter_of_the_clock_does_not_show_in_the_period() -> None:
    rng = np.random.default_rng(1)
    time = 1e-3 * np.arange(20_000) + rng.uniform(-1e-4, 1e-4, 20_000)
    found = sampling(time)
    assert found.dt == 0.001
    assert 0.9e-4 < found.deviation_p99 < found.deviation_max < 1.1e-4


def test_a_clock_that_runs_differently_is_believed() -> None:
    assert sampling(1.00002e-3 * np.arange(20_000)).dt == pytest.approx(1.00002e-3, rel=1e-12)


def test_stamps_with_too_few_decimals_still_give_the_period() -> None:
    time = np.round(np.arange(20_000) / 4096, 4)
    assert sampling(time).dt == pytest.approx(1 / 4096, rel=1e-5)


def test_two_stamps_are_enough() -> None:
    assert sampling(np.array([3.0, 3.25])).dt == 0.25


@pytest.mark.parametrize(
    ("change", "index", "problem"),
    [
        (lambda t: np.delete(t, 100), 100, "1 sample missing: 0.002 s since the one before"),
        (lambda t: np.delete(t, slice(100, 150)), 100, "50 samples missing"),
        (lambda t: np.insert(t, 100, t[100]), 101, "the time 0.1 s is there twice"),
        (lambda t: np.r_[t[:100], t[101], t[100], t[102:]], 101, "the time goes back from 0.101 s to 0.1 s"),
        (lambda t: np.r_[t[:100], np.nan, t[101:]], 100, "the time is nan"),
        (lambda t: np.insert(t, 100, t[99] + 1e-5), 100, "only 1e-05 s since the sample before"),
    ],
)
def test_the_first_bad_stamp_is_named(change, index: int, problem: str) -> None:  # noqa: ANN001
    with pytest.raises(IrregularTimeError) as caught:
        sampling(change(1e-3 * np.arange(1000)))
    assert caught.value.index == index
    assert problem in caught.value.problem


def test_uneven_stamps_without_a_gap_are_refused() -> None:
    rng = np.random.default_rng(2)
    time = 1e-3 * np.arange(1000) + rng.uniform(-4e-4, 4e-4, 1000)
    with pytest.raises(IrregularTimeError):
        sampling(time)


def test_gaps_are_found() -> None:
    time = 1e-3 * np.delete(np.arange(1000), [100, 101, 500])
    assert gaps(time) == [100, 498]


@settings(deadline=None, max_examples=100)
@given(
    st.floats(1e-5, 10.0),
    st.integers(20, 2000),
    st.floats(0.0, 0.15),
    st.integers(0, 2**32 - 1),
)
def test_whatever_the_period_it_explains_the_stamps(dt: float, count: int, jitter: float, seed: int) -> None:
    noise = np.random.default_rng(seed).uniform(-jitter * dt, jitter * dt, count)
    time = dt * np.arange(count) + noise
    found = sampling(time)
    # Over the whole record it goes wrong by less than the stamps themselves do.
    assert abs(found.dt - dt) * (count - 1) <= 4.0 * jitter * dt + 1e-5 * dt


@settings(deadline=None, max_examples=100)
@given(st.integers(50, 500), st.data())
def test_a_lost_sample_is_never_overlooked(count: int, data: st.DataObject) -> None:
    lost = data.draw(st.integers(1, count - 2))
    noise = np.random.default_rng(lost).uniform(-1e-4, 1e-4, count)
    with pytest.raises(IrregularTimeError) as caught:
        sampling(np.delete(1e-3 * np.arange(count) + noise, lost))
    assert caught.value.index == lost
