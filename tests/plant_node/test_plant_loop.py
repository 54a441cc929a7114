"""The plant loop without ROS: a scripted backend, ports that collect."""

from __future__ import annotations

import gc
import os
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from hydraulic_interfaces.samples import Command, PlantSample
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.plant_backend import PlantBackend
from hydraulic_plant_node.plant_loop import LoopTiming, PlantLoop

PERIOD = 1_000_000


class Scripted(PlantBackend):
    """Calls `script(k)` at step k."""

    def __init__(self, script: Callable[[int], None] = lambda k: None, catch_up: int = 0) -> None:
        self.catch_up = catch_up
        self.script = script
        self.drives: list[float] = []
        self.calls: list[str] = []

    def configure(self, values: Mapping[str, Any]) -> list[ParameterSpec]:
        return []

    def activate(self) -> None:
        self.calls.append("activate")

    def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample:
        assert dt == pytest.approx(1e-3)
        self.script(len(self.drives))
        self.drives.append(drive)
        return PlantSample(stamp_ns, 0.0, drive=drive)

    def deactivate(self) -> None:
        self.calls.append("deactivate")


class Ports:
    """Keeps the samples; commands 1 V in every cycle."""

    def __init__(self) -> None:
        self.samples: list[PlantSample] = []
        self.clock: list[int] = []
        self.times: list[float] = []

    def take_commands(self, gate: CommandGate, now_ns: int) -> None:
        gate.accept(Command(now_ns, "test", 1.0), now_ns)

    def publish(self, sample: PlantSample) -> None:
        self.samples.append(sample)
        self.times.append(time.monotonic())

    def publish_clock(self, stamp_ns: int) -> None:
        self.clock.append(stamp_ns)


def run(backend: Scripted, count: int, wait_until: Any, **timing: Any) -> tuple[PlantLoop, Ports]:
    gate, ports = CommandGate(watchdog=5.0), Ports()
    gate.enable(True)
    loop = PlantLoop(backend, gate, ports, LoopTiming(PERIOD, **timing))
    loop.start()
    try:
        wait_until(lambda: len(ports.samples) >= count or not loop.alive, f"{count} samples")
    finally:
        assert loop.stop()
    return loop, ports


def test_stamps_lie_on_the_grid_and_the_end_is_at_zero(wait_until: Any) -> None:
    backend = Scripted(catch_up=10_000)
    loop, ports = run(backend, 200, wait_until)
    stamps = [s.stamp_ns for s in ports.samples]
    assert {b - a for a, b in zip(stamps, stamps[1:], strict=False)} == {PERIOD}
    assert backend.drives[-1] == 0.0 and set(backend.drives[:-1]) == {1.0}
    assert backend.calls == ["deactivate"]
    assert loop.error is None and loop.drive == 0.0 and loop.last_stamp_ns == stamps[-1]
    assert gc.isenabled()


def test_processors_are_kept_awake_only_while_a_loop_with_priority_runs(wait_until: Any) -> None:
    place = "/dev/cpu_dma_latency"
    if not os.access(place, os.W_OK):
        pytest.skip(f"{place} may not be written")

    def awake() -> bool:
        files = [f"/proc/self/fd/{name}" for name in os.listdir("/proc/self/fd")]
        return any(os.path.realpath(file) == place for file in files)

    for priority in (0, 20):
        seen: list[bool] = []
        run(Scripted(lambda k, seen=seen: seen.append(awake())), 3, wait_until, priority=priority)  # type: ignore[misc]
        assert set(seen) == {priority > 0}
        assert not awake()


def test_a_run_begins_without_the_drive_that_the_last_one_ended_with(wait_until: Any) -> None:
    class Silent(Ports):
        def take_commands(self, gate: CommandGate, now_ns: int) -> None:
            return

    gate, ports, backend = CommandGate(watchdog=5.0), Silent(), Scripted()
    gate.enable(True)
    now = time.time_ns()
    assert gate.accept(Command(now, "test", 1.0), now).obeyed
    loop = PlantLoop(backend, gate, ports, LoopTiming(PERIOD))
    loop.start()
    try:
        wait_until(lambda: len(ports.samples) >= 5, "five samples")
    finally:
        assert loop.stop()
    assert set(backend.drives) == {0.0}


def test_a_stall_is_made_up_for_by_a_plant_that_can(wait_until: Any) -> None:
    loop, ports = run(Scripted(lambda k: time.sleep(0.02 if k == 50 else 0), 10_000), 200, wait_until)
    stamps = [s.stamp_ns for s in ports.samples]
    assert {b - a for a, b in zip(stamps, stamps[1:], strict=False)} == {PERIOD}
    report = loop.monitor.report()
    assert report.overruns >= 1 and report.skipped == 0


