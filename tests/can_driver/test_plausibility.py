"""What a position may do: examples at the limits of the shipped bus file."""

from __future__ import annotations

import math
from collections.abc import Callable

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


def test_a_simulated_plant_moves_a_whole_period_between_syncs_whenever_they_are_sent() -> None:
    """At 0.85 m/s, a SYNC 0.5 ms late: 1.7 mm in 1.5 ms. A real piston cannot do that."""
    for tick, refused in ((0.0, True), (0.002, False)):
        check = PositionCheck(LIMITS, tick)
        assert check.problem(0, 0.0) == ""
        assert check.problem(round(2.5 * MS), 0.0017) == ""
        assert ("jumps" in check.problem(4 * MS, 0.0034)) is refused
        assert "jumps by 0.0021 m in 0.002 s" in check.problem(6 * MS, 0.0055)


def travelled(opening: float, supply: float, position: Callable[[float], float], seconds: float = 10.0) -> str:
    """The first problem of a piston that goes as `position` [m] of the time [s] says, 500 times a second."""
    check = PositionCheck(LIMITS)
    times = (0.002 * i for i in range(round(500 * seconds)))
    found = (check.problem(round(1e9 * t), position(t), opening, supply) for t in times)
    return next(filter(None, found), "")


def flickering(t: float) -> float:
    return 0.1 + 1e-6 * (round(t / 0.002) % 2)


def test_frozen_only_where_it_should_move() -> None:
    assert "it moved 0.001 mm where the opening of the spool promises 20" in travelled(0.5, 14e6, flickering)
    assert "frozen" in travelled(-0.5, math.nan, flickering), "no transducer on the supply"
    assert travelled(0.05, 14e6, flickering) == "", "nearly closed"
    assert travelled(0.5, 0.1e6, flickering) == "", "hydraulics off"
    assert travelled(math.nan, 14e6, flickering) == "", "no spool is measured"


def test_frozen_is_noticed_before_the_piston_is_far() -> None:
    """At full opening after 20 mm, at any opening: in time for braking before the ends."""
    assert "frozen" in travelled(1.0, 14e6, flickering, seconds=0.05)
    assert "frozen" in travelled(0.11, 14e6, flickering, seconds=0.4)


def test_a_piston_at_its_stop_may_stand_but_not_leave_it_unseen() -> None:
    assert travelled(1.0, 14e6, lambda t: 0.762) == ""
    assert "frozen" in travelled(-1.0, 14e6, lambda t: 0.762), "it should leave"


def test_a_slow_piston_is_none_that_is_frozen() -> None:
    """A fifth of the speed that the opening promises: load, low pressure, an overlapped valve."""
    assert travelled(0.5, 14e6, lambda t: 0.05 * t) == ""
    assert travelled(-0.5, 2e6, lambda t: -0.05 * t) == ""


def test_an_opening_that_swings_is_compared_by_its_range() -> None:
    check = PositionCheck(LIMITS)
    for i in range(1000):
        t = 0.002 * i
        moved = 0.25 / (2.0 * math.pi) * (1.0 - math.cos(2.0 * math.pi * t))
        assert check.problem(round(1e9 * t), moved, 0.5 * math.sin(2.0 * math.pi * t), 14e6) == ""
    stuck = PositionCheck(LIMITS)
    found = (stuck.problem(2 * i * MS, 0.1, 0.5 * math.sin(4e-3 * math.pi * i), 14e6) for i in range(1000))
    assert any("frozen" in problem for problem in found)
