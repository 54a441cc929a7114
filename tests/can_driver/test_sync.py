"""The beat: drive before SYNC, on the instant; and in step with SYNCs that somebody else (the kernel) sends."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from hydraulic_can_driver import bench as bench_module
from hydraulic_can_driver import sync
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.faults import FaultLatch
from hydraulic_can_driver.frames import Frames
from hydraulic_can_driver.nodes.can_driver import CanPlant
from hydraulic_can_driver.sync import KernelBeat, LockstepBeat
from hydraulic_interfaces.samples import Command, PlantSample
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.plant_loop import LoopTiming, PlantLoop

RATE = 50.0
PERIOD = round(1e9 / RATE)
DELAY = 0.01 / RATE  # of the kernel's timer, s


class Ports:
    """Commands 1 V in every cycle and keeps the samples."""

    def __init__(self) -> None:
        self.samples: list[PlantSample] = []

    def take_commands(self, gate: CommandGate, now_ns: int) -> None:
        gate.accept(Command(now_ns, "test", 1.0), now_ns)

    def publish(self, sample: PlantSample) -> None:
        self.samples.append(sample)

    def publish_clock(self, stamp_ns: int) -> None: ...


class Kernel:
    """Stands for the broadcast manager: the far end sends the SYNCs, and the driver hears them.

    As Linux does it, each period begins when the message before has been sent, `delay` [s] late. The messages whose
    numbers are in `missed` are not sent.
    """

    def __init__(self, wire: Any, delay: float = 0.0) -> None:
        self._wire, self._delay = wire, delay
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.period = 1.0 / RATE
        self.sent = 0
        self.missed: set[int] = set()

    def send_periodic(self, message: Any, period: float) -> Kernel:
        assert message.arbitration_id == 0x80 and len(message.data) == 0 and period == 1.0 / RATE
        self._thread.start()
        return self

    def set_period(self, task: Any, period_ns: int) -> bool:
        assert task is self and abs(period_ns - PERIOD) <= 0.25 * PERIOD
        self.period = period_ns * 1e-9
        return True

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopped.wait(max(due - time.monotonic(), 0.0)):
            self.sent += 1
            if self.sent not in self.missed:
                self._wire.send(0x80, b"")
                self._wire.log.append((0x80, b""))
                self._wire._sync()
            due = max(due, time.monotonic() - self.period) + self._delay + self.period


@pytest.fixture
def kernel(wire: Any, monkeypatch: pytest.MonkeyPatch) -> Kernel:
    one = Kernel(wire, delay=DELAY)
    monkeypatch.setattr(sync, "set_period", one.set_period)
    return one


@pytest.fixture
def kernel_bench(patient: Bus, wire: Any, kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(bench_module, "KERNEL_SYNC", ("virtual",))
    quiet = replace(patient.monitoring, heartbeats=10_000)  # the script sends none
    one = Bench(replace(patient, channel=wire.channel, rate=RATE, monitoring=quiet))
    one.master.can.send_periodic = kernel.send_periodic  # type: ignore[method-assign]
    yield one
    one.close()


@pytest.fixture
def running(kernel_bench: Bench, wait_until: Any) -> Iterator[tuple[PlantLoop, Ports]]:
    """A loop that drives with 1 V."""
    kernel_bench.boot()
    kernel_bench.start()
    plant, ports, gate = CanPlant(), Ports(), CommandGate(watchdog=5.0)
    plant._bench = kernel_bench
    gate.enable(True)
    plant.set_enabled(True)
    loop = PlantLoop(plant, gate, ports, LoopTiming(PERIOD))
    loop.start()
    wait_until(lambda: kernel_bench.problem or ports.samples and ports.samples[-1].drive > 0.9, "1 V")
    assert not kernel_bench.problem
    yield loop, ports
    loop.stop()


def off_phase(nanoseconds: int) -> float:
    """Distance from the nearest whole number of periods, as a share of the period."""
    return abs((nanoseconds + PERIOD // 2) % PERIOD - PERIOD // 2) / PERIOD


def test_in_lockstep_the_loop_goes_on_after_the_last_sync_however_far_that_is_ahead() -> None:
    """Cycles before the loop are as fast as the devices answer; time must not go back when it begins."""

    class Line:
        def send(self, cob_id: int, data: bytes) -> None: ...

    frames = Frames(load_bus("bench"), FaultLatch())
    beat = LockstepBeat(Line(), frames, PERIOD)  # type: ignore[arg-type]
    for _ in range(1000):
        assert beat.exchange(0x510, b"", beat.next_sync())
    now = time.monotonic_ns()
    first = beat.first_instant(now + PERIOD)
    assert first - now + time.time_ns() > frames.sync_ns
    assert first - now == pytest.approx(1000 * PERIOD, rel=0.1)
    assert beat.first_instant(first + 10 * PERIOD) == first + 10 * PERIOD


@pytest.mark.timing
def test_in_step_with_the_kernel(
    kernel_bench: Bench, kernel: Kernel, wire: Any, running: tuple[PlantLoop, Ports], wait_until: Any
) -> None:
    """Also where each period of the kernel is longer than it should be, for which it would drift by one in 100."""
    bench, (loop, ports) = kernel_bench, running
    assert isinstance(bench.beat, KernelBeat)
    count = len(ports.samples)
    wait_until(lambda: len(ports.samples) > count + 120, "120 samples")
    assert off_phase(bench.frames.sync_ns - ports.samples[-1].stamp_ns) < 0.25
    assert loop.stop()
    assert loop.error is None and not bench.faults.log
    stamps = [s.stamp_ns for s in ports.samples]
    assert all((stamp - stamps[0]) % PERIOD == 0 for stamp in stamps)
    order = [cob_id for cob_id, _ in wire.log if cob_id in (0x80, 0x510)]
    between = [n for n, cob_id in enumerate(order) if cob_id == 0x80]
    paired = sum(order[n - 1] == 0x510 for n in between if n > 0)
    assert paired > 0.8 * len(ports.samples), "a drive before the SYNC of (nearly) every sample"
    assert wire.sent(0x510)[-1][1] == bytes(4), "0 V at the end"


@pytest.mark.timing
def test_a_missed_sync_concerns_its_own_cycle_only(
    kernel_bench: Bench, kernel: Kernel, running: tuple[PlantLoop, Ports], wait_until: Any
) -> None:
    loop, ports = running
    for _ in range(5):
        lost, count = loop.lost, len(ports.samples)
        kernel.missed.add(kernel.sent + 2)
        wait_until(lambda lost=lost: loop.lost > lost, "a cycle without SYNC")
        wait_until(lambda count=count: len(ports.samples) > count + 20, "the cycles after it")
    wait_until(lambda: ports.samples[-1].drive > 0.9, "1 V")
    assert not kernel_bench.faults.log


def test_the_phase_is_not_taken_from_a_sync_that_was_late(kernel_bench: Bench) -> None:
    beat, frames = kernel_bench.beat, kernel_bench.frames
    assert isinstance(beat, KernelBeat)
    origin = time.monotonic_ns()
    for number, late in enumerate((0, 0.3, 0, 0, 0.4, 0, 0, 0.4)):
        frames.begin(time.time_ns() - time.monotonic_ns() + origin + round((number + late) * PERIOD))
        beat._heard.append(frames.instant_ns)
    first = beat.first_instant(origin + 10 * PERIOD)
    assert off_phase(first + beat.lead_ns - origin) < 0.01


def test_no_kernel_no_frames(kernel_bench: Bench, wire: Any) -> None:
    bench = kernel_bench
    bench.boot()

    class Dead:
        def stop(self) -> None: ...

    bench.master.can.send_periodic = lambda *_: Dead()  # type: ignore[assignment, return-value]
    object.__setattr__(bench.bus.monitoring, "state_change", 0.1)
    with pytest.raises(bench_module.DeviceError, match="no frames from|no heartbeat"):
        bench.start()


@pytest.mark.timing
def test_the_loop_sends_the_drive_before_its_sync_and_that_on_its_instant(bench: Bench, wire: Any) -> None:
    bench.boot()
    bench.start()
    wire.log.clear()
    medians: list[float] = []
    while len(medians) < 10 and min(medians, default=1.0) > 0.2:  # other programs may take the processor for a while
        off: list[float] = []
        for _ in range(40):
            due = time.time_ns() + bench.beat.lead_ns
            bench.cycle(due, 0.0)
            off.append(abs(bench.frames.sync_ns - due) * 1e-6)
        medians.append(sorted(off)[20])
    order = [cob_id for cob_id, _ in wire.log if cob_id in (0x80, 0x510)]
    assert order == [0x510, 0x80] * 40 * len(medians)
    assert medians[-1] < 0.2, "ms"
