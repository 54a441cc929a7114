"""The driver and virtual devices on a bus of their own, in this process, in lockstep.

Nothing in it depends on how busy the machine is: a frame is heard by the other side before `send` returns, one SYNC is
one period of both sides' time, and an answer that is not there then does not come.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import threading
import time
from dataclasses import replace
from typing import Any

import can
import canopen

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Address, Bus, SdoWrite
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.virtual import Reading, VirtualBench
from hydraulic_interfaces.errors import HydraulicError

NO_ANSWER_S = 0.02  # an answer is there when the question has been sent
PAUSE_S = 0.001  # between cycles, for the other threads

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


def connect_at_once(line: can.BusABC, network: canopen.Network) -> None:
    """Let frames for `line` be heard where they are sent, in the thread that sends them."""

    def hear(message: can.Message, block: bool = True, timeout: float | None = None) -> None:
        for listener in network.listeners:
            listener(message)

    line.queue.put = hear  # type: ignore[attr-defined]


class Rig:
    """The driver and virtual devices on a bus of their own, in this process."""

    def __init__(self, bus: Bus) -> None:
        self.bus = replace(bus, channel=f"rig {next(_channels)}")
        self.plant = Integrator()
        self._line = open_can(self.bus.interface, self.bus.channel)
        self.devices = VirtualBench(self.bus, self._line, self.plant, lockstep=True)
        self.devices.start()
        connect_at_once(self._line, self.devices.network)
        self.bench = self.driver()
        self.loop: Loop | None = None

    def driver(self) -> Bench:
        """A driver on the bus, not yet booted."""
        bench = Bench(self.bus, lockstep=True)
        connect_at_once(bench.master.can, bench.master._network)
        bench.master._patience(NO_ANSWER_S, 1)
        bench.master._patience = lambda *_: None  # type: ignore[method-assign]
        wait = bench.frames.wait
        bench.frames.wait = lambda until: wait(0.0)  # type: ignore[method-assign]
        return bench

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

    def idle(self, seconds: float) -> None:
        """Let time pass for the devices without a SYNC, as after the end of a driver."""
        devices = self.devices
        with devices._lock:
            for _ in range(math.ceil(seconds * self.bus.rate)):
                devices._clock.sync(0.0)
                devices._period()
                devices._watch()
                devices._settle()

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
        while not self.ending:
            sample = self.bench.cycle(self.bench.beat.next_sync(), self.drive)
            if sample is not None:
                self.samples.append(sample)
            self.first.set()
            self.hold.wait()
            time.sleep(PAUSE_S)

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
