"""A controller in lockstep waits for the reference of each instant, and for nobody else."""

from __future__ import annotations

import pytest

from hydraulic_control.lockstep import PATIENCE_S, ReferenceLockstep

PERIOD_NS = 1_000_000


@pytest.fixture
def answering() -> ReferenceLockstep:
    """Two states in a row have had their references."""
    lockstep = ReferenceLockstep()
    for stamp in (PERIOD_NS, 2 * PERIOD_NS):
        lockstep.state(stamp, 0.0)
        lockstep.reference(stamp)
    return lockstep


def test_waits_for_a_source_that_answers_until_it_has(answering: ReferenceLockstep) -> None:
    answering.state(3 * PERIOD_NS, 1.0)
    assert answering.waits(1, 1.0) and answering.waits(1, 1.0 + PATIENCE_S / 2)
    answering.reference(3 * PERIOD_NS)
    assert not answering.waits(1, 1.0)


def test_a_source_that_is_late_is_waited_for_too(answering: ReferenceLockstep) -> None:
    for stamp in (3, 4, 5):
        answering.state(stamp * PERIOD_NS, 1.0)
    answering.reference(3 * PERIOD_NS)
    assert answering.waits(1, 1.0)
    answering.reference(4 * PERIOD_NS)
    assert answering.waits(1, 1.0)
    answering.reference(5 * PERIOD_NS)
    assert not answering.waits(1, 1.0)


def test_nobody_is_waited_for_who_does_not_answer_states() -> None:
    lockstep = ReferenceLockstep()
    for n in range(1, 30):
        lockstep.state(n * PERIOD_NS, 0.0)
        if n % 10 == 0:  # a source with a rate of its own
            lockstep.reference(n * PERIOD_NS - 123)
        assert not lockstep.waits(1, 0.0)


def test_a_source_that_leaves_is_not_waited_for(answering: ReferenceLockstep) -> None:
    answering.state(3 * PERIOD_NS, 1.0)
    assert not answering.waits(0, 1.0)
    assert not answering.waits(1, 1.0), "another one must answer first"
    assert answering.given_up == 0


def test_a_source_that_falls_silent_is_given_up_once_and_counted(answering: ReferenceLockstep) -> None:
    answering.state(3 * PERIOD_NS, 1.0)
    assert not answering.waits(1, 1.1 + PATIENCE_S)
    answering.state(4 * PERIOD_NS, 1.1 + PATIENCE_S)
    assert not answering.waits(1, 1.1 + PATIENCE_S)
    assert answering.given_up == 1
