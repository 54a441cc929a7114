"""Residual tests let what is white and independent pass, and nothing else, also where signals are coloured."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_sysid.linear.validation import residual_tests


def white(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def test_about_one_in_a_hundred_lags_of_white_residuals_lies_outside() -> None:
    tests = [residual_tests(white(2000, s), white(2000, s + 500)) for s in range(60)]
    for key in ("autocorrelation", "cross_correlation"):
        assert np.mean([t["outside"][key] for t in tests]) == pytest.approx(0.01, abs=0.006)
    assert tests[0]["bound"] == pytest.approx(2.5758 / np.sqrt(2000.0), rel=1e-4)
    assert np.mean([t["cross_bound"] for t in tests]) == pytest.approx(tests[0]["bound"], rel=0.1)


def test_slow_signals_that_have_nothing_to_do_with_each_other_pass() -> None:
    """Between a slow input and a coloured residual the plain ±2.58/√N would cry wolf most of the time."""
    slow = [lfilter([1.0], [1.0, -0.95], white(4000, s)) for s in range(80)]
    tests = [residual_tests(a, b) for a, b in zip(slow[::2], slow[1::2], strict=True)]
    assert np.mean([t["outside"]["cross_correlation"] for t in tests]) < 0.05
    naive = [np.mean(np.abs(t["cross_correlation"]) > t["bound"]) for t in tests]
    assert np.mean(naive) > 0.3
    assert all(t["outside"]["autocorrelation"] > 0.5 for t in tests)


def test_dynamics_left_over_are_seen_at_their_lag() -> None:
    u = white(2000, 1)
    tests = residual_tests(white(2000, 2) + 0.3 * np.roll(u, 4), u)
    worst = int(np.argmax(np.abs(tests["cross_correlation"]))) - tests["lags"]
    assert worst == 4
    assert np.abs(tests["cross_correlation"]).max() > tests["cross_bound"]


def test_nothing_is_said_where_nothing_can_be() -> None:
    assert residual_tests(white(50, 1), white(50, 2)) is None
    assert residual_tests(np.zeros(500), white(500, 2)) is None
    assert residual_tests(white(500, 1), np.ones(500)) is None
