"""What a position may do: examples at the limits of the shipped bus file."""

from __future__ import annotations

import math

import pytest

from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.plausibility import PositionCheck

LIMITS = load_bus("bench").limits
MS = 1_000_000


def test_first_position_may_be_anywhere_in_the_stroke() -> None:
    assert PositionCheck(LIMITS).problem(0, 0.7) == ""
    assert PositionCheck(LIMITS).problem(0, -0.766) == ""


@pytest.mark.parametrize("position", [0.768, -0.768, 5.0, math.nan, math.inf])
def test_out_of_stroke(position: float) -> None:
    assert "out of the stroke: -0.767 ... 0.767 m" in PositionCheck(LIMITS).problem(0, position)


def test_jump_is_measured_over_the_time_that_passed() -> None:
    check = PositionCheck(LIMITS)
    assert check.problem(0, 0.0) == ""
    assert check.problem(2 * MS, 0.0019) == "", "1.9 mm in 2 ms are 0.95 m/s"
    assert "jumps by 0.0021 m in 0.002 s" in check.problem(4 * MS, 0.0040)
    assert check.problem(24 * MS, 0.020) == "", "16 mm over ten lost samples"


def frozen(opening: float, supply: float, at_end: bool = False) -> str:
    check = PositionCheck(LIMITS)
    return next(filter(None, (check.problem(t * MS, 0.1, opening, supply, at_end) for t in range(0, 700, 2))), "")


def test_frozen_only_where_it_should_move() -> None:
    assert "frozen at 0.1 m for 0.50 s while the spool is 50% open" in frozen(0.5, 14e6)
    assert "frozen" in frozen(-0.5, math.nan), "no transducer on the supply"
    assert frozen(0.05, 14e6) == "", "nearly closed"
    assert frozen(0.5, 0.1e6) == "", "hydraulics off"
    assert frozen(0.5, 14e6, at_end=True) == "", "at a limit switch"
    assert frozen(math.nan, 14e6) == "", "no spool is measured"


def test_one_count_of_movement_is_enough() -> None:
    check = PositionCheck(LIMITS)
    for t in range(0, 2000, 2):
        assert check.problem(t * MS, 0.1 + 1e-6 * (t // 400 % 2), 0.5, 14e6) == ""
