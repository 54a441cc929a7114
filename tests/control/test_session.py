"""The controller's session: what it answers, what it refuses, and that no stream of samples gets a wild command."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_control.controller import Controller
from hydraulic_control.parameters import CONTROLLERS
from hydraulic_control.session import ControlSession, Refusal
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


def test_it_holds_the_position_that_it_finds() -> None:
    loop = session()
    answers = feed(loop, 100, 0.123)
    assert all(a == pytest.approx(0.0, abs=1e-12) for a in answers)
    assert feed(loop, 500, 0.113, 100)[-1] == pytest.approx(1.0, rel=0.02)


def test_it_follows_a_reference_and_goes_on_when_it_falls_silent() -> None:
    loop = session(velocity_feedforward=10.0)
    feed(loop, 10)
    assert loop.follow(Reference(START + 9 * MS, 0.02, 0.05))
    assert feed(loop, 90, first=10)[-1] == pytest.approx(2.0 + 0.5, rel=0.05)
    assert feed(loop, 500, first=100)[-1] == pytest.approx(2.0, rel=0.01), "its velocity is stale"


@pytest.mark.parametrize(
    ("reference", "refusal"),
    [
        (Reference(START, math.nan), Refusal.BAD_REFERENCE),
        (Reference(START, 5.0), Refusal.BAD_REFERENCE),
        (Reference(START, 0.1, math.inf), Refusal.BAD_REFERENCE),
        (Reference(START - MS, 0.1, 0.0), Refusal.LATE_REFERENCE),
    ],
)
def test_bad_references_are_not_followed(reference: Reference, refusal: Refusal) -> None:
    loop = session()
    assert loop.follow(Reference(START, 0.02, 0.0))
    assert not loop.follow(reference)
    assert loop.refusals[refusal] == 1
    assert loop.reference is not None and loop.reference.position == 0.02


def test_a_stale_state_gives_0_V_and_says_so() -> None:
    loop = session()
    feed(loop, 10)
    loop.follow(Reference(START, 0.02))
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
    loop.follow(Reference(START + 11 * MS, 0.11))
    assert feed(loop, 1000, 0.1, 11)[-1] == pytest.approx(1.0, rel=0.01)


def test_nothing_winds_up_while_the_plant_does_not_obey() -> None:
    loop = session(ki=1000.0, integral_zone=0.0)
    feed(loop, 10)
    loop.follow(Reference(START, 0.05))
    answers = feed(loop, 5000, first=10, drive=0.0)
    assert max(abs(a) for a in answers[50:] if a is not None) < 3.0, "5 V proportional and more integral do not pile up"
    assert loop.refusals[Refusal.NOT_OBEYED] > 0


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
            loop.follow(Reference(stamp, other, velocity))
        answer = loop.answer(PlantSample(stamp, position, velocity, force, other), stamp + age)
        assert answer is None or (math.isfinite(answer) and abs(answer) <= 10.0)
        assert math.isfinite(loop.controller.drive)
