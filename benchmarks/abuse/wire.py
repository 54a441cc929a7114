"""Frames on the CAN bus, put through everything that the driver does with them but waiting."""

from __future__ import annotations

import math
import random
import struct
from functools import lru_cache
from pathlib import Path

import can

from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.cia408 import State, StateMachine
from hydraulic_can_driver.codec import PdoCodec
from hydraulic_can_driver.errors import CodecError
from hydraulic_can_driver.faults import FaultLatch
from hydraulic_can_driver.frames import Frames
from hydraulic_can_driver.measuring import Measuring
from hydraulic_can_driver.receiver import Receiver
from hydraulic_can_driver.supervision import Supervision
from hydraulic_interfaces.contract import DRIVE_LIMIT_V

from . import must
from .values import number

CYCLES = 60


@lru_cache
def _bus() -> Bus:
    return load_bus("bench")


class _Wire:
    """Makes frames: of devices that work, of devices that do not, and of nobody."""

    def __init__(self, rng: random.Random, bus: Bus) -> None:
        self._rng = rng
        self._pdos = [pdo for node in bus.nodes.values() for pdo in node.transmit]
        self._codecs = {pdo.cob_id: PdoCodec(pdo) for pdo in self._pdos}
        self._known = [
            *(pdo.cob_id for pdo in self._pdos),
            *(base + node.id for node in bus.nodes.values() for base in (0x080, 0x180, 0x580, 0x600, 0x700)),
            *(0x000, 0x080, bus.drive_pdo.cob_id, 0x700 + bus.master.id),
        ]
        self.status = 0

    def true(self) -> list[can.Message]:
        """What the devices answer to a SYNC, or most of it."""
        kept = [pdo for pdo in self._pdos if self._rng.random() < 0.98]
        return [can.Message(arbitration_id=pdo.cob_id, data=self._data(pdo.cob_id)) for pdo in kept]

    def strange(self) -> can.Message:
        """Any frame."""
        rng = self._rng
        cob_id = rng.choice(self._known) if rng.random() < 0.8 else rng.randrange(0x800)
        data = rng.randbytes(rng.choice((0, 1, 2, 4, 7, 8, rng.randrange(9))))
        flags = {"is_error_frame": rng.random() < 0.03, "is_remote_frame": rng.random() < 0.03}
        if flags["is_remote_frame"]:
            data = b""
        extended = rng.random() < 0.03
        at = rng.choice((0.0, 1e9, 1e9 + rng.gauss(0.0, 0.01), rng.uniform(0.0, 4e9)))  # of the kernel
        return can.Message(arbitration_id=cob_id, data=data, is_extended_id=extended, timestamp=at, **flags)

    def _data(self, cob_id: int) -> bytes:
        rng, codec = self._rng, self._codecs[cob_id]
        if rng.random() < 0.1:
            return rng.randbytes(codec.pdo.length)
        raw = {}
        for signal in codec.pdo.signals:
            value = rng.randrange(-1000, 1000) if rng.random() < 0.9 else rng.randrange(-(2**15), 2**15)
            kind = signal.address.type
            raw[signal.name] = abs(value) if kind[0] == "u" else float(value) if kind == "f32" else value
            if signal.name == "status_word":
                raw[signal.name] = self.status
            elif kind == "u8":
                raw[signal.name] = 0
        try:
            return codec.pack(raw)
        except CodecError:
            return rng.randbytes(codec.pdo.length)


_STATUS = {State.DISABLED: 0b0001, State.HOLD: 0b0011, State.ACTIVE: 0b0111}


def frames(rng: random.Random, folder: Path) -> int:
    """Frames of cycles: never an exception, and whatever the valve is sent lies within the limit."""
    bus = _bus()
    faults = FaultLatch()
    received = Frames(bus, faults)
    clock = [1.0]
    receiver = Receiver(bus, received, faults, "virtual", rng.random() < 0.5, lambda: clock[0])
    supervision = Supervision(bus, receiver, received, faults)
    machine, measuring = StateMachine(bus.monitoring.state_change), Measuring(bus)
    codec, wire, sent, stamp = PdoCodec(bus.drive_pdo), _Wire(rng, bus), 0, 10**18
    supervision.begin(clock[0])
    machine.ask(State.DISABLED, clock[0])
    receiver.watching = faults.armed = rng.random() < 0.7
    for cycle in range(CYCLES):
        clock[0] += 0.002
        stamp += 2_000_000
        if cycle == CYCLES // 3 and not machine.problem:
            machine.ask(State.ACTIVE, clock[0])
        wire.status = rng.choice([*_STATUS.values(), rng.randrange(2**16)]) if rng.random() < 0.05 else wire.status
        if not machine.arrived and rng.random() < 0.8:
            wire.status = machine.control & 0xFF  # a valve that does what it is asked
        supervision.check(clock[0])
        if faults.text and not machine.problem:
            machine.fail(faults.text)
        wished = number(rng, 8.0)
        setpoint = measuring.allowed(wished) if machine.active and math.isfinite(wished) else 0.0
        frame, _ = codec.encode({"control_word": machine.control, "drive": setpoint})
        drive = codec.decode(frame)["drive"]
        must(math.isfinite(drive) and abs(drive) <= DRIVE_LIMIT_V * 1.0001, f"{drive} V on the wire")
        must(machine.active or drive == 0.0, f"{drive} V on the wire for a valve that is {machine.state.name}")
        received.begin(stamp)
        for message in rng.sample(messages := [*wire.true(), *(wire.strange() for _ in range(8))], len(messages)):
            sent += 1
            try:
                receiver.on_message_received(message)
            except struct.error as error:
                must(False, f"frame {message}: {error}")
        complete = received.wait(0.0)
        received.end()
        supervision.cycle(stamp, complete)
        if received.has(next(p.cob_id for _, p, s in bus.signals() if s.name == "status_word")):
            machine.advance(int(received.quantities()["status_word"]), clock[0])
        if complete:
            found = received.quantities()
            for fault, told in measuring.problems(received.sync_ns, found):
                faults.report(fault, told)
            sample = measuring.sample(stamp, drive, found)
            must(sample.drive == drive, "the sample holds another drive than was sent")
        supervision.report(clock[0])
    return sent
