"""Plant time that waits: for the answer to each sample, for recorders, and for nobody else."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from plant_node.test_plant_loop import PERIOD, Scripted

from hydraulic_interfaces.samples import Command, PlantSample
from hydraulic_plant_node import lockstep
from hydraulic_plant_node.command_gate import CommandGate, Verdict
from hydraulic_plant_node.plant_loop import LoopTiming, PlantLoop


class Far:
    """Ports with somebody at the other end, in a thread of their own, who does `answer(sample)` to each sample."""

    def __init__(self, answer: Callable[[PlantSample], float | None]) -> None:
        self.answer = answer
        self.samples: list[PlantSample] = []
        self.commands: list[Command] = []
        self.present, self.recorded = True, lambda: None
        self.clock: list[int] = []
        self._new = threading.Condition()
        self._ending = False
        self._answered = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def take_commands(self, gate: CommandGate, now_ns: int) -> None:
        while self.commands:
            gate.accept(self.commands.pop(0), now_ns)

    def publish(self, sample: PlantSample) -> None:
        with self._new:
            self.samples.append(sample)
            self._new.notify_all()

    def publish_clock(self, stamp_ns: int) -> None:
        self.clock.append(stamp_ns)

    def wait_for_command(self, seconds: float) -> None:
        with self._new:
            self._new.wait_for(lambda: self.commands, seconds)

    def commanders(self) -> int:
        return int(self.present)

    def recorded_ns(self) -> int | None:
        return self.recorded()

    def end(self) -> None:
        with self._new:
            self._ending = True
            self._new.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._new:
                self._new.wait_for(lambda: self._ending or len(self.samples) > self._answered)
                if self._ending:
                    return
                sample = self.samples[self._answered]
            self._answered += 1
            drive = self.answer(sample)
            if drive is not None:
                with self._new:
                    self.commands.append(Command(sample.stamp_ns, "far", drive))
                    self._new.notify_all()


@pytest.fixture
def run(wait_until: Any) -> Iterator[Callable[..., tuple[PlantLoop, Far]]]:
    """`run(answer, until)`: an enabled plant in lockstep, stopped once `until(loop, ports)`; watchdog 50 ms."""
    started: list[tuple[PlantLoop, Far]] = []

    def start(
        answer: Callable[[PlantSample], float | None],
        until: Callable[[PlantLoop, Far], Any],
        backend: Scripted | None = None,
        **timing: Any,
    ) -> tuple[PlantLoop, Far]:
        gate, ports = CommandGate(), Far(answer)
        gate.enable(True)
        pace = LoopTiming(PERIOD, own_clock=True, lockstep=True, **timing)
        loop = PlantLoop(backend or Scripted(), gate, ports, pace)
        started.append((loop, ports))
        loop.start()
        wait_until(lambda: until(loop, ports) or not loop.alive, "the end of the run")
        return loop, ports

    yield start
    for loop, ports in started:
        loop.stop()
        ports.end()


def samples(count: int) -> Callable[[PlantLoop, Far], bool]:
    return lambda loop, ports: len(ports.samples) >= count


def number(sample: PlantSample) -> float:
    """A drive that tells the sample which it answers."""
    return (sample.stamp_ns // PERIOD) % 1000 * 0.01


def check_answers(found: list[PlantSample]) -> None:
    """Stamps lie on the grid; once the two are in step each sample has the drive that answers the one before."""
    assert {b.stamp_ns - a.stamp_ns for a, b in zip(found, found[1:], strict=False)} == {PERIOD}
    answered = [b.drive == number(a) for a, b in zip(found, found[1:], strict=False)]
    first = next(n for n in range(len(answered)) if all(answered[n : n + 3]))
    assert len(answered) > first + 100
    assert all(answered[first:])


def test_a_slow_answer_stretches_the_run_and_changes_nothing(run: Any) -> None:
    def answer(sample: PlantSample) -> float:
        time.sleep(0.2 if sample.stamp_ns // PERIOD % 100 == 0 else 0.0)  # four times the watchdog
        return number(sample)

    loop, ports = run(answer, samples(600))
    check_answers(ports.samples[:600])
    assert loop.lockstep.given_up == 0
    assert ports.clock[:600] == [sample.stamp_ns for sample in ports.samples[:600]]


def test_a_source_that_is_late_from_the_start_is_waited_for(run: Any) -> None:
    """It answers sample after sample, the first of them later than the watchdog allows."""
    seen: list[PlantSample] = []

    def answer(sample: PlantSample) -> float:
        time.sleep(0.0 if seen else 0.3)
        seen.append(sample)
        return number(sample)

    loop, ports = run(answer, samples(600))
    check_answers(ports.samples[:600])
    assert loop._gate.counts[Verdict.STALE] > 0 and loop._gate.timeouts == 0


@pytest.mark.timing
def test_it_goes_as_fast_as_it_is_answered(run: Any) -> None:
    begun = time.monotonic()
    loop, ports = run(number, samples(10_000), factor=100.0)
    assert time.monotonic() - begun < 8.0, "ten seconds of plant time"
    check_answers(ports.samples[:10_000])


def test_without_a_source_it_goes_no_faster_than_the_wall(run: Any) -> None:
    begun = time.monotonic()
    run(lambda sample: None, samples(100), factor=100.0)
    assert time.monotonic() - begun > 0.09


def test_stamps_begin_where_the_plant_says_and_the_wall_clock_was_not_set(run: Any) -> None:
    class Ahead(Scripted):
        first = 0

        def first_instant(self, earliest_ns: int) -> int:
            self.first = earliest_ns + 3600 * 10**9
            return self.first

    backend = Ahead()
    offset = time.time_ns() - time.monotonic_ns()
    loop, ports = run(number, samples(200), backend)
    assert abs(ports.samples[0].stamp_ns - offset - backend.first) < 10**8
    assert abs(loop.wall_clock_step()) < 1.0
    check_answers(ports.samples)


def test_a_source_at_a_rate_of_its_own_is_not_waited_for(run: Any) -> None:
    seen: list[int] = []

    def every_third(sample: PlantSample) -> float | None:
        seen.append(sample.stamp_ns)
        return 1.0 if len(seen) % 3 == 0 else None

    loop, _ = run(every_third, samples(300))
    assert loop.lockstep.given_up == 0


def test_a_source_that_falls_silent_is_given_up_and_its_drive_taken_away(
    run: Any, wait_until: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = threading.Event()
    loop, ports = run(lambda sample: None if silent.is_set() else 1.0, samples(100))
    silent.set()
    monkeypatch.setattr(lockstep, "PATIENCE_S", 0.3)
    count = len(ports.samples)
    wait_until(lambda: ports.samples[-1].drive == 0.0, "0 V")
    assert loop.lockstep.given_up == loop._gate.timeouts == 1
    assert len([s for s in ports.samples[count:] if s.drive]) < 60, "50 ms of plant time, and what was on its way"


@pytest.mark.parametrize("way", ["left", "stopped", "disabled"])
def test_nobody_waits_for_a_source_that_has_left_or_may_not_command(
    run: Any, wait_until: Any, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    monkeypatch.setattr(lockstep, "PATIENCE_S", 600.0)
    silent = threading.Event()
    loop, ports = run(lambda sample: None if silent.is_set() else 1.0, samples(100))
    silent.set()
    count = len(ports.samples)
    if way == "left":
        ports.present = False
    elif way == "stopped":
        loop._gate.stop("emergency stop")
    else:
        loop._gate.enable(False)
    wait_until(lambda: len(ports.samples) >= count + 80, "further samples")
    assert ports.samples[-1].drive == 0.0 and loop.lockstep.given_up == 0


def test_a_recorder_that_falls_behind_is_waited_for(run: Any, wait_until: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lockstep, "AHEAD_S", 0.2)
    recorded = [0]
    loop, ports = run(lambda sample: None, samples(1))
    first = ports.samples[0].stamp_ns
    recorded[0] = first
    ports.recorded = lambda: recorded[0]
    ahead = round(lockstep.AHEAD_S * 1e9)
    wait_until(lambda: ports.samples[-1].stamp_ns >= first + ahead, "a plant that is ahead of its recorder")
    time.sleep(0.3)
    assert ports.samples[-1].stamp_ns == first + ahead
    recorded[0] += 100 * PERIOD
    wait_until(lambda: ports.samples[-1].stamp_ns == first + ahead + 100 * PERIOD, "the next 100 samples")
    assert loop.lockstep.given_up == 0


def test_lockstep_needs_a_clock_of_its_own() -> None:
    with pytest.raises(ValueError, match="lockstep"):
        LoopTiming(PERIOD, lockstep=True)
