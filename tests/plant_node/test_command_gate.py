from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_interfaces.samples import Command
from hydraulic_plant_node.command_gate import CommandGate, Verdict

MS = 1_000_000
WATCHDOG_MS = 50


def gate(enabled: bool = True) -> CommandGate:
    made = CommandGate()
    made.enable(enabled)
    return made


def command(now: int, drive: float = 1.0, source: str = "a", age: int = 0) -> Command:
    return Command(now - age, source, drive)


def test_holds_the_drive_for_the_watchdog_time_and_no_longer() -> None:
    one = gate()
    assert one.accept(command(0, 2.0), 0) is Verdict.ACCEPTED
    assert one.drive(WATCHDOG_MS * MS) == 2.0
    assert one.drive(WATCHDOG_MS * MS + 1) == 0.0
    assert one.timeouts == 1
    assert one.drive(1000 * MS) == 0.0
    assert one.timeouts == 1, "one silence is one timeout"
    assert one.accept(command(1001 * MS, 3.0), 1001 * MS) is Verdict.ACCEPTED
    assert one.drive(1001 * MS) == 3.0


def test_a_clock_set_back_does_not_keep_a_command_alive() -> None:
    one = gate()
    one.accept(command(10_000 * MS), 10_000 * MS)
    assert one.drive(9_999 * MS) == 0.0


@pytest.mark.parametrize(
    ("sent", "verdict"),
    [
        (Command(0, "a", math.nan), Verdict.NOT_FINITE),
        (Command(0, "a", -math.inf), Verdict.NOT_FINITE),
        (Command(0, "", 1.0), Verdict.UNNAMED),
        (Command(-WATCHDOG_MS * MS - 1, "a", 1.0), Verdict.STALE),
        (Command(WATCHDOG_MS * MS + 1, "a", 1.0), Verdict.FUTURE),
    ],
)
def test_rejects_and_counts(sent: Command, verdict: Verdict) -> None:
    one = gate()
    assert one.accept(sent, 0) is verdict
    assert one.drive(0) == 0.0
    assert one.counts[verdict] == 1
    assert verdict.value in one.last_problem


def test_a_rejected_command_does_not_feed_the_watchdog() -> None:
    one = gate()
    one.accept(command(0, 2.0), 0)
    one.accept(command(40 * MS, math.nan), 40 * MS)
    assert one.drive(40 * MS) == 2.0
    assert one.drive(60 * MS) == 0.0


def test_clamps_and_counts() -> None:
    one = gate()
    assert one.accept(command(0, -11.0), 0) is Verdict.CLAMPED
    assert one.drive(0) == -10.0
    assert one.accept(command(0, 10.0), 0) is Verdict.ACCEPTED


def test_one_source_until_it_has_been_silent() -> None:
    one = gate()
    one.accept(command(0, 1.0, "a"), 0)
    assert one.accept(command(50 * MS, 2.0, "b"), 50 * MS) is Verdict.OTHER_SOURCE
    assert one.drive(50 * MS) == 1.0
    assert one.accept(command(51 * MS, 2.0, "b"), 51 * MS) is Verdict.ACCEPTED
    assert one.source == "b"
    assert one.accept(command(52 * MS, 1.0, "a"), 52 * MS) is Verdict.OTHER_SOURCE


def test_disabled_is_zero_and_keeps_no_command_for_later() -> None:
    one = gate(enabled=False)
    assert one.accept(command(0), 0) is Verdict.DISABLED
    one.enable(True)
    assert one.drive(0) == 0.0
    one.accept(command(1), 1)
    one.enable(False)
    assert one.drive(1) == 0.0
    one.enable(True)
    assert one.drive(1) == 0.0


