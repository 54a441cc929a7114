from __future__ import annotations

import math

import pytest

from hydraulic_plant_node.rate_monitor import RateMonitor

PERIOD = 1_000_000


def test_perfect_ticks() -> None:
    monitor = RateMonitor(PERIOD)
    for k in range(5000):
        monitor.tick(k * PERIOD, k * PERIOD)
    report = monitor.report()
    assert report.rate == pytest.approx(1000.0)
    assert report.jitter_max == report.run_jitter_max == report.lateness_max == 0.0
    assert (report.ticks, report.overruns, report.skipped) == (5000, 0, 0)


def test_jitter_of_alternating_periods() -> None:
    monitor = RateMonitor(PERIOD, window=100)
    for k in range(1000):
        monitor.tick(k * PERIOD, k * PERIOD + (k % 2) * 200_000)
    report = monitor.report()
    assert report.jitter_p50 == pytest.approx(0.2e-3)
    assert report.run_jitter_p99 == pytest.approx(0.2e-3, abs=2e-6)
    assert report.lateness_max == pytest.approx(0.2e-3)


def test_the_window_forgets_and_the_run_does_not() -> None:
    monitor = RateMonitor(PERIOD, window=10)
    now = 0
    for k in range(50):
        now += PERIOD if k != 5 else 6 * PERIOD
        monitor.tick(now - (5 * PERIOD if k == 5 else 0), now, skipped=2 if k == 5 else 0)
    report = monitor.report()
    assert report.jitter_max == 0.0
    assert report.run_jitter_max == pytest.approx(5e-3)
    assert (report.overruns, report.skipped) == (1, 2)


def test_quantile_of_the_run_is_that_of_its_ticks() -> None:
    monitor = RateMonitor(PERIOD)
    now = 0
    for k in range(1001):
        now += PERIOD + (300_000 if k % 50 == 0 else 10_000)
        monitor.tick(now, now)
    report = monitor.report()
    assert report.run_jitter_p50 == pytest.approx(10e-6, abs=2e-6)
    assert report.run_jitter_p99 == pytest.approx(300e-6, abs=2e-6)


def test_too_few_ticks_and_wrong_arguments() -> None:
    assert math.isnan(RateMonitor(PERIOD).report().rate)
    with pytest.raises(ValueError, match="period"):
        RateMonitor(0)
