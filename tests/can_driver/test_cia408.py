"""Control word, status word and state machine of the valve: every status word, every step, every refusal."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hydraulic_can_driver.cia408 import CONTROL_WORDS, State, StateMachine, describe, state_of

# Written out once more: R M H D.
TABLE = {
    0b1000: "INIT",
    0b1001: "DISABLED",
    0b1011: "HOLD",
    0b1111: "ACTIVE",
    0b0001: "FAULT_DISABLED",
    0b0011: "FAULT_HOLD",
    0b0111: "FAULT_REACTION",
    0b0000: "NOT_READY",
}
STATUS = {name: bits for bits, name in TABLE.items()}


def test_every_status_word() -> None:
    for word in range(0x10000):
        state = state_of(word)
        assert state.name == TABLE.get(word & 0xF, "UNKNOWN")
        assert state.faulty == (state.name.startswith("FAULT"))
        assert state.name in describe(word)


def test_remarks_of_a_status_word() -> None:
    assert describe(0x860F) == "ACTIVE (0x860F), ramp running, limit, ramp frozen"
    assert describe(0x0819) == "DISABLED (0x0819), local, control deviation"


def test_control_words() -> None:
    assert [CONTROL_WORDS[state] for state in (State.INIT, State.DISABLED, State.HOLD, State.ACTIVE)] == [0, 1, 3, 7]


def obedient(machine: StateMachine, steps: int, now: float = 0.0) -> list[int]:
    """Control words of so many cycles with a valve that follows within one."""
    words = []
    for _ in range(steps):
        words.append(machine.control)
        word = machine.control & 7
        machine.advance({0: 0x8, 1: 0x9, 3: 0xB, 7: 0xF}[word], now)
    return words


def test_up_one_step_at_a_time_and_down_at_once() -> None:
    machine = StateMachine(0.5)
    machine.ask(State.ACTIVE, 0.0)
    assert obedient(machine, 5) == [0, 1, 3, 7, 7]
    assert machine.active
    machine.ask(State.DISABLED, 1.0)
    assert machine.control == 1 and not machine.arrived and not machine.active
    assert obedient(machine, 2, 1.0) == [1, 1]
    assert machine.arrived and not machine.problem


@pytest.mark.parametrize("stuck", [State.INIT, State.DISABLED, State.HOLD])
def test_a_step_that_is_not_taken_is_a_problem(stuck: State) -> None:
    machine = StateMachine(0.5)
    machine.ask(State.ACTIVE, 0.0)
    reached = list(CONTROL_WORDS).index(stuck)
    for now in (0.0, 0.1, 0.2, 0.3):
        step = min(list(CONTROL_WORDS.values()).index(machine.control), reached)
        machine.advance(list(CONTROL_WORDS)[step].value, now)
    waiting_for = list(CONTROL_WORDS)[reached + 1]
    assert machine.control == CONTROL_WORDS[waiting_for] and not machine.problem
    machine.advance(stuck.value, 1.0)
    assert f"expected {waiting_for.name}" in machine.problem and stuck.name in machine.problem
    assert machine.control == 1 and not machine.active


@pytest.mark.parametrize("name", ["FAULT_DISABLED", "FAULT_HOLD", "FAULT_REACTION", "HOLD", "DISABLED", "INIT"])
def test_a_valve_that_leaves_active(name: str) -> None:
    machine = StateMachine(0.5)
    machine.ask(State.ACTIVE, 0.0)
    obedient(machine, 5)
    machine.advance(STATUS[name], 0.01)
    assert name in machine.problem and machine.control == 1 and not machine.active
    first = machine.problem
    machine.advance(STATUS["ACTIVE"], 0.02)
    machine.ask(State.ACTIVE, 0.02)
    assert machine.problem == first and not machine.active and machine.control == 1, "latched"


def test_local_control_is_a_problem() -> None:
    machine = StateMachine(0.5)
    machine.ask(State.ACTIVE, 0.0)
    obedient(machine, 5)
    machine.advance(0x1F, 0.01)
    assert "local" in machine.problem


def test_reset_gives_a_rising_edge_and_ends_in_disabled() -> None:
    machine = StateMachine(0.5)
    machine.ask(State.ACTIVE, 0.0)
    obedient(machine, 5)
    machine.advance(STATUS["FAULT_HOLD"], 0.1)
    machine.reset(0.2)
    words = []
    for status in ("FAULT_HOLD", "FAULT_HOLD", "FAULT_HOLD", "HOLD", "DISABLED"):
        words.append(machine.control)
        assert not machine.arrived
        machine.advance(STATUS[status], 0.25)
    assert words == [0x1, 0x9, 0x9, 0x9, 0x9]
    assert machine.arrived and machine.control == 1 and machine.goal is State.DISABLED


def test_a_fault_that_cannot_be_reset() -> None:
    machine = StateMachine(0.5)
    machine.reset(0.0)
    for now in (0.0, 0.2, 0.4, 0.6):
        machine.advance(STATUS["FAULT_DISABLED"], now)
    assert "fault reset" in machine.problem and not machine.arrived


@pytest.mark.parametrize("goal", [State.FAULT_HOLD, State.UNKNOWN])
def test_goals_that_are_none(goal: State) -> None:
    with pytest.raises(ValueError, match="allowed"):
        StateMachine(0.5).ask(goal, 0.0)


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.sampled_from(["", "up", "down", "reset"])), max_size=60))
def test_whatever_the_valve_says_active_is_only_what_was_asked_and_seen(story: list[tuple[int, str]]) -> None:
    machine, now = StateMachine(0.05), 0.0
    for word, order in story:
        now += 0.01
        if order == "reset":
            machine.reset(now)
        elif order:
            machine.ask(State.ACTIVE if order == "up" else State.DISABLED, now)
        sent = machine.control
        machine.advance(word, now)
        assert machine.control in (0, 1, 3, 7, 9)
        if machine.active:
            assert sent == 7 and word & 0xF == 0xF and not word & 0x10 and not machine.problem
        if machine.problem:
            assert machine.control == 1
