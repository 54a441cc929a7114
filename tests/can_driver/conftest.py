"""A scripted far end of the bus for the shipped bus file, and benches on it.

The script logs every frame, answers SDO from a table and sends what it is told. No part of the driver is used in it, so
that what the driver puts on the wire is compared with bytes written by hand.
"""

from __future__ import annotations

import itertools
import struct
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import can
import pytest
from can_driver.rigs import Loop, Rig, patient_bus, rig_on

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Bus

_channels = itertools.count()


SYNC = 0x80
Frame = tuple[int, bytes]


class Wire:
    """Devices of the shipped bus file `bench`, as far as bytes go.

    `objects[(node, index, sub)]` are the bytes of an object; `answers[cob_id]` what is sent after each SYNC. While
    `follows`, the valve does what the control word says and the nodes tell their NMT state in a heartbeat.
    """

    def __init__(self, channel: str) -> None:
        self.channel = channel
        self.bus = can.Bus(interface="virtual", channel=channel)
        self.log: list[Frame] = []
        self.objects: dict[tuple[int, int, int], bytes] = {}
        self.aborts: dict[tuple[int, int, int], int] = {}
        self.mute: set[int] = set()
        self.answers: dict[int, bytes] = {}
        self.on_sync: Callable[[], None] = lambda: None
        self.follows = True
        self.control = 0
        self._pending = b""
        self._lock = threading.Lock()
        self._notifier = can.Notifier(self.bus, [self._take], 0.05)

    def send(self, cob_id: int, data: bytes) -> None:
        """Put a frame on the bus."""
        self.bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def sent(self, *cob_ids: int) -> list[Frame]:
        """Frames of the driver with these identifiers so far."""
        return [frame for frame in list(self.log) if frame[0] in cob_ids]

    def close(self) -> None:
        self._notifier.stop()
        self.bus.shutdown()

    def _take(self, message: can.Message) -> None:
        cob_id, data = message.arbitration_id, bytes(message.data)
        self.log.append((cob_id, data))
        node = cob_id & 0x7F
        if cob_id & 0x780 == 0x600 and node not in self.mute:
            self._sdo(node, data)
        elif cob_id == 0x510:
            self._pending = data
        elif cob_id == 0 and self.follows and data[1] not in self.mute:
            self.send(0x700 + data[1], bytes([{1: 5, 128: 127, 2: 4}[data[0]]]))
        elif cob_id == SYNC:
            self._sync()

    def _sync(self) -> None:
        if self._pending and self.follows:
            self.control = self._pending[0]
            status = {0: 0x08, 1: 0x09, 3: 0x0B, 7: 0x0F}.get(self.control & 7, 0x08)
            self.answers[0x490] = bytes([status, 0]) + self._pending[2:4]
        self.on_sync()
        for cob_id, data in list(self.answers.items()):
            if cob_id & 0x7F not in self.mute:
                self.send(cob_id, data)

    def _sdo(self, node: int, request: bytes) -> None:
        """Expedited SDO (CiA 301, 7.2.4.3)."""
        key = (node, int.from_bytes(request[1:3], "little"), request[3])
        if request[0] == 0x80:
            return
        if key in self.aborts or key not in self.objects:
            code = self.aborts.get(key, 0x06020000)
            self.send(0x580 + node, b"\x80" + request[1:4] + code.to_bytes(4, "little"))
        elif request[0] == 0x40:
            value = self.objects[key]
            self.send(0x580 + node, bytes([0x43 | (4 - len(value)) << 2]) + request[1:4] + value.ljust(4, b"\0"))
        else:
            size = 4 - (request[0] >> 2 & 3)
            self.objects[key] = request[4 : 4 + size]
            self.send(0x580 + node, b"\x60" + request[1:4] + bytes(4))


NODES = {0x10: 408, 0x20: 406, 0x30: 404, 0x31: 404, 0x32: 404}


