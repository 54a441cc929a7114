"""The driver against scripted frames: what it puts on the wire, byte for byte, and what it makes of what comes."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from random import Random
from threading import Thread
from typing import Any

import can
import pytest

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.errors import DeviceError
from hydraulic_can_driver.faults import BusFault


def test_boot_start_drive_and_stop(bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any) -> None:
    # The scripted piston stands: only without pressure to move it is that no stuck sensor, however long it takes.
    wire.answers[0x1B2] = struct.pack("<hB", 900, 0)
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    loop.drive = 5.0
    wait_until(lambda: (0x510, bytes.fromhex("0700 0020")) in wire.log, "5 V on the wire")
    loop.drive = -10.0
    wait_until(lambda: (0x510, bytes.fromhex("0700 00c0")) in wire.log, "-10 V on the wire")
    wait_until(lambda: loop.samples[-1].drive == -10.0, "a sample with the drive")
    sample = loop.samples[-1]
    assert sample.position == pytest.approx(0.0, abs=1e-12) and sample.spool == pytest.approx(-0.5e-3)
    assert (sample.pressure_a, sample.pressure_b, sample.pressure_supply) == (7e6, 7e6, 0.9e6)
    loop.end()
    words = [data[0] for _, data in wire.sent(0x510)]
    steps = [word for word, before in zip(words, [-1, *words], strict=False) if word != before]
    assert steps == [0, 1, 3, 7, 1, 0]
    assert wire.log[-1][0] != 0x510 and wire.sent(0x510)[-1] == (0x510, bytes(4))


def test_boot_byte_for_byte(bench: Bench, wire: Any) -> None:
    bench.boot()
    to_lvdt = [data.hex(" ") for _, data in wire.sent(0x620)]
    written = [request for request in to_lvdt if not request.startswith("40")]
    # Expedited downloads: 23/2b/2f for 4/2/1 bytes, index, sub-index, value; all little-endian.
    assert written == [
        "23 05 60 01 e8 03 00 00",  # step: 1 um
        "23 01 64 01 e8 03 00 00",  # work area from 1 mm ...
        "23 02 64 01 38 3d 17 00",  # ... to 1523 mm
        "2b 17 10 00 32 00 00 00",  # heartbeat: 50 ms
        "23 00 18 01 a0 01 00 80",  # frame off
        "2f 00 1a 00 00 00 00 00",  # mapping off
        "23 00 1a 01 20 00 04 60",  # position, 32 bits
        "23 00 1a 02 10 01 30 60",  # speed, 16 bits
        "23 00 1a 03 08 01 00 64",  # work area, 8 bits
        "2f 00 1a 00 03 00 00 00",  # mapping on
        "2f 00 18 02 01 00 00 00",  # with every SYNC
        "23 00 18 01 a0 01 00 00",  # frame on
    ]
    assert to_lvdt[:2] == ["40 00 10 00 00 00 00 00", "23 05 60 01 e8 03 00 00"], "first of all: who is it?"
    to_valve = [data.hex(" ") for _, data in wire.sent(0x610) if data[0] != 0x40]
    assert to_valve[:2] == ["2b 00 63 01 00 00 00 00", "2b 40 60 00 00 00 00 00"], "setpoint 0, then control word 0"
    assert wire.sent(0x000) == [(0, bytes([128, node])) for node in (0x10, 0x20, 0x30, 0x31, 0x32)], "never a reset"


def test_a_second_boot_writes_no_mapping(bench: Bench, wire: Any) -> None:
    bench.boot()
    wire.log.clear()
    bench.boot()
    mapped = [
        data for _, data in wire.sent(0x610, 0x620, 0x630) if data[0] != 0x40 and data[2] in (0x14, 0x16, 0x18, 0x1A)
    ]
    assert mapped == []


@pytest.mark.parametrize(
    ("node", "index", "data", "words"),
    [
        (0x10, 0x1000, "96010000", r"valve \(node 0x10\): device of profile 406; expected 408"),
        (0x20, 0x1000, "98010800", r"lvdt \(node 0x20\): device of profile 408; expected 406"),
    ],
)
def test_wrong_profile(bench: Bench, wire: Any, node: int, index: int, data: str, words: str) -> None:
    wire.objects[(node, index, 0)] = bytes.fromhex(data)
    with pytest.raises(DeviceError, match=words):
        bench.boot()
    assert not wire.sent(0x510, 0x80), "nothing is driven"


def test_wrong_vendor(bench: Bench, wire: Any) -> None:
    wire.objects[(0x10, 0x1018, 1)] = bytes.fromhex("29000000")
    with pytest.raises(DeviceError, match="vendor is 0x29; expected 0x28"):
        bench.boot()
    assert all(data[0] == 0x40 for _, data in wire.sent(0x610)), "nothing is written to a stranger"


def test_sdo_abort_names_device_object_and_reason(bench: Bench, wire: Any) -> None:
    wire.aborts[(0x10, 0x6043, 0)] = 0x08000022
    with pytest.raises(DeviceError, match=r"valve \(node 0x10\): 0x6043:0 cannot be set to 2: .*0x08000022.*state"):
        bench.boot()


def test_a_device_that_keeps_another_value(bench: Bench, wire: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    serve = type(wire)._sdo

    def stubborn(self: Any, node: int, request: bytes) -> None:
        serve(self, node, request)
        if request[:4] == bytes.fromhex("2f436000"):
            self.objects[(0x10, 0x6043, 0)] = b"\x01"

    monkeypatch.setattr(type(wire), "_sdo", stubborn)
    with pytest.raises(DeviceError, match="0x6043:0 is 1 after 2 was written"):
        bench.boot()


def test_a_device_that_is_not_there(bench: Bench, wire: Any) -> None:
    wire.mute.add(0x31)
    with pytest.raises(DeviceError, match=r"pressure_b \(node 0x31\): 0x1000:0 cannot be read: no answer"):
        bench.boot()


def test_start_says_who_does_not_send(bench: Bench, wire: Any) -> None:
    bench.boot()
    del wire.answers[0x1B1]
    bench.machine._patience = 1.0  # a busy machine must find the time for those that do send
    object.__setattr__(bench.bus.monitoring, "state_change", 1.0)
    with pytest.raises(DeviceError, match="no frames from pressure_b"):
        bench.start()
    bench.stop()
    assert wire.sent(0x510)[-1] == (0x510, bytes(4))


def test_fault_in_the_status_word_and_its_reset(
    bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any
) -> None:
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    loop.drive = 1.0
    wait_until(lambda: (0x510, bytes.fromhex("0700 6606")) in wire.log, "1 V on the wire")
    wire.follows = False
    wire.answers[0x490] = bytes.fromhex("0300 0000")  # FAULT_HOLD, without an EMCY
    wait_until(lambda: BusFault.VALVE in bench.faults, "the fault")
    assert "FAULT_HOLD (0x0003)" in bench.problem
    wait_until(lambda: wire.log[-1] and wire.sent(0x510)[-1][1] == bytes.fromhex("0100 0000"), "0 V and Disabled")
    before = len(wire.sent(0x510))
    Thread(target=reset_quietly, args=(bench,)).start()
    wait_until(lambda: (0x510, bytes.fromhex("0900 0000")) in wire.sent(0x510)[before:], "the rising edge of bit 3")
    wire.answers[0x490] = bytes.fromhex("0900 0000")
    wait_until(lambda: not bench.problem and bench.machine.arrived, "the end of the reset")
    assert wire.sent(0x510)[-1][1][2:] == bytes(2)


def reset_quietly(bench: Bench) -> None:
    with suppress(DeviceError):
        bench.reset()


def test_a_reset_without_a_fault_disturbs_nothing(
    bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any
) -> None:
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    wire.log.clear()
    bench.reset()
    wait_until(lambda: len(wire.sent(0x510)) > 5, "more cycles")
    assert {data[0] for _, data in wire.sent(0x510)} == {7}


FOREIGN = {"NMT": (0x000, "0100"), "SYNC": (0x080, ""), "drive": (0x510, "0f000040"), "heartbeat": (0x77F, "05")}


@pytest.mark.parametrize("name", FOREIGN)
def test_second_master(name: str, bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any) -> None:
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    loop.drive = 1.0
    wait_until(lambda: (0x510, bytes.fromhex("0700 6606")) in wire.log, "1 V on the wire")
    cob_id, data = FOREIGN[name]
    wire.send(cob_id, bytes.fromhex(data))
    wait_until(lambda: BusFault.SECOND_MASTER in bench.faults, "the fault")
    assert f"0x{cob_id:03X}" in bench.problem
    wait_until(lambda: wire.sent(0x510)[-1][1] == bytes.fromhex("0100 0000"), "0 V and Disabled")


def test_limit_switches_block_only_outwards(
    bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any
) -> None:
    def shut() -> None:  # or a piston that stands would be taken for a stuck sensor, 40 ms later
        wire.answers[0x490] = wire.answers[0x490][:2] + bytes(2)

    wire.on_sync = shut
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    loop.drive = 10.0
    wait_until(lambda: loop.samples[-1].drive == 10.0, "10 V")
    for word, switch, blocked, free in ((0x02, "limit_extended", 5.0, -5.0), (0x04, "limit_retracted", -5.0, 5.0)):
        wire.answers[0x1A0] = wire.answers[0x1A0][:6] + bytes([word])
        wait_until(lambda switch=switch: bench.measuring.closed == (switch,), "the switch")
        loop.drive = blocked
        wait_until(lambda: loop.samples[-1].drive == 0.0, "0 V outwards")
        loop.drive = free
        wait_until(lambda free=free: loop.samples[-1].drive == free, "the drive inwards")
        assert getattr(loop.samples[-1], switch) and not bench.problem


def test_a_loop_that_was_held_up(bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any) -> None:
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    loop.drive = 1.0
    wait_until(lambda: loop.samples[-1].drive > 0.9, "1 V")
    object.__setattr__(bench.bus.monitoring, "sync_gap", 0.5)
    loop.hold.clear()
    time.sleep(0.8)
    loop.hold.set()
    wait_until(lambda: BusFault.SYNC in bench.faults, "the fault")
    assert "held up" in bench.problem
    wait_until(lambda: wire.sent(0x510)[-1][1] == bytes.fromhex("0100 0000"), "0 V and Disabled")


def test_an_interface_that_fails(
    bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    bench.follow(State.ACTIVE)
    loop.drive = 1.0

    def down(message: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("Network is down")

    monkeypatch.setattr(bench.master.can, "send", down)
    wait_until(lambda: BusFault.BUS in bench.faults, "the fault")
    assert "Network is down" in bench.problem
    loop.ending = True
    loop.join()
    with pytest.raises(DeviceError, match="not seen to be disabled"):
        bench.stop()
    monkeypatch.undo()


def test_garbage_does_no_harm(bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any) -> None:
    """A hundred thousand frames of anything, on any identifier, against the receiving path, while the bench runs."""
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    loop.first.wait()
    random = Random(1)
    known = [0x000, 0x080, 0x090, 0x0A0, 0x490, 0x1A0, 0x1B0, 0x510, 0x590, 0x5A0, 0x710, 0x720, 0x77F]
    for number in range(100_000):
        cob_id = random.choice(known) if number % 2 else random.randrange(0x800)
        bench.receiver.on_message_received(
            can.Message(
                arbitration_id=cob_id,
                data=random.randbytes(random.randrange(9)),
                is_extended_id=number % 97 == 0,
                is_remote_frame=number % 89 == 0,
                is_error_frame=number % 83 == 0,
            )
        )
    for _ in range(2000):  # and through canopen, SDO answers that nobody asked for included
        wire.send(random.choice(known), random.randbytes(random.randrange(9)))
    cycles = bench.supervision.cycles
    wait_until(lambda: bench.supervision.cycles > cycles + 50, "cycles that go on")
    assert bench.problem, "such a bus is no bus to drive on"
    assert {data[2:] for _, data in wire.sent(0x510)} == {bytes(2)}, "never anything but 0 V"
    assert all(math.isfinite(sample.position) for sample in loop.samples)
    with pytest.raises(DeviceError):
        bench.follow(State.ACTIVE)
