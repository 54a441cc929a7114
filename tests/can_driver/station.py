"""A raw station on the bus of virtual devices: frames out as written by hand, frames in as bytes. No driver in it."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from typing import Any

import can

from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.virtual import Reading, VirtualBench

SYNC, NMT = 0x80, 0x000
VALVE, LVDT, PRESSURE_A = 0x10, 0x20, 0x30
DRIVE, STATUS, POSITION, PRESSURE = 0x510, 0x490, 0x1A0, 0x1B0
PATIENCE_S = 150.0

_channels = itertools.count()


class StillPlant:
    """Stands where it is put; remembers what it was told. The spool is where it should be."""

    def __init__(self, **reading: float) -> None:
        self.reading = {"position": 0.1, "velocity": 0.0, "pressure_a": 7e6, "pressure_b": 6e6, "pressure_supply": 14e6}
        self.reading |= reading
        self.drives: list[float] = []

    def step(self, drive: float, dt: float) -> Reading:
        self.drives.append(drive)
        return Reading(**{"spool": drive / 10.0, **self.reading})


class Station:
    """Virtual devices of a bus, and a raw bus that talks to them. A context manager."""

    def __init__(self, bus: Bus | None = None, plant: Any = None) -> None:
        channel = f"station_{next(_channels)}"
        self.plant = plant or StillPlant()
        self._raw = can.Bus(interface="virtual", channel=channel)
        self._line = can.Bus(interface="virtual", channel=channel)
        # At 10 Hz the plant stands still between two SYNCs of a test.
        self.bench = VirtualBench(bus or replace(load_bus("bench"), rate=10.0), self._line, self.plant)

    def __enter__(self) -> Station:
        self.bench.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.bench.stop()
        self._line.shutdown()
        self._raw.shutdown()

    def send(self, cob_id: int, data: str = "") -> None:
        """Put a frame on the bus; bytes in hexadecimal digits."""
        self._raw.send(can.Message(arbitration_id=cob_id, data=bytes.fromhex(data), is_extended_id=False))

    def frames(self, *cob_ids: int, count: int = 1, patience: float = PATIENCE_S) -> list[str]:
        """The next frames with these identifiers, as hexadecimal digits; others are dropped."""
        found: list[str] = []
        end = time.monotonic() + patience
        while len(found) < count and (rest := end - time.monotonic()) > 0.0:
            frame = self._raw.recv(rest)
            if frame is not None and not frame.is_error_frame and frame.arbitration_id in cob_ids:
                found.append(frame.data.hex())
        return found

    def frame(self, cob_id: int) -> str:
        """The next frame with this identifier."""
        (found,) = self.frames(cob_id) or ("nothing came",)
        return found

    def drain(self) -> list[tuple[int, str]]:
        """Every frame that is waiting."""
        found = []
        while (frame := self._raw.recv(0.0)) is not None:
            found.append((frame.arbitration_id, frame.data.hex()))
        return found

    def sdo(self, node: int, request: str) -> str:
        """Answer to an SDO request."""
        self.drain()
        self.send(0x600 + node, request.replace(" ", "").ljust(16, "0"))
        return self.frame(0x580 + node)

    def start(self, node: int = 0) -> None:
        """NMT: start remote node."""
        self.send(NMT, f"01{node:02x}")

    def sync(self, expect: int = STATUS) -> str:
        """Send a SYNC; the frame that answers it."""
        self.drain()
        self.send(SYNC)
        return self.frame(expect)

    def command(self, word: int, setpoint: int = 0, pressure: int = 0) -> str:
        """Control word and set-point, taken over at a SYNC; the status frame after it."""
        self.order(word, setpoint, pressure)
        return self.sync()

    def order(self, word: int, setpoint: int = 0, pressure: int = 0) -> None:
        """Control word and set-point alone: what comes after it is not read."""
        data = word.to_bytes(2, "little") + setpoint.to_bytes(2, "little", signed=True) + pressure.to_bytes(2, "little")
        self.send(DRIVE, data.hex())

    def activate(self) -> None:
        """Start all nodes and lead the valve to ACTIVE."""
        self.start()
        assert self.command(7)[:2] == "0f"
