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
    assert one.accept(command(1, 10.0), 1) is Verdict.ACCEPTED


def test_one_source_until_it_has_been_silent() -> None:
    one = gate()
    one.accept(command(0, 1.0, "a"), 0)
    assert one.accept(command(50 * MS, 2.0, "b"), 50 * MS) is Verdict.OTHER_SOURCE
    assert one.drive(50 * MS) == 1.0
    assert one.accept(command(51 * MS, 2.0, "b"), 51 * MS) is Verdict.ACCEPTED
    assert one.source == "b"
    assert one.accept(command(52 * MS, 1.0, "a"), 52 * MS) is Verdict.OTHER_SOURCE


@pytest.mark.parametrize("step_ms", [-20, 0])
def test_stamps_of_a_source_advance(step_ms: int) -> None:
    """A command from before the last one is a replay, or two clocks; nor does it feed the watchdog."""
    one = gate()
    one.accept(command(30 * MS, 1.0), 30 * MS)
    again = Command((30 + step_ms) * MS, "a", 2.0)
    assert one.accept(again, 31 * MS) is Verdict.OUT_OF_ORDER
    assert one.drive(31 * MS) == 1.0
    assert one.drive(81 * MS) == 0.0
    assert one.accept(command(82 * MS, 2.0), 82 * MS) is Verdict.ACCEPTED


@pytest.mark.parametrize("between", ["enable", "silence", "other source"])
def test_a_replay_is_refused_whatever_came_between(between: str) -> None:
    one = CommandGate()
    one.enable(True)
    ahead = Command(100 * MS, "a", 4.0)  # stamped ahead of the plant's clock, it stays young for long
    assert one.accept(ahead, 55 * MS) is Verdict.ACCEPTED
    if between == "enable":
        one.enable(False)
        one.enable(True)
    elif between == "other source":
        assert one.accept(command(106 * MS, 1.0, "b"), 106 * MS) is Verdict.ACCEPTED
        one.enable(False)
        one.enable(True)
    assert one.drive(140 * MS) == 0.0
    assert one.accept(ahead, 140 * MS) is Verdict.OUT_OF_ORDER
    assert one.drive(140 * MS) == 0.0


def test_a_clock_set_back_does_not_lock_a_source_out() -> None:
    one = gate()
    one.accept(command(10_000 * MS), 10_000 * MS)
    assert one.accept(command(9_000 * MS, 2.0), 9_000 * MS) is Verdict.ACCEPTED
    assert one.drive(9_000 * MS) == 2.0


def twins(first: int, second: int, alone: bool = False) -> tuple[CommandGate, list[Verdict]]:
    """Two publishers that both say "a", +4 V and -4 V in turn, their messages counted from `first` and `second`."""
    one, verdicts = gate(), []
    for n in range(100):
        now = n * MS
        one.accept(Command(now, "a", 4.0), now, first + n, alone)
        verdicts.append(one.accept(Command(now + 1000, "a", -4.0), now + 1000, second + n, alone))
        if not one.stopped:
            assert one.drive(now + 1000) == 4.0
    return one, verdicts


@pytest.mark.parametrize("second", [1, 996, 1002, 1005, 5000])
def test_a_second_publisher_of_the_same_name_is_refused(second: int) -> None:
    one, verdicts = twins(1000, second)
    assert set(verdicts) == {Verdict.OTHER_PUBLISHER}
    assert one.counts[Verdict.ACCEPTED] == 100 and not one.stopped
    assert one.rivalled == "a"


@pytest.mark.parametrize("second", [1000, 1001])
def test_publishers_that_cannot_be_told_apart_are_both_stopped(second: int) -> None:
    """Their counts meet: after that nobody knows whose the next command is."""
    one, verdicts = gate(), []
    for n in range(3):
        for offset, number, drive in ((0, 1000 + n, 4.0), (1000, second + n, -4.0)):
            verdicts.append(one.accept(Command(n * MS + offset, "a", drive), n * MS + offset, number, False))
    assert one.stopped and "'a'" in one.stop_reason
    assert verdicts.count(Verdict.ACCEPTED) == second - 1000 + 1
    assert one.drive(3 * MS) == 0.0


def test_the_second_publisher_is_obeyed_once_the_first_is_silent() -> None:
    one = gate()
    one.accept(command(0, 4.0), 0, 7, False)
    assert one.accept(command(50 * MS, -4.0), 50 * MS, 1, False) is Verdict.OTHER_PUBLISHER
    assert one.accept(command(51 * MS, -4.0), 51 * MS, 2, False) is Verdict.ACCEPTED
    assert one.accept(command(52 * MS, 4.0), 52 * MS, 8, False) is Verdict.OTHER_PUBLISHER


def test_a_source_that_starts_anew_is_no_twin_of_the_silent_one_before() -> None:
    one = CommandGate(watchdog=2.0)
    one.enable(True)
    one.accept(command(0), 0, 3, False)
    for n in (1, 2, 3):
        assert one.accept(command((500 + n) * MS), (500 + n) * MS, n, False) is Verdict.OTHER_PUBLISHER
    assert not one.stopped
    assert one.accept(command(504 * MS), 504 * MS, 4, False) is Verdict.ACCEPTED


def test_one_publisher_may_lose_messages() -> None:
    one = gate()
    one.accept(command(0), 0, 7)
    assert one.accept(command(MS), MS, 12) is Verdict.ACCEPTED


@pytest.mark.parametrize("bad", [Command(MS, "a", math.nan), Command(-60 * MS, "a", 1.0), Command(0, "a", 1.0)])
def test_a_command_that_is_refused_for_what_it_says_is_not_missing_afterwards(bad: Command) -> None:
    one = gate()
    one.accept(Command(0, "a", 1.0), 0, 7, False)
    assert not one.accept(bad, MS, 8, False).obeyed
    assert one.accept(Command(2 * MS, "a", 2.0), 2 * MS, 9, False) is Verdict.ACCEPTED


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
    assert one.accept(command(1), 1) is Verdict.ACCEPTED


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
        st.one_of(st.none(), st.integers(1, 20)),
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
    stamps: dict[str, int] = {}
    for kind, *what in sequence:
        if kind == "command":
            source, drive, age, number = what
            stamp = now - age * MS
            verdict = one.accept(Command(stamp, source, drive), now, number, False)
            stopped, enabled = one.stopped, enabled and not one.stopped
            if verdict.obeyed:
                last = stamps.get(source)
                assert last is None or stamp > last or last > now + WATCHDOG_MS * MS, "only a clock set back goes back"
                stamps[source] = stamp
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
