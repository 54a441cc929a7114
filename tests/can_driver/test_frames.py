"""Which SYNC a frame answers: late ones, lost ones, and those that this program looks at late."""

from __future__ import annotations

import struct
import time
from dataclasses import replace
from typing import Any

import pytest

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.faults import FaultLatch
from hydraulic_can_driver.frames import Frames

LVDT = 0x1A0
RATE = 50.0  # low, so that on a busy machine the answers come within their cycle
MILLISECOND = 1_000_000


class Cycles:
    """Frames of the shipped bus; the LVDT reads as many millimetres from its zero as SYNCs were sent."""

    def __init__(self) -> None:
        self.frames = Frames(load_bus("bench"), FaultLatch())
        self.count = 0
        self.sent_ns = 0

    def sync(self) -> int:
        """The next SYNC, which all but the LVDT answer; its number."""
        self.count += 1
        self.sent_ns = time.time_ns()
        self.frames.begin(self.sent_ns)
        for cob_id in self.frames.cob_ids:
            if cob_id != LVDT:
                self.frames.take(cob_id, bytes(4 if cob_id == 0x490 else 3))
        return self.count

    def answer(self, number: int, received_ns: int = 0) -> None:
        """The LVDT's frame for that SYNC."""
        self.frames.take(LVDT, struct.pack("<ihB", 1000 * number, 0, 0), received_ns)

    def end(self) -> int | None:
        """Number of the SYNC that the position of a complete cycle answers; None if the cycle is not complete."""
        complete = self.frames.wait(time.monotonic())
        self.frames.end()
        return round((self.frames.quantities()["position"] + 0.762) * 1e3) if complete else None

    def cycle(self, *numbers: int) -> int | None:
        """A SYNC that these answers follow."""
        self.sync()
        for number in numbers:
            self.answer(number)
        return self.end()


@pytest.fixture
def cycles() -> Cycles:
    one = Cycles()
    assert one.cycle(1) == 1
    return one


def test_the_answer_to_the_sync_before_is_not_taken_for_that_to_this_one(cycles: Cycles) -> None:
    assert cycles.cycle() is None
    assert cycles.cycle(2) is None
    assert cycles.cycle(3, 4) == 4
    assert cycles.cycle(5) == 5
    assert not cycles.frames.debtors() and cycles.frames.late == 2


def test_a_device_that_is_held_up_is_believed_when_it_has_answered_every_sync(cycles: Cycles) -> None:
    answers = [(), (), (), (), (2,), (3,), (4,), (5, 6), (7, 8), (9, 10), (11, 12), (13,)]
    found = [cycles.cycle(*numbers) for numbers in answers]
    assert found == [None] * 10 + [12, 13]
    assert cycles.frames.debtors() == []


def test_late_and_still_in_this_cycle(cycles: Cycles) -> None:
    assert cycles.cycle() is None
    assert cycles.cycle(2, 3) == 3


def test_between_two_cycles_comes_what_belongs_to_the_first(cycles: Cycles) -> None:
    assert cycles.cycle() is None
    cycles.answer(2)
    assert cycles.cycle(3) == 3


def test_what_was_received_before_the_sync_does_not_answer_it(cycles: Cycles) -> None:
    """However late the receiving thread gets to it."""
    assert cycles.cycle() is None
    received = cycles.sent_ns + MILLISECOND // 10
    time.sleep(0.002)
    cycles.sync()
    cycles.answer(2, received)
    assert not cycles.frames.wait(time.monotonic())
    cycles.answer(3, time.time_ns())
    assert cycles.end() == 3


def test_a_frame_that_is_lost_for_good_is_forgotten_after_two_steady_cycles(cycles: Cycles) -> None:
    assert [cycles.cycle(), cycles.cycle(3), cycles.cycle(4), cycles.cycle(5)] == [None, None, None, 5]


def test_many_that_are_lost_are_not(cycles: Cycles) -> None:
    """They may be still to come: the device is late."""
    assert [cycles.cycle() for _ in range(3)] == [None] * 3
    assert [cycles.cycle(5 + n) for n in range(50)] == [None] * 50
    assert cycles.frames.debtors() == ["lvdt by 3 cycles"]


def test_a_sync_that_is_heard_before_the_cycle_has_ended_is_owed_an_answer(cycles: Cycles) -> None:
    cycles.sync()
    assert cycles.cycle(2) is None


def test_nobody_owes_anything(cycles: Cycles) -> None:
    cycles.cycle()
    cycles.frames.forget()
    assert cycles.cycle(3) == 3


def test_who_has_never_sent_is_named_alone_where_a_cycle_lacks_others_as_well(cycles: Cycles) -> None:
    def held_up() -> list[str]:
        cycles.frames.begin(time.time_ns())
        cycles.frames.end()
        return cycles.frames.lacking()

    everybody = held_up()
    assert "lvdt" in everybody and "valve" in everybody, "all have been heard before"
    cycles.frames.forget()
    cycles.cycle()
    assert held_up() == ["lvdt"]
    cycles.cycle(3)
    assert held_up() == everybody


@pytest.mark.parametrize("late", [1, 2, 3, 7])
def test_every_sample_has_the_position_of_its_own_sync(patient: Bus, wire: Any, late: int) -> None:
    """An LVDT that says nothing for a while, then answers one SYNC, and then all at once, time and again."""
    bench = Bench(replace(patient, channel=wire.channel, rate=RATE))
    bench.boot()
    bench.start()
    count = 0
    waiting: list[bytes] = []

    def sync() -> None:
        nonlocal count
        count += 1
        waiting.append(struct.pack("<ihB", 762_000 + 100 * count, 0, 0))
        if count % 20 < late:
            wire.answers.pop(LVDT, None)
            return
        if count % 20 == late:
            wire.answers[LVDT] = waiting.pop(0)
            return
        for frame in waiting[:-1]:
            wire.send(LVDT, frame)
        wire.answers[LVDT] = waiting[-1]
        waiting.clear()

    wire.on_sync = sync
    samples = 0
    for _ in range(80):
        sample = bench.cycle(time.time_ns() + bench.beat.lead_ns, 0.0)
        if sample is not None:
            assert sample.position == pytest.approx(1e-4 * count, abs=1e-9)
            samples += 1
    bench.close()
    assert samples > 30
