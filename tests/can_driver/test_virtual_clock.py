"""How the virtual plant counts its periods by SYNCs that come late, are missing, or do not come at all."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_can_driver.virtual.plant import SlotClock, SyncClock

PERIOD = 0.002


def periods(times: list[float]) -> list[int]:
    clock = SlotClock(PERIOD, 0.0)
    return [clock.sync(time) for time in times]


def test_a_late_sync_is_one_period_and_so_is_the_next() -> None:
    assert periods([0.002, 0.0039 + 0.0015, 0.006, 0.008]) == [1, 1, 1, 1]


def test_a_missing_sync_is_a_period_that_passed() -> None:
    assert periods([0.002, 0.006, 0.008, 0.018, 0.020]) == [1, 2, 1, 5, 1]


@pytest.mark.parametrize("drift", [-1e-4, 0.0, 1e-4])
def test_jitter_and_clocks_that_drift_do_not_change_the_count(drift: float) -> None:
    generator = np.random.default_rng(0)
    at = PERIOD * (1.0 + drift) * np.arange(1, 60_001)
    heard = at + generator.exponential(0.1 * PERIOD, at.size).clip(max=0.8 * PERIOD)
    assert set(periods(list(np.sort(heard)))) == {1}


def test_without_sync_time_passes_by_itself() -> None:
    clock = SlotClock(PERIOD, 0.0)
    assert clock.overdue(0.015, 0.02) == 0
    assert clock.overdue(0.0205, 0.02) == 10
    assert clock.overdue(0.0305, 0.02) == 0
    assert clock.overdue(0.0405, 0.02) == 10
    assert clock.sync(0.0421) == 1


def test_in_lockstep_only_syncs_count() -> None:
    clock = SyncClock(PERIOD)
    assert [clock.sync(time) for time in (0.002, 5.0, 5.0001)] == [1, 1, 1]
    assert clock.overdue(100.0, 0.02) == 0
    assert clock.now() == pytest.approx(3 * PERIOD)
