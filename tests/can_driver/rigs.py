"""The driver and virtual devices on a bus of their own, in this process."""

from __future__ import annotations

import contextlib
import itertools
import threading
import time
from dataclasses import replace
from typing import Any

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Address, Bus, SdoWrite
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.virtual import Reading, VirtualBench
from hydraulic_interfaces.errors import HydraulicError

_channels = itertools.count()


def patient_bus() -> Bus:
    """The shipped bus, with the patience that a loaded machine needs."""
    bus = load_bus("bench")
    monitoring = replace(bus.monitoring, sync_gap=5.0, missed_cycles=50, state_change=2.0, heartbeats=100)
    return replace(bus, interface="virtual", rate=200.0, monitoring=monitoring)


class Integrator:
    """A plant of one line: the piston moves at 0.04 m/s per volt."""

    def __init__(self) -> None:
        self.position = 0.0

    def step(self, drive: float, dt: float) -> Reading:
        """See `hydraulic_can_driver.virtual.Plant`."""
        now = Reading(self.position, 0.04 * drive, 7e6 + 1e5 * drive, 7e6 - 1e5 * drive, 14e6, drive / 10.0)
        self.position = min(max(self.position + 0.04 * drive * dt, -0.762), 0.762)
        return now


class Rig:
    """The driver and virtual devices on a bus of their own, in this process."""

    def __init__(self, bus: Bus) -> None:
        self.bus = replace(bus, channel=f"rig {next(_channels)}")
        self.plant = Integrator()
        self._line = open_can(self.bus.interface, self.bus.channel)
        self.devices = VirtualBench(self.bus, self._line, self.plant)
        self.devices.start()
        self.bench = Bench(self.bus)
        self.loop: Loop | None = None

    def run(self) -> Loop:
        """Boot, start, and cycle from now on."""
        self.bench.boot()
        return self._cycle()

    def again(self, boot: bool) -> Loop:
        """Stop, and run once more."""
        assert self.loop is not None
        self.loop.ending = True
        self.loop.join()
        with contextlib.suppress(HydraulicError):
            self.bench.stop()
        if boot:
            self.bench.boot()
        return self._cycle()

    def _cycle(self) -> Loop:
        self.bench.start()
        self.loop = Loop(self.bench)
        self.loop.start()
        self.loop.first.wait()
        return self.loop

    def enable(self, drive: float) -> None:
        """ACTIVE, with `drive` [V]."""
        self.bench.follow(State.ACTIVE)
        assert self.loop is not None
        self.loop.drive = drive

    def close(self) -> None:
        """Whatever state it is in."""
        if self.loop is not None:
            self.loop.ending = True
            self.loop.join()
        with contextlib.suppress(HydraulicError):
            self.bench.close()
        self.devices.stop()
        self._line.shutdown()


class Loop(threading.Thread):
    """Runs the cycles of a bench as the plant loop does; `drive` [V] may be changed."""

    def __init__(self, bench: Bench) -> None:
        super().__init__(daemon=True)
        self.bench, self.drive, self.ending = bench, 0.0, False
        self.samples: list[Any] = []
        self.first = threading.Event()
        self.hold = threading.Event()
        self.hold.set()

    def run(self) -> None:
        period = 1.0 / self.bench.bus.rate
        while not self.ending:
            sample = self.bench.cycle(time.time_ns(), self.drive)
            if sample is not None:
                self.samples.append(sample)
            self.first.set()
            self.hold.wait()
            time.sleep(period)

    def end(self) -> None:
        """Stop, as the plant loop does at its end."""
        self.ending = True
        self.join()
        self.bench.stop()


def rig_on(bus: Bus, lost_after: float, **monitoring: Any) -> Rig:
    """A rig whose valve has `lost_after` [s] of patience with its master; the others change the monitoring."""
    # 0x2201: the virtual valve's patience with missing SYNCs, ms
    boot = (*bus.valve.boot, SdoWrite(Address(0x2201, 0, "u16"), round(lost_after * 1e3)))
    valve = replace(bus.valve, boot=boot, receive=(replace(bus.drive_pdo, timeout=lost_after),))
    bus = replace(bus, nodes={**bus.nodes, "valve": valve}, master=replace(bus.master, lost_after=lost_after))
    return Rig(replace(bus, monitoring=replace(bus.monitoring, **monitoring)))