def fill(wire: Wire) -> None:
    """Objects and frames of healthy devices that stand in mid-stroke at 7, 7 and 14 MPa."""
    for node, profile in NODES.items():
        wire.objects |= {
            (node, 0x1000, 0): struct.pack("<I", profile),
            (node, 0x1001, 0): b"\0",
            (node, 0x1016, 1): bytes(4),
            (node, 0x1017, 0): bytes(2),
            (node, 0x1018, 1): struct.pack("<I", 0x28),
        }
    for node in NODES:
        number = 3 if node == 0x10 else 0
        wire.objects |= {(node, 0x1800 + number, 1): bytes(4), (node, 0x1800 + number, 2): b"\xff"}
        wire.objects |= {(node, 0x1A00 + number, sub): bytes(4 if sub else 1) for sub in range(4)}
    wire.objects |= {(0x10, 0x1403, 1): bytes(4), (0x10, 0x1403, 2): b"\xff", (0x10, 0x1403, 5): bytes(2)}
    wire.objects |= {(0x10, 0x1603, sub): bytes(4 if sub else 1) for sub in range(4)}
    for index, sub, size in (
        [(0x6040, 0, 2), (0x6300, 1, 2), (0x6042, 0, 1), (0x6043, 0, 1), (0x6322, 1, 2), (0x6324, 1, 2), (0x6330, 0, 1)]
        + [(0x6331, 1, 2), (0x6334, 1, 2), (0x6340, 0, 1), (0x6341, 1, 2), (0x6342, 0, 1), (0x6343, 1, 2)]
        + [(0x6344, 1, 2), (0x6345, 1, 2), (0x6346, 0, 1), (0x6351, 0, 1)]
    ):
        wire.objects[(0x10, index, sub)] = bytes(size)
    full = struct.pack("<h", 16384)
    wire.objects |= {(0x10, 0x6322, 1): full, (0x10, 0x6341, 1): full, (0x10, 0x6320, 1): full}
    wire.objects[(0x10, 0x6041, 0)] = b"\x08\0"
    wire.objects[(0x10, 0x6321, 1)] = struct.pack("<h", -16384)
    for index, sub, size in ((0x6005, 1, 4), (0x6401, 1, 4), (0x6402, 1, 4), (0x6503, 0, 2), (0x6505, 0, 2)):
        wire.objects[(0x20, index, sub)] = bytes(size)
    for node in (0x30, 0x31, 0x32):
        wire.objects |= {(node, 0x6131, 1): bytes(4), (node, 0x6132, 1): b"\0"}
    wire.answers = {
        0x490: bytes([0x08, 0, 0, 0]),
        0x1A0: struct.pack("<ihB", 762_000, 0, 0),
        0x1B0: struct.pack("<hB", 7000, 0),
        0x1B1: struct.pack("<hB", 7000, 0),
        0x1B2: struct.pack("<hB", 14000, 0),
    }


@pytest.fixture
def patient() -> Bus:
    """See `patient_bus`."""
    return patient_bus()


@pytest.fixture
def wire() -> Iterator[Wire]:
    """A scripted far end on a bus of its own: `wire.channel`."""
    one = Wire(f"test {next(_channels)}")
    fill(one)
    yield one
    one.close()


@pytest.fixture
def bench(patient: Bus, wire: Wire) -> Iterator[Bench]:
    """The driver on that bus, not yet booted."""
    one = Bench(replace(patient, channel=wire.channel))
    yield one
    one.close()


@pytest.fixture
def rig(patient: Bus) -> Iterator[Callable[..., Rig]]:
    """`rig(lost_after, missed_cycles=5, ...)`: driver and virtual devices.

    `lost_after` [s] is the valve's patience with its master; the others change the monitoring of the patient bus.
    """
    rigs: list[Rig] = []

    def build(lost_after: float = 20.0, **monitoring: Any) -> Rig:
        rigs.append(rig_on(patient, lost_after, **monitoring))
        return rigs[-1]

    yield build
    for one in rigs:
        one.close()


@pytest.fixture
def loop_of() -> Iterator[Callable[[Bench], Loop]]:
    """`loop_of(bench)`: cycles of a started bench, in a thread; ended at the end of the test."""
    loops: list[Loop] = []

    def start(bench: Bench) -> Loop:
        loops.append(Loop(bench))
        loops[-1].start()
        return loops[-1]

    yield start
    for loop in loops:
        loop.ending = True
        loop.join()
