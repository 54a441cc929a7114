"""Driver and virtual devices in lockstep: time is counted in SYNCs on both sides, however long each takes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from can_driver.rigs import Integrator

from hydraulic_can_driver import bench as bench_module
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.errors import BusDownError
from hydraulic_can_driver.faults import BusFault
from hydraulic_can_driver.virtual import Reading, VirtualBench
from hydraulic_can_driver.virtual.faults import HeartbeatStop, MissingPdo

BUS = replace(load_bus("bench"), interface="virtual", channel="lockstep")  # with the patience of a real bench
PERIOD = 1.0 / BUS.rate


class Dawdling(Integrator):
    """Takes `pause` [s of the wall] for the next of its steps."""

    def __init__(self) -> None:
        super().__init__()
        self.pause = 0.0
        self.steps = 0

    def step(self, drive: float, dt: float) -> Reading:
        """See `Integrator.step`."""
        time.sleep(self.pause)
        self.pause = 0.0
        self.steps += 1
        return super().step(drive, dt)


class Both:
    """Driver and devices; the driver drives with 1 V."""

    def __init__(self) -> None:
        self.plant = Dawdling()
        self._line = open_can(BUS.interface, BUS.channel)
        self.devices = VirtualBench(BUS, self._line, self.plant, lockstep=True)
        self.devices.start()
        self.bench = Bench(BUS, lockstep=True)
        self.bench.boot()
        self.bench.start()
        self.bench.follow(State.ACTIVE)
        while self.devices.drive < 0.9:
            self.cycle()

    def cycle(self, count: int = 1) -> list[float]:
        """Positions of the next cycles, each of which must give a sample."""
        found = []
        for _ in range(count):
            sample = self.bench.cycle(self.bench.beat.next_sync(), 1.0)
            assert sample is not None and not self.bench.problem, self.bench.problem
            found.append(sample.position)
        return found

    def close(self) -> None:
        """Whatever state it is in."""
        self.bench.close()
        self.devices.stop()
        self._line.shutdown()


@pytest.fixture
def both() -> Iterator[Both]:
    one = Both()
    yield one
    one.close()


def test_one_sync_is_one_period_however_long_it_takes(both: Both) -> None:
    steps, syncs, stamp = both.plant.steps, both.devices.syncs, both.bench.frames.sync_ns
    heard = dict(both.bench.receiver.heard)
    positions: list[float] = []
    for _ in range(4):
        both.plant.pause = 0.4  # longer than every watchdog of driver and devices
        positions += both.cycle(25)
        time.sleep(0.4)
    assert both.plant.steps - steps == both.devices.syncs - syncs == 100
    assert both.bench.frames.sync_ns - stamp == round(100 * PERIOD * 1e9)
    moves = [b - a for a, b in zip(positions, positions[1:], strict=False)]
    assert moves == pytest.approx([0.04 * PERIOD] * 99, abs=2e-6)  # 1 V, to the counts of drive and position
    # 100 periods of 2 ms are four heartbeats, by the same time.
    assert all(0.19 < both.bench.receiver.heard[name] - at < 0.21 for name, at in heard.items())
    assert both.devices.valve.machine.state.label == "active"


def test_faults_are_told_after_so_many_periods(both: Both) -> None:
    """Three heartbeats of 50 ms, in time of the devices."""
    both.devices.after(20 * PERIOD, lambda: both.devices.inject(HeartbeatStop("lvdt")))
    begun = both.bench.now()
    while not both.bench.problem:
        both.bench.cycle(both.bench.beat.next_sync(), 1.0)
    assert BusFault.HEARTBEAT in both.bench.faults and "lvdt" in both.bench.problem
    assert 0.1 < both.bench.now() - begun < 0.25


def test_a_device_that_does_not_answer_is_a_fault_at_once(both: Both, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_module, "_LOCKSTEP_S", 0.5)
    both.devices.inject(MissingPdo("pressure_b", 1))
    assert both.bench.cycle(both.bench.beat.next_sync(), 1.0) is None
    assert BusFault.FRAMES in both.bench.faults and "pressure_b" in both.bench.problem
    both.bench.cycle(both.bench.beat.next_sync(), 1.0)
    assert both.devices.drive == 0.0


def test_devices_of_a_real_bus_do_not_wait() -> None:
    with pytest.raises(BusDownError, match="lockstep on socketcan"):
        Bench(load_bus("bench"), lockstep=True)
