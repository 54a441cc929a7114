"""Limits of the drive by where the piston is: no stream gets more than what is commanded, allowed and slewed to."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_interfaces.samples import Command
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.travel_limits import EndsOfTravel, TravelLimits

ENDS = EndsOfTravel(-0.762, 0.762, impact_speed=0.05, full_speed=0.5)
PERIOD = 1e-3
MS = 1_000_000


def limits_at(position: float) -> TravelLimits:
    limits = TravelLimits(ENDS, PERIOD)
    limits.observe(position)
    return limits


def test_nothing_is_limited_in_mid_stroke_but_the_slew() -> None:
    limits = limits_at(0.0)
    assert [limits.limited(10.0) for _ in range(7)] == [2.0, 4.0, 6.0, 8.0, 10.0, 10.0, 10.0]
    assert limits.limited(0.0) == 0.0, "0 V at once"
    assert limits.limited(-10.0) == -2.0
    assert limits.limited(1.5) == 1.5
    assert limits.braked == 0 and limits.slewed == 5


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_towards_an_end_the_piston_can_still_be_stopped(side: float) -> None:
    """At the speed of the allowed drive: the reaction passes, then it decelerates, and what is left is a creep."""
    creep = limits_at(side * 0.762).allowed() * ENDS.full_speed / DRIVE_LIMIT_V
    assert 0.0 < creep < ENDS.impact_speed
    for distance in (0.004, 0.01, 0.05, 0.08):
        speed = limits_at(side * (0.762 - distance)).allowed() * ENDS.full_speed / DRIVE_LIMIT_V
        assert speed * ENDS.reaction + speed**2 / (2.0 * ENDS.deceleration) == pytest.approx(distance)
    assert limits_at(side * 0.66).allowed() > DRIVE_LIMIT_V, "full speed 0.1 m before"
    assert limits_at(side * 5.0).allowed() == limits_at(side * 0.762).allowed(), "beyond the end"


def test_before_an_end_a_drive_grows_slowly_whichever_way_it_goes() -> None:
    limits = limits_at(0.7)
    allowed = limits.allowed()
    assert allowed < DRIVE_LIMIT_V
    for drive in (10.0, -10.0):
        grown = []
        for _ in range(65):
            limits.observe(0.7)
            grown.append(abs(limits.limited(drive)))
        assert grown[0] == pytest.approx(allowed * PERIOD / 0.06)
        assert grown[9] == pytest.approx(10.0 * grown[0]), "by a straight line"
        assert grown[-1] == allowed
        assert limits.limited(0.0) == 0.0, "0 V at once"


def test_without_a_position_the_piston_may_be_anywhere() -> None:
    limits = TravelLimits(ENDS, PERIOD)
    creep = limits.allowed()
    assert [limits.limited(10.0) for _ in range(100)][-1] == creep < 1.0
    limits.observe(0.0)
    drives = [limits.limited(10.0) for _ in range(2000)]
    assert max(drives) == 10.0 and drives[-1] == creep
    travelled = sum(drives) * ENDS.full_speed / DRIVE_LIMIT_V * PERIOD
    assert travelled < 0.762, "it cannot have reached the end at more"
    limits.observe(math.nan)
    assert limits.allowed() == creep
    limits.observe(0.1)
    assert limits.allowed() > DRIVE_LIMIT_V
    limits.forget()
    assert limits.allowed() == creep


@pytest.mark.parametrize(
    "wrong", [{"low": 1.0}, {"high": math.nan}, {"impact_speed": 0.0}, {"full_speed": math.inf}, {"slew": -1.0}]
)
def test_ends_that_are_none(wrong: dict[str, float]) -> None:
    good = {"low": -0.5, "high": 0.5, "impact_speed": 0.05, "full_speed": 0.5}
    with pytest.raises(ValueError, match=r"must be"):
        EndsOfTravel(**(good | wrong))


drives = st.floats(-DRIVE_LIMIT_V, DRIVE_LIMIT_V)
positions = st.one_of(st.none(), st.floats(-0.8, 0.8), st.floats(allow_nan=True, allow_infinity=True))


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(drives, positions), max_size=80))
def test_the_limits_never_add(stream: list[tuple[float, float | None]]) -> None:
    limits, before = TravelLimits(ENDS, PERIOD), 0.0
    for drive, position in stream:
        if position is not None:
            limits.observe(position)
        allowed = limits.allowed()
        applied = limits.limited(drive)
        assert min(drive, 0.0) <= applied <= max(drive, 0.0), "between 0 V and what was commanded"
        assert abs(applied) <= allowed
        assert abs(applied) <= ENDS.slew * PERIOD + (abs(before) if before * applied > 0.0 else 0.0) + 1e-12
        before = applied


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 60), drives, st.sampled_from("ab")), max_size=60))
def test_a_gate_without_limits_applies_what_it_holds(stream: list[tuple[int, float, str]]) -> None:
    """And one with limits in mid stroke, too, wherever its slew lets it: what identification runs on stays as it is."""
    free, limited = CommandGate(), CommandGate()
    limited.limits = TravelLimits(EndsOfTravel(-0.762, 0.762, 0.05, 0.5, slew=1e6), PERIOD)
    now = 0
    for gate in (free, limited):
        gate.enable(True)
        gate.drive(now)
    for wait, drive, source in stream:
        now += wait * MS
        limited.observe(0.3)
        for gate in (free, limited):
            gate.accept(Command(now, source, drive), now)
        assert free.drive(now) == limited.drive(now)


def test_a_stop_is_0_V_at_once_and_a_new_run_knows_nothing() -> None:
    gate = CommandGate()
    gate.limits = TravelLimits(ENDS, PERIOD)
    gate.forget()
    gate.enable(True)
    applied = []
    for i in range(10):
        gate.observe(0.0)
        gate.accept(Command(i * MS, "a", 10.0), i * MS)
        applied.append(gate.drive(i * MS))
    assert applied[-1] == 10.0
    gate.stop("emergency stop")
    assert gate.drive(10 * MS) == 0.0
    gate.reset()
    gate.forget()
    gate.enable(True)
    gate.accept(Command(11 * MS, "a", 10.0), 11 * MS)
    assert 0.0 < gate.drive(11 * MS) < 1.0, "where the piston is must be seen first"