@pytest.mark.parametrize("between", ["drive", "accept"])
@pytest.mark.parametrize("undone", ["disable", "stop"])
def test_what_is_undone_within_one_cycle_still_takes_the_drive_away(undone: str, between: str) -> None:
    one = gate()
    one.accept(command(0, 2.0), 0)
    assert one.drive(0) == 2.0
    if undone == "disable":
        one.enable(False)
    else:
        one.stop("emergency stop")
        one.reset()
    one.enable(True)
    if between == "accept":
        # The source in command is released as well: whoever speaks first is obeyed.
        assert one.accept(command(MS, 3.0, "b"), MS) is Verdict.ACCEPTED
    assert one.drive(MS) == (3.0 if between == "accept" else 0.0)
    assert one.timeouts == 0


def test_enabling_what_is_enabled_keeps_the_drive() -> None:
    one = gate()
    one.accept(command(0, 2.0), 0)
    one.drive(0)
    one.enable(True)
    assert one.drive(MS) == 2.0


def test_stop_is_latched_and_reset_does_not_enable() -> None:
    one = gate()
    one.accept(command(0), 0)
    one.stop("emergency stop")
    one.stop("second reason")
    assert one.stop_reason == "emergency stop"
    assert one.drive(0) == 0.0
    assert not one.enable(True)
    assert one.accept(command(0), 0) is Verdict.STOPPED
    one.reset()
    assert one.accept(command(0), 0) is Verdict.DISABLED
    assert one.enable(True)
    assert one.drive(0) == 0.0
    assert one.accept(command(0), 0) is Verdict.ACCEPTED


def test_reset_without_a_stop_changes_nothing() -> None:
    one = gate()
    one.accept(command(0), 0)
    one.reset()
    assert one.drive(0) == 1.0


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_limits_of_the_gate_itself(value: float) -> None:
    with pytest.raises(ValueError, match="limit"):
        CommandGate(limit=value)
    with pytest.raises(ValueError, match="watchdog"):
        CommandGate(watchdog=value)


events = st.one_of(
    st.tuples(
        st.just("command"),
        st.sampled_from(["a", "b", ""]),
        st.floats(allow_nan=True, allow_infinity=True),
        st.integers(-100, 100),
    ),
    st.tuples(st.sampled_from(["enable", "disable", "stop", "reset"])),
    st.tuples(st.just("wait"), st.integers(-200, 200)),
)


def test_a_stop_in_the_middle_of_enable_leaves_nothing_enabled_after_reset() -> None:
    class Interrupted(CommandGate):
        """Stopped by another thread just after `enable` has looked."""

        @property
        def stopped(self) -> bool:
            before = bool(self.stop_reason)
            self.stop("fault")
            return before

    one = Interrupted()
    one.enable(True)
    one.reset()
    assert one.accept(Command(0, "test", 1.0), 0) is Verdict.DISABLED
    assert one.drive(0) == 0.0


@settings(max_examples=300, deadline=None)
@given(st.lists(events, max_size=60))
def test_no_sequence_yields_a_drive_that_is_not_allowed(sequence: list[tuple]) -> None:
    one, now = CommandGate(), 0
    enabled = stopped = False
    obeyed_at: int | None = None
    for kind, *what in sequence:
        if kind == "command":
            source, drive, age = what
            verdict = one.accept(Command(now - age * MS, source, drive), now)
            if verdict.obeyed:
                assert enabled and not stopped and source and math.isfinite(drive) and abs(age) <= WATCHDOG_MS
                obeyed_at = now
        elif kind == "wait":
            now += what[0] * MS
        elif kind == "stop":
            one.stop("test")
            enabled, stopped = False, True
        elif kind == "reset":
            one.reset()
            stopped = False
        else:
            assert one.enable(kind == "enable") is (kind == "disable" or not stopped)
            enabled = kind == "enable" and not stopped
        applied = one.drive(now)
        assert math.isfinite(applied) and abs(applied) <= one.limit
        if applied != 0.0:
            assert enabled and not stopped
            assert obeyed_at is not None and 0 <= now - obeyed_at <= WATCHDOG_MS * MS
    assert sum(one.counts.values()) == sum(kind == "command" for kind, *_ in sequence)