def test_a_stall_is_skipped_and_counted_by_a_plant_that_cannot(wait_until: Any) -> None:
    loop, ports = run(Scripted(lambda k: time.sleep(0.02 if k == 50 else 0)), 200, wait_until)
    stamps = [s.stamp_ns for s in ports.samples]
    missing = sum((b - a) // PERIOD - 1 for a, b in zip(stamps, stamps[1:], strict=False))
    # Instants skipped before the first sample are counted as well, but leave no gap between two samples.
    assert loop.monitor.report().skipped >= missing >= 18
    assert all((s - stamps[0]) % PERIOD == 0 for s in stamps)


@pytest.mark.timing
def test_a_cycle_that_begins_too_late_is_left_out(wait_until: Any) -> None:
    """With a share of one half, no step begins more than half a period after its instant."""
    late: list[float] = []

    class Punctual(Scripted):
        tolerated_lateness = 0.5

        def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample:
            late.append((time.time_ns() - stamp_ns) / PERIOD)
            return super().step(stamp_ns, drive, dt)

    # A stall of 0.7 periods beyond its own: the step after it is left out, not begun late.
    loop, ports = run(Punctual(lambda k: time.sleep(0.0017) if k % 20 == 10 else None), 200, wait_until)
    assert loop.monitor.report().skipped >= 9
    stamps = [s.stamp_ns for s in ports.samples]
    assert all((s - stamps[0]) % PERIOD == 0 for s in stamps)
    # What lies between the decision and the step (this machine may be taken away in between) is the only exception.
    assert sorted(late)[int(0.9 * len(late))] < 0.6


def test_a_cycle_without_a_sample_is_counted_and_publishes_nothing(wait_until: Any) -> None:
    class Gappy(Scripted):
        def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample | None:  # type: ignore[override]
            sample = super().step(stamp_ns, drive, dt)
            return None if len(self.drives) % 10 == 5 else sample

    loop, ports = run(Gappy(catch_up=10_000), 200, wait_until)
    steps = {b.stamp_ns - a.stamp_ns for a, b in zip(ports.samples, ports.samples[1:], strict=False)}
    assert steps == {PERIOD, 2 * PERIOD}
    assert loop.lost == len(ports.samples + [None] * loop.lost) - loop.samples
    assert 20 <= loop.lost <= loop.samples / 8


@pytest.mark.timing
def test_a_plant_with_a_beat_of_its_own_says_when_to_begin(wait_until: Any) -> None:
    class Beating(Scripted):
        first = 0

        def first_instant(self, earliest_ns: int) -> int:
            self.first = earliest_ns + 50 * PERIOD + 123_456
            return self.first

    backend = Beating(catch_up=10_000)
    _, ports = run(backend, 20, wait_until)
    offset = time.time_ns() - time.monotonic_ns()
    assert abs(ports.samples[0].stamp_ns - offset - backend.first) < 10 * PERIOD


def test_a_backend_that_fails_ends_at_zero_volts_with_its_error(wait_until: Any) -> None:
    def burst(k: int) -> None:
        if k == 20:
            raise ArithmeticError("burst")

    backend = Scripted(burst)
    loop, _ = run(backend, 10_000, wait_until)
    assert isinstance(loop.error, ArithmeticError)
    assert backend.calls == ["deactivate"]
    assert loop.drive == 0.0 and not loop.alive


def test_a_fault_of_the_plant_latches_zero_volts(wait_until: Any) -> None:
    backend = Scripted()

    def fault(k: int) -> None:
        backend.fault = "cable break" if k == 20 else ""

    backend.script = fault
    run(backend, 100, wait_until)
    assert set(backend.drives[:21]) == {1.0} and set(backend.drives[21:]) == {0.0}


def test_a_backend_that_hangs_is_noticed() -> None:
    release = threading.Event()
    backend = Scripted(lambda k: release.wait() and None)
    loop = PlantLoop(backend, CommandGate(), Ports(), LoopTiming(PERIOD))
    loop.start()
    assert not loop.stop(timeout=0.2)
    release.set()


def test_own_clock_runs_faster_than_the_wall_and_never_skips(wait_until: Any) -> None:
    loop, ports = run(
        Scripted(lambda k: time.sleep(0.1 if k == 50 else 0)), 1000, wait_until, factor=5.0, own_clock=True
    )
    stamps = [s.stamp_ns for s in ports.samples]
    assert {b - a for a, b in zip(stamps, stamps[1:], strict=False)} == {PERIOD}
    assert loop.monitor.report().skipped == 0
    assert ports.clock == sorted(ports.clock)
    # The factor is kept but for the stall: 1 s of the plant in 0.2 s and what the stall and this machine took.
    assert ports.times[-1] - ports.times[0] >= 0.9 * 0.2


def test_stamps_go_on_from_the_last_run(wait_until: Any) -> None:
    gate, ports = CommandGate(), Ports()
    future = time.time_ns() + 3600 * 10**9
    # A thread that begins late makes up for it: else the instants that it has missed would be left out first.
    loop = PlantLoop(Scripted(catch_up=10_000), gate, ports, LoopTiming(PERIOD), last_stamp_ns=future)
    loop.start()
    try:
        wait_until(lambda: ports.samples, "a sample")
    finally:
        assert loop.stop()
    assert ports.samples[0].stamp_ns == future + PERIOD


def test_a_factor_needs_the_clock() -> None:
    with pytest.raises(ValueError, match="real_time_factor is 2"):
        LoopTiming(PERIOD, factor=2.0)
