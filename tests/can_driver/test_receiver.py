"""Sorting of what comes: the driver's own echoes, strangers, heartbeats, emergencies, error frames."""

from __future__ import annotations

from typing import Any

import can
import pytest

from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.faults import BusFault, FaultLatch
from hydraulic_can_driver.frames import Frames
from hydraulic_can_driver.receiver import Receiver


def listening(interface: str, **options: Any) -> tuple[Receiver, FaultLatch]:
    bus, faults = load_bus("bench"), FaultLatch()
    faults.armed = True
    one = Receiver(bus, Frames(bus, faults), faults, interface, **options)
    one.watching = True
    return one, faults


def hear(one: Receiver, cob_id: int, data: str = "", **kind: bool) -> None:
    one.on_message_received(
        can.Message(arbitration_id=cob_id, data=bytes.fromhex(data), is_extended_id=kind.pop("extended", False), **kind)
    )


def test_echoes_that_come_late_and_all_at_once_are_no_stranger() -> None:
    one, faults = listening("udp_multicast")
    for _ in range(200):
        one.sending(0x80)
    for _ in range(200):
        hear(one, 0x80)
    assert not faults.text
    hear(one, 0x80)
    assert BusFault.SECOND_MASTER in faults


def test_an_echo_that_was_lost_does_not_excuse_a_stranger_for_ever() -> None:
    now = [100.0]
    one, faults = listening("udp_multicast", now=lambda: now[0])
    one.sending(0x510)
    now[0] += 1.5
    hear(one, 0x510, "07000040")
    assert BusFault.SECOND_MASTER in faults


def test_where_nothing_comes_back_every_such_frame_is_a_strangers() -> None:
    one, faults = listening("socketcan")
    one.sending(0x510)
    hear(one, 0x510, "00000000")
    assert BusFault.SECOND_MASTER in faults


@pytest.mark.parametrize(
    ("cob_id", "data", "fault", "words"),
    [
        (0x710, "00", BusFault.RESTART, "valve has restarted"),
        (0x720, "7f", BusFault.RESTART, "lvdt is PRE-OPERATIONAL, not OPERATIONAL"),
        (0x730, "04", BusFault.RESTART, "pressure_a is STOPPED"),
        (0x710, "63", BusFault.RESTART, "valve is state 99"),
        (0x090, "12340401aabbccdd", BusFault.EMERGENCY, "valve: EMCY 0x3412, error register 0x04, 01 aa bb cc dd"),
        (0x1A0, "00", BusFault.LENGTH, "lvdt: COB-ID 0x1A0 has 1 bytes; mapped are 7"),
    ],
)
def test_what_is_a_fault(cob_id: int, data: str, fault: BusFault, words: str) -> None:
    one, faults = listening("virtual")
    hear(one, cob_id, data)
    assert {kind for kind in BusFault if kind in faults} == {fault} and words in faults.text


@pytest.mark.parametrize(
    ("cob_id", "data"), [(0x710, ""), (0x710, "0505"), (0x090, "1234"), (0x3FF, "00"), (0x700, "")]
)
def test_what_is_only_counted(cob_id: int, data: str) -> None:
    one, faults = listening("virtual")
    hear(one, cob_id, data)
    assert one.unexpected == 1 and not faults.text


def test_the_end_of_an_emergency_is_no_fault() -> None:
    one, faults = listening("virtual")
    hear(one, 0x090, "0000000000000000")
    assert not faults.text and one.emergencies[-1] == "valve: no error"


@pytest.mark.parametrize("kind", [{"extended": True}, {"is_remote_frame": True}])
def test_extended_and_remote_frames_are_not_ours(kind: dict[str, Any]) -> None:
    one, faults = listening("virtual")
    hear(one, 0x710, "" if "is_remote_frame" in kind else "00", **kind)
    assert one.unexpected == 1 and not faults.text


def test_bus_off() -> None:
    one, faults = listening("socketcan")
    hear(one, 0x04, "0000000000000000", is_error_frame=True)
    assert not faults.text, "other error frames do not end the traffic"
    hear(one, 0x40, "0000000000000000", is_error_frame=True)
    assert BusFault.BUS in faults and "bus-off" in faults.text


def test_a_receiving_thread_that_fails() -> None:
    one, faults = listening("socketcan")
    one.on_error(OSError(100, "Network is down"))
    assert "Network is down" in faults.text


PERIOD = 1.0 / load_bus("bench").rate


def hear_kernel(one: Receiver, *syncs: float) -> None:
    """SYNCs of the kernel, in periods."""
    for instant in syncs:
        one.on_message_received(
            can.Message(arbitration_id=0x80, is_extended_id=False, timestamp=100 + instant * PERIOD)
        )


def test_syncs_of_the_kernel_may_be_late_but_not_too_many() -> None:
    bus, faults = load_bus("bench"), FaultLatch()
    faults.armed = True
    one = Receiver(bus, Frames(bus, faults), faults, "socketcan", kernel_sync=True)
    one.watching = True
    hear_kernel(one, *(n + (0.9 if n % 3 == 0 else 0.0) for n in range(300)))
    hear_kernel(one, *(300.0 + 0.999 * n for n in range(1000)))
    assert not faults.text and one.frames.cycle == 1300
    hear_kernel(one, 1400.0, 1400.5, 1401.0, 1401.5, 1402.0, 1402.5, 1403.0)
    assert BusFault.SECOND_MASTER in faults and "0x080" in faults.text
