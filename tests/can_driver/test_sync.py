"""The beat: drive before SYNC, on the instant; and in step with SYNCs that somebody else (the kernel) sends."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from hydraulic_can_driver import bench as bench_module
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.nodes.can_driver import CanPlant
from hydraulic_can_driver.sync import KernelBeat
from hydraulic_interfaces.command_gate import CommandGate
from hydraulic_interfaces.plant_loop import LoopTiming, PlantLoop
from hydraulic_interfaces.samples import Command, PlantSample

RATE = 50.0
PERIOD = round(1e9 / RATE)


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
    """Stands for the broadcast manager: the far end sends the SYNCs, and the driver hears them."""

    def __init__(self, wire: Any) -> None:
        self._wire = wire
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def send_periodic(self, message: Any, period: float) -> Kernel:
        assert message.arbitration_id == 0x80 and len(message.data) == 0 and period == 1.0 / RATE
        self._thread.start()
        return self

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopped.wait(max(due - time.monotonic(), 0.0)):
            self._wire.send(0x80, b"")
            self._wire.log.append((0x80, b""))
            self._wire._sync()
            due += 1.0 / RATE * max(math.ceil((time.monotonic() - due) * RATE), 1)  # what was missed is left out


@pytest.fixture
def kernel_bench(patient: Bus, wire: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(bench_module, "KERNEL_SYNC", ("virtual",))
    one = Bench(replace(patient, channel=wire.channel, rate=RATE))
    one.master.can.send_periodic = Kernel(wire).send_periodic  # type: ignore[method-assign]
    yield one
    one.close()


def test_in_step_with_the_kernel(kernel_bench: Bench, wire: Any, wait_until: Any) -> None:
    bench = kernel_bench
    assert isinstance(bench.beat, KernelBeat)
    bench.boot()
    bench.start()
    plant, ports, gate = CanPlant(), Ports(), CommandGate(watchdog=5.0)
    plant._bench = bench
    gate.enable(True)
    plant.set_enabled(True)
    loop = PlantLoop(plant, gate, ports, LoopTiming(PERIOD))
    loop.start()
    try:
        wait_until(lambda: ports.samples and ports.samples[-1].drive > 0.9, "1 V")
        count = len(ports.samples)
        wait_until(lambda: len(ports.samples) > count + 50, "50 samples")
    finally:
        assert loop.stop()
    assert loop.error is None
    stamps = [s.stamp_ns for s in ports.samples]
    assert all((stamp - stamps[0]) % PERIOD == 0 for stamp in stamps)
    # Each stamp is that of a SYNC as it was heard, but for the jitter of this machine.
    assert abs(bench.frames.sync_ns - stamps[-1]) % PERIOD < PERIOD // 2
    order = [cob_id for cob_id, _ in wire.log if cob_id in (0x80, 0x510)]
    between = [n for n, cob_id in enumerate(order) if cob_id == 0x80]
    alone = sum(b - a == 1 for a, b in zip(between, between[1:], strict=False))
    assert alone < 0.2 * len(between), "a drive before (nearly) every SYNC"
    assert not [1 for _, data in wire.sent(0x510)[-1:] if data != bytes(4)], "0 V at the end"


def test_no_kernel_no_frames(kernel_bench: Bench, wire: Any) -> None:
    bench = kernel_bench
    bench.boot()

    class Dead:
        def stop(self) -> None: ...

    bench.master.can.send_periodic = lambda *_: Dead()  # type: ignore[assignment, return-value]
    object.__setattr__(bench.bus.monitoring, "state_change", 0.1)
    with pytest.raises(bench_module.DeviceError, match="no frames from|no heartbeat"):
        bench.start()


def test_the_loop_sends_the_drive_before_its_sync_and_that_on_its_instant(bench: Bench, wire: Any) -> None:
    bench.boot()
    bench.start()
    wire.log.clear()
    off: list[float] = []
    for _ in range(40):
        due = time.time_ns() + bench.beat.lead_ns
        bench.cycle(due, 0.0)
        off.append(abs(bench.frames.sync_ns - due) * 1e-6)
    order = [cob_id for cob_id, _ in wire.log if cob_id in (0x80, 0x510)]
    assert order == [0x510, 0x80] * 40
    assert sorted(off)[20] < 0.2, "ms; half of them, on whatever machine"
