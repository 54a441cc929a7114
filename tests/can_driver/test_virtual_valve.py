"""The virtual valve: its state machine, what its amplifier does to set-points, and how it gives up without a master."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from can_driver.station import DRIVE, VALVE, Station
from hypothesis import given
from hypothesis import strategies as st

from hydraulic_can_driver.virtual.amplifier import Amplifier, Shaping
from hydraulic_can_driver.virtual.faults import CableBreak, StatusFault
from hydraulic_can_driver.virtual.valve_state import LADDER, State, StateMachine, wanted


@pytest.fixture(name="far")
def far_fixture() -> Iterator[Station]:
    with Station() as station:
        yield station


def machine() -> StateMachine:
    found = StateMachine()
    found.ready()
    return found


def test_state_by_state_and_back() -> None:
    one = machine()
    assert one.state is State.INIT
    for word, state in ((1, State.DISABLED), (3, State.HOLD), (7, State.ACTIVE), (3, State.HOLD), (0, State.INIT)):
        one.advance(word, False)
        assert one.state is state
    assert one.advance(7, False) == (State.DISABLED, State.HOLD, State.ACTIVE)
    assert one.advance(0, False) == (State.HOLD, State.DISABLED, State.INIT)


@pytest.mark.parametrize(
    ("word", "faulted", "then"),
    [
        (0, State.FAULT_INIT, State.FAULT_INIT),
        (1, State.FAULT_DISABLED, State.FAULT_DISABLED),
        (3, State.FAULT_HOLD, State.FAULT_HOLD),
        (7, State.FAULT_REACTION, State.FAULT_HOLD),
    ],
)
def test_a_fault_stays_until_an_edge_of_reset_finds_its_cause_gone(word: int, faulted: State, then: State) -> None:
    one = machine()
    one.advance(word, False)
    one.fault("broken")
    assert one.state is faulted
    one.advance(word, True)
    assert one.state is then
    one.advance(word | 8, True)  # an edge, but the cause is still there
    assert one.faulty
    one.advance(word | 8, False)  # gone, but no edge
    assert one.faulty
    one.advance(word, False)
    one.advance(word | 8, False)
    assert not one.faulty
    one.advance(7, False)
    assert one.state is (State.HOLD if word == 7 else State.ACTIVE)  # active anew only after a word without the bit
    one.advance(3, False)
    one.advance(7, False)
    assert one.state is State.ACTIVE


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.booleans(), st.booleans()), max_size=60))
def test_active_only_while_the_word_asks_for_it(steps: list[tuple[int, bool, bool]]) -> None:
    one = machine()
    for word, breaks, lasts in steps:
        if breaks:
            one.fault("any")
            assert one.state is not State.ACTIVE
        one.advance(word, lasts)
        if one.state is State.ACTIVE:
            assert word & 7 == 7
        if not one.faulty:
            assert LADDER.index(one.state) <= LADDER.index(wanted(word)) or word & 8
        assert 0 <= one.state.bits <= 15


def opening(shaping: Shaping, setpoint: float) -> float:
    amplifier = Amplifier()
    amplifier.shaping = shaping
    return amplifier.opening(setpoint, 0.002)


@given(st.floats(-1.0, 1.0))
def test_an_amplifier_as_delivered_changes_nothing(setpoint: float) -> None:
    assert opening(Shaping(), setpoint) == setpoint


@pytest.mark.parametrize(
    ("shaping", "setpoint", "expected"),
    [
        (Shaping(upper=0.4), 0.5, 0.4),
        (Shaping(lower=-0.3), -0.5, -0.3),
        (Shaping(gain=0.5, offset=0.1), 0.6, 0.4),
        (Shaping(positive_gain=0.5), 0.6, 0.3),
        (Shaping(positive_gain=0.5), -0.6, -0.6),
        (Shaping(dead_band=(0.05, 0.1, 0.0)), 0.5, 0.05 + 0.95 * 0.5),
        (Shaping(dead_band=(0.05, 0.1, 0.0)), -0.5, -0.1 - 0.9 * 0.5),
        (Shaping(dead_band=(0.05, 0.1, 0.02)), 0.01, 0.5 * (0.05 + 0.95 * 0.02)),
        (Shaping(dead_band=(0.05, 0.1, 0.0)), 1.0, 1.0),
        (Shaping(zero=0.02), 0.0, 0.02),
        (Shaping(zero=0.02), 1.0, 1.0),
        (Shaping(table=[(k / 5 - 1) ** 3 for k in range(11)]), 0.8, 0.512),
        (Shaping(table=[(k / 5 - 1) ** 3 for k in range(11)]), 0.9, 0.5 * (0.512 + 1.0)),
        (Shaping(table=[(k / 5 - 1) ** 3 for k in range(11)]), -1.0, -1.0),
    ],
)
def test_each_setting_alone(shaping: Shaping, setpoint: float, expected: float) -> None:
    assert opening(shaping, setpoint) == pytest.approx(expected)


def test_ramps_by_quadrant() -> None:
    amplifier = Amplifier()
    amplifier.shaping = Shaping(ramps=(0.1, 0.2, 0.05, 0.0))  # s for full scale
    assert [amplifier.opening(1.0, 0.02) for _ in range(3)] == pytest.approx([0.2, 0.4, 0.6])
    assert amplifier.ramping
    assert [amplifier.opening(-0.3, 0.02) for _ in range(4)] == pytest.approx([0.2, 0.0, -0.1, -0.2])
    assert amplifier.opening(0.5, 0.02) == pytest.approx(0.2)  # back at once, then up
    assert amplifier.opening(0.3, 0.02) == pytest.approx(0.3)
    assert not amplifier.ramping


SETTINGS = [
    ("2b246301 f401", 0, 0.30517578125),  # zero offset 500 counts
    ("2b206301 0010", 8192, 2.5),  # upper limit a quarter
    ("2b226301 0020", 8192, 2.5),  # scaling a half
]


@pytest.mark.parametrize(("request_", "setpoint", "drive"), SETTINGS)
def test_settings_by_sdo_reach_the_spool(far: Station, request_: str, setpoint: int, drive: float) -> None:
    assert far.sdo(VALVE, request_).startswith("60")
    far.activate()
    far.command(7, setpoint)
    assert far.plant.drives[-1] == pytest.approx(drive)


def test_a_setting_with_a_switch_acts_when_it_is_on(far: Station) -> None:
    far.sdo(VALVE, "2b436301 6606")  # 1638 counts: a tenth
    far.activate()
    far.command(7, 8192)
    assert far.plant.drives[-1] == pytest.approx(5.0)
    far.sdo(VALVE, "2f426300 01")
    far.command(7, 8192)
    assert far.plant.drives[-1] == pytest.approx(10.0 * (0.5 + 0.5 * 1638 / 16384))


def test_stored_settings_survive_a_power_cut_and_others_do_not(far: Station) -> None:
    far.bench.valve.store(0x6324, 1, 500)
    far.sdo(VALVE, "2b206301 0010")
    far.bench.valve.power_off()
    far.bench.valve.power_on()
    assert far.sdo(VALVE, "40246301") == "4b246301f4010000"
    assert far.sdo(VALVE, "40206301") == "4b20630100400000"


def test_limit_and_ramp_show_in_the_status_word(far: Station) -> None:
    far.sdo(VALVE, "2b206301 0010")
    far.activate()
    assert far.command(7, 8192)[:4] == "0f04"
    far.sdo(VALVE, "2b316301 e803")
    far.sdo(VALVE, "2f306300 01")
    assert far.command(7, -8192)[:4] == "0f02"


def test_hold_goes_to_the_hold_set_point(far: Station) -> None:
    far.sdo(VALVE, "2b146301 0004")
    far.start()
    assert far.command(3, 8192)[:4] == "0b00"
    assert far.plant.drives[-1] == pytest.approx(0.625)
    far.command(1)
    assert far.plant.drives[-1] == 0.0


def test_local_mode_obeys_nobody_on_the_bus(far: Station) -> None:
    far.activate()
    far.sdo(VALVE, "2f426000 02")
    assert far.command(7, 8192)[:2] == "1f"
    assert far.plant.drives[-1] == 0.0
    assert far.sdo(VALVE, "2b006301 0010") == "8000630122000008"


def test_a_spool_that_does_not_follow(far: Station) -> None:
    far.plant.reading["spool"] = 0.0
    far.sdo(VALVE, "2f516300 01")
    far.activate()
    far.command(7, 8192)
    assert far.command(7, 8192)[:4] == "0f08"  # longer than 30 ms beyond 512 counts


@pytest.mark.parametrize(
    ("prepare", "begin", "code"),
    [
        ("23161001 32007f00", lambda far: far.send(0x77F, "05"), "30811100"),  # heartbeat of 0x7F within 50 ms
        # Nothing is waited for: on a busy machine the emergency may come before the answer, and would be dropped.
        ("2b031405 3200", lambda far: far.order(7, 8192), "50821100"),  # a set-point every 50 ms
        ("2b012200 3200", lambda far: far.send(0x80), "00811100"),  # SYNC every 50 ms
    ],
    ids=["heartbeat", "set-point", "SYNC"],
)
def test_without_its_master_it_goes_to_zero_by_itself(far: Station, prepare: str, begin: Any, code: str) -> None:
    far.sdo(VALVE, "2b012200 0000")
    far.activate()
    far.command(7, 8192)
    assert far.bench.drive == pytest.approx(5.0)
    far.sdo(VALVE, prepare)
    begin(far)
    assert far.frame(0x90)[:8] == code
    assert far.bench.drive == 0.0
    assert far.bench.valve.machine.faulty
    assert far.sdo(VALVE, "40411060".replace("411060", "416000"))[8:10] in ("03", "07")
    far.send(0x80)
    assert far.frames(0x490, patience=0.3) == []  # pre-operational, as 0x1029 says
    # A master that comes back resets it, and gets nothing moved before it asks for it anew.
    far.sdo(VALVE, "23161001 00000000")
    far.sdo(VALVE, "2b031405 0000")
    far.sdo(VALVE, "2b012200 0000")
    far.start(VALVE)
    assert far.command(0)[:2] in ("03", "01")
    assert far.command(8)[:2] == "08" or far.command(0)[:2] == "08"
    assert far.command(7, 8192)[:2] == "0f"


def test_that_can_be_switched_off(far: Station) -> None:
    far.sdo(VALVE, "2b012200 0000")
    far.activate()
    far.command(7, 8192)
    assert far.frames(0x90, patience=0.4) == []
    assert far.bench.drive == pytest.approx(5.0)


def test_it_may_hold_a_set_point_of_its_own_instead(far: Station) -> None:
    far.sdo(VALVE, "2b146301 0004")
    far.sdo(VALVE, "2f002200 01")
    far.sdo(VALVE, "2b012200 3200")
    far.activate()
    far.command(7, 8192)
    assert far.frame(0x90)[:4] == "0081"
    assert far.bench.drive == pytest.approx(0.625)


def test_leaving_operational_ends_the_control(far: Station) -> None:
    far.activate()
    far.command(7, 8192)
    far.send(0, "8010")
    assert far.sdo(VALVE, "40416000") == "4b41600008000000"
    assert far.bench.drive == 0.0


@pytest.mark.parametrize("fault", [StatusFault("valve"), CableBreak("valve")], ids=["supply", "cable"])
def test_its_own_fault_lasts_as_long_as_its_cause(far: Station, fault: Any) -> None:
    far.activate()
    far.command(7, 8192)
    far.bench.inject(fault)
    assert far.bench.drive == 0.0
    assert far.command(0)[:2] in ("03", "01")
    assert far.command(8)[:2] == "01"
    far.bench.clear(fault)
    assert far.command(0)[:2] == "01"
    assert far.command(8)[:2] == "09"
    assert far.command(0)[:2] == "08"
    assert far.sdo(VALVE, "40011000") == "4f01100000000000"


def test_a_late_command_of_an_earlier_run_is_not_obeyed(far: Station) -> None:
    far.activate()
    far.send(DRIVE, "070000200000")
    far.send(0, "8010")
    far.start(VALVE)
    assert far.sync()[:2] == "08"
    assert far.bench.drive == 0.0
