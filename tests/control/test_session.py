"""The controller's session: what it answers, what it refuses, and that no stream of samples gets a wild command."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_control.controller import Controller
from hydraulic_control.parameters import CONTROLLERS
from hydraulic_control.reference_intake import PAUSE_S
from hydraulic_control.refusals import Refusal
from hydraulic_control.session import ControlSession
from hydraulic_interfaces.samples import PlantSample, Reference

MS = 1_000_000
START = 1_700_000_000_000_000_000


def session(**values: float | str) -> ControlSession:
    made = ControlSession(Controller({"controller": "pid", "kp": 100.0, **values}))
    made.begin()
    return made


def feed(
    loop: ControlSession,
    count: int,
    position: float = 0.0,
    first: int = 0,
    age: float = 3e-4,
    drive: float | None = None,
) -> list[float | None]:
    """Answers to ``count`` states 1 ms apart; the plant applies what was commanded unless told otherwise."""
    answers: list[float | None] = []
    for i in range(first, first + count):
        applied = loop.controller.drive if drive is None else drive
        sample = PlantSample(START + i * MS, position, 0.0, 0.0, applied)
        answers.append(loop.answer(sample, sample.stamp_ns + round(age * 1e9)))
    return answers


def follow(loop: ControlSession, at: int, position: float, velocity: float = 0.0) -> bool:
    """Whether a reference of the instant of state ``at`` is followed."""
    stamp = START + at * MS
    return loop.follow(Reference(stamp, position, velocity), stamp)


def largest(answers: list[float | None]) -> float:
    return max(abs(answer) for answer in answers if answer is not None)


def test_it_holds_the_position_that_it_finds() -> None:
    loop = session()
    answers = feed(loop, 100, 0.123)
    assert all(a == pytest.approx(0.0, abs=1e-12) for a in answers)
    assert feed(loop, 500, 0.113, 100)[-1] == pytest.approx(1.0, rel=0.02)


def test_it_follows_a_reference_and_goes_on_when_it_falls_silent() -> None:
    loop = session(velocity_feedforward=10.0)
    feed(loop, 10)
    assert follow(loop, 9, 0.02, 0.05)
    assert feed(loop, 90, first=10)[-1] == pytest.approx(2.0 + 0.5, rel=0.05)
    assert feed(loop, 500, first=100)[-1] == pytest.approx(2.0, rel=0.01), "its velocity is stale"


@pytest.mark.parametrize(
    ("reference", "refusal"),
    [
        (Reference(START, math.nan), Refusal.BAD_REFERENCE),
        (Reference(START, 5.0), Refusal.BAD_REFERENCE),
        (Reference(START, 0.1, math.inf), Refusal.BAD_REFERENCE),
        (Reference(START - MS, 0.1, 0.0), Refusal.LATE_REFERENCE),
        (Reference(0, 0.1, 0.0), Refusal.OLD_REFERENCE),
        (Reference(START - 5000 * MS, 0.1, 0.0), Refusal.OLD_REFERENCE),
        (Reference(START + 5000 * MS, 0.1, 0.0), Refusal.OLD_REFERENCE),
    ],
)
def test_bad_references_are_not_followed(reference: Reference, refusal: Refusal) -> None:
    loop = session()
    assert follow(loop, 0, 0.02)
    assert not loop.follow(reference, START)
    assert loop.refusals[refusal] == 1
    assert loop.reference is not None and loop.reference.position == 0.02


def test_a_state_from_the_future_gives_0_V_and_locks_nobody_out() -> None:
    loop = session()
    feed(loop, 10)
    assert follow(loop, 9, 0.02)
    assert feed(loop, 200, first=10)[-1] == pytest.approx(2.0, rel=0.02)
    assert feed(loop, 1, first=710, age=-0.5) == [0.0]
    assert loop.refusals[Refusal.FUTURE] == 1 and "0.500 s" in loop.trouble
    again = feed(loop, 600, first=210)
    assert None not in again, "the states of the plant itself are answered as before"
    assert again[-1] == pytest.approx(2.0, rel=0.05)
    assert loop.refusals[Refusal.OUT_OF_ORDER] == 0


def test_a_stale_state_gives_0_V_and_says_so() -> None:
    loop = session()
    feed(loop, 10)
    assert follow(loop, 9, 0.02)
    assert feed(loop, 200, first=10)[-1] == pytest.approx(2.0, rel=0.02)
    assert feed(loop, 1, first=210, age=0.05) == [0.0]
    assert loop.refusals[Refusal.STALE] == 1 and "0.050 s" in loop.trouble
    again = feed(loop, 600, first=211)
    assert again[0] == pytest.approx(0.0, abs=1e-6), "it joins on without a bump"
    assert again[-1] == pytest.approx(2.0, rel=0.05)


def test_silence_is_noticed_once() -> None:
    loop = session()
    feed(loop, 10)
    assert not loop.silence(0.01)
    assert loop.silence(0.03) and not loop.silence(0.04)
    assert loop.refusals[Refusal.SILENT] == 1


@pytest.mark.parametrize(
    ("sample", "answer", "refusal"),
    [
        (PlantSample(START + 10 * MS, math.nan), 0.0, Refusal.NOT_FINITE),
        (PlantSample(START + 10 * MS, math.inf), 0.0, Refusal.NOT_FINITE),
        (PlantSample(START + 10 * MS, 0.5, 0.0), 0.0, Refusal.IMPLAUSIBLE),
        (PlantSample(START + 9 * MS, 0.0), None, Refusal.OUT_OF_ORDER),
        (PlantSample(START + 5 * MS, 0.0), None, Refusal.OUT_OF_ORDER),
    ],
)
def test_what_cannot_be_believed(sample: PlantSample, answer: float | None, refusal: Refusal) -> None:
    loop = session()
    feed(loop, 10)
    assert loop.answer(sample, START + 10 * MS) == answer
    assert loop.refusals[refusal] == 1


def test_a_leap_that_the_next_state_confirms_is_believed() -> None:
    loop = session()
    feed(loop, 10)
    assert feed(loop, 1, 0.1, 10) == [0.0]
    assert follow(loop, 11, 0.11)
    assert feed(loop, 1000, 0.1, 11)[-1] == pytest.approx(1.0, rel=0.01)


def test_nothing_winds_up_where_the_plant_limits() -> None:
    loop = session(ki=1000.0, integral_zone=0.0)
    feed(loop, 10)
    follow(loop, 9, 0.05)
    answers = feed(loop, 5000, first=10, drive=0.4)
    assert largest(answers[50:]) < 3.0, "5 V proportional and more integral do not pile up"
    assert loop.refusals[Refusal.LIMITED] > 0 and not loop.refusals[Refusal.NOT_OBEYED]
    assert loop.reference is not None, "a limit is no disobedience"


@pytest.mark.parametrize("applied", [0.0, -3.0, 9.0], ids=["stopped", "against", "beyond"])
def test_who_is_not_obeyed_drops_the_reference_and_holds_the_position_found(applied: float) -> None:
    """An emergency stop in mid run, the piston pushed 30 mm on meanwhile, and enabled again: nothing moves."""
    loop = session(ki=50.0)
    feed(loop, 10)
    assert follow(loop, 9, 0.02)
    feed(loop, 100, first=10)
    feed(loop, 100, 0.01, 110, drive=applied)
    feed(loop, 100, 0.04, 210, drive=applied)
    assert loop.refusals[Refusal.NOT_OBEYED] and loop.reference is None
    feed(loop, 1000, 0.04, 310, drive=0.0)
    assert largest(feed(loop, 1000, 0.04, 1310)) < 1e-9


def test_a_source_that_went_on_while_the_plant_did_not_obey_is_heard_after_a_pause() -> None:
    loop = session()
    feed(loop, 10)
    for i in range(10, 400):
        follow(loop, i, 0.05)
        feed(loop, 1, first=i, drive=0.0 if i < 200 else None)
        assert i < 100 or loop.reference is None
    assert loop.refusals[Refusal.OUTLIVED_REFERENCE] > 300
    assert abs(loop.controller.drive) < 1e-9
    pause = round(PAUSE_S * 1e3) + 1
    feed(loop, pause, first=400)
    assert follow(loop, 400 + pause, 0.05)
    assert feed(loop, 300, first=400 + pause)[-1] == pytest.approx(5.0, rel=0.05)


def test_a_set_point_that_was_sent_once_is_held() -> None:
    loop = session()
    feed(loop, 10)
    assert follow(loop, 10, 0.05)
    feed(loop, 20_000, first=10)
    assert loop.controller.drive == pytest.approx(5.0, rel=0.01)


def test_a_plant_that_says_that_it_does_not_obey_is_believed() -> None:
    """Where the piston stands at its reference the drive is 0 V, enabled or not."""
    loop = session()
    feed(loop, 10)
    assert follow(loop, 10, 0.0)
    feed(loop, 50, first=10)
    loop.disobeyed("not enabled", START + 9 * MS)
    assert loop.reference is not None, "that was before"
    loop.disobeyed("not enabled", START + 60 * MS)
    assert loop.reference is None and "not enabled" in loop.trouble
    assert largest(feed(loop, 500, 0.03, 60)) < 1e-9


def test_after_a_plant_was_away_nothing_is_followed() -> None:
    loop = session()
    feed(loop, 10)
    assert follow(loop, 10, 0.05)
    feed(loop, 50, first=10)
    feed(loop, 1, 0.01, 1000, drive=0.0)
    assert largest(feed(loop, 500, 0.01, 1001)) < 1e-9


wild = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.floats(-0.5, 0.5))
steps = st.one_of(st.just(MS), st.integers(-5 * MS, 50 * MS), st.integers(-(2**40), 2**40), st.just(0))


@settings(max_examples=80, deadline=None)
@given(
    law=st.sampled_from(CONTROLLERS),
    events=st.lists(st.tuples(steps, wild, wild, wild, wild, st.booleans(), steps), max_size=60),
)
def test_no_stream_gets_a_command_that_is_not_finite_or_out_of_range(law, events) -> None:  # type: ignore[no-untyped-def]
    loop = session(controller=law, ki=50.0, kd=1.0, force_feedback=1e-3, velocity_feedforward=20.0)
    stamp = START
    for step, position, other, velocity, force, referenced, age in events:
        stamp = max(stamp + step, 0)
        if referenced:
            loop.follow(Reference(stamp, other, velocity), stamp + age)
        answer = loop.answer(PlantSample(stamp, position, velocity, force, other), stamp + age)
        assert answer is None or (math.isfinite(answer) and abs(answer) <= 10.0)
        assert math.isfinite(loop.controller.drive)
