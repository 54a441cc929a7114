"""The thread that runs a plant: one cycle per sampling instant, on absolute deadlines.

A cycle: take the commands that have come, ask the gate for the drive, step the plant, publish its sample. In lockstep
it then waits for the answer to that sample before plant time goes on.
"""

from __future__ import annotations

import gc
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.scheduling import release_realtime_for_all, request_realtime, request_realtime_for_all
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.lockstep import Lockstep, LockstepPorts
from hydraulic_plant_node.pacing import Pacer, Wakefulness
from hydraulic_plant_node.plant_backend import PlantBackend
from hydraulic_plant_node.rate_monitor import RateMonitor

# The interpreter hands over between threads at this interval; the usual 5 ms is five cycles.
_SWITCH_INTERVAL_S = 5e-5
# A plant that keeps its own clock gives up on the asked speed when it is this many cycles behind.
_OWN_CLOCK_CATCH_UP = 50


class LoopPorts(LockstepPorts, Protocol):
    """Where commands come from and samples go to."""

    def publish(self, sample: PlantSample) -> None:
        """Send a sample to everybody."""

    def publish_clock(self, stamp_ns: int) -> None:
        """Tell everybody the time; called only by a plant with a clock of its own."""


@dataclass(frozen=True)
class LoopTiming:
    """Sampling `period_ns` in plant time; `factor` plant seconds per wall second, 1 unless `own_clock`.

    With `own_clock` the plant's time is published and everybody else follows it; without, it is wall time. In
    `lockstep`, which needs that clock, it goes on when the last sample has been answered, and `factor` is the most;
    where nobody answers it is wall time at the most.
    `priority` > 0 asks for real-time scheduling, and does without where it is not permitted.
    """

    period_ns: int
    factor: float = 1.0
    own_clock: bool = False
    lockstep: bool = False
    priority: int = 0

    def __post_init__(self) -> None:
        if self.factor != 1.0 and not self.own_clock:
            raise ValueError(f"real_time_factor is {self.factor:g}: only with publish_clock may it differ from 1")
        if self.lockstep and not self.own_clock:
            raise ValueError("lockstep: only a plant with a clock of its own can wait")


class PlantLoop:
    """Runs `backend` from `start` to `stop`; `error` holds the exception that ended it, if one did.

    `samples` counts what was published, `lost` the cycles without a sample.

    Samples are stamped with their scheduled sampling instant. `last_stamp_ns` carries on from an earlier run,
    so that stamps increase even if the wall clock was set back in between.
    """

    def __init__(
        self,
        backend: PlantBackend,
        gate: CommandGate,
        ports: LoopPorts,
        timing: LoopTiming,
        last_stamp_ns: int = 0,
    ) -> None:
        self.monitor = RateMonitor(max(round(timing.period_ns / timing.factor), 1))
        self.error: Exception | None = None
        self.scheduling = "normal"
        self.samples = 0
        self.lost = 0
        self.drive = 0.0
        self.last_stamp_ns = last_stamp_ns
        self._backend, self._gate, self._ports, self._timing = backend, gate, ports, timing
        self.lockstep = Lockstep(gate, ports, timing.period_ns) if timing.lockstep else None
        self._stopping = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plant_loop", daemon=True)
        self._switch_interval = sys.getswitchinterval()
        self._wakefulness: Wakefulness | None = None
        self._wall_offset_ns = 0

    def start(self) -> None:
        """Start the thread; the first sample comes one period later.

        The other threads get a priority one below. The calling one goes on to serve ROS: if the system took the
        processor from it while it holds the interpreter's lock, the loop would wait for it. Those of the middleware
        hand over the commands, which on a busy machine would come a cycle late or more.
        """
        gc.collect()
        gc.freeze()
        gc.disable()
        sys.setswitchinterval(_SWITCH_INTERVAL_S)
        if self._timing.priority > 0:
            self._wakefulness = Wakefulness()
        if self._timing.priority > 1:
            request_realtime_for_all(self._timing.priority - 1)
        self._thread.start()

    def stop(self, timeout: float = 2.0) -> bool:
        """End with a last sample at 0 V and a deactivated backend; False if the backend hangs."""
        self._stopping = True
        ended = self._ended.wait(timeout)
        if self._timing.priority > 1:
            release_realtime_for_all()
        if self._wakefulness:
            self._wakefulness.release()
        sys.setswitchinterval(self._switch_interval)
        gc.enable()
        gc.unfreeze()
        return ended

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive() and not self._ended.is_set()

    def now_ns(self) -> int:
        """The present in the clock of the stamps."""
        return self.last_stamp_ns if self._timing.own_clock else time.time_ns()

    def wall_clock_step(self) -> float:
        """How far the wall clock was set since the start, s; the stamps do not follow it."""
        return (time.time_ns() - time.monotonic_ns() - self._wall_offset_ns) * 1e-9

    def _run(self) -> None:
        try:
            if self._timing.priority > 0:
                self.scheduling = request_realtime(self._timing.priority)
            self._gate.forget()  # a drive that an earlier run was ended with
            cycle = self._cycle if self.lockstep is None else self._cycle_in_lockstep
            self._wall_offset_ns = time.time_ns() - time.monotonic_ns()
            cycle(Pacer().wait)
        except Exception as error:
            # Whatever a backend throws: the drive must end at 0 V, and somebody must hear of it.
            self.error = error
            self._gate.stop(f"plant loop failed: {error}")
        finally:
            self.drive = 0.0
            try:
                self._backend.deactivate()
            except Exception as error:
                self.error = self.error or error
            self._ended.set()

    def _cycle(self, wait: Callable[[int], int]) -> None:
        timing, ports, monitor = self._timing, self._ports, self.monitor
        wall_period = timing.period_ns / timing.factor
        catch_up = _OWN_CLOCK_CATCH_UP if timing.own_clock else self._backend.catch_up
        origin = self._backend.first_instant(time.monotonic_ns() + round(wall_period))
        grace = 1.0 - self._backend.tolerated_lateness
        first_stamp = max(origin + self._wall_offset_ns, self.last_stamp_ns + timing.period_ns)
        slot = 0
        while not self._stopping:
            due = origin + round(slot * wall_period)
            actual = wait(due)
            behind = int((actual - due) / wall_period + grace)
            lost = max(behind - catch_up, 0)
            monitor.tick(due, actual, 0 if timing.own_clock else lost)
            if timing.own_clock:
                # Its own time cannot be missed, it only passes more slowly than asked.
                origin += round(lost * wall_period)
            else:
                slot += lost
                if lost and grace > 0.0:
                    wait(origin + round(slot * wall_period))
            stamp = first_stamp + slot * timing.period_ns
            now = stamp if timing.own_clock else time.time_ns()
            if timing.own_clock:
                ports.publish_clock(stamp + (behind - lost) * timing.period_ns)
            drive = self._drive(now)
            for made_up in range(behind - lost + 1):
                if made_up:
                    drive = self._gate.drive(now)  # the limits of each instant
                self._sample(first_stamp + slot * timing.period_ns, drive)
                slot += 1
        wait(origin + round(slot * wall_period))
        self._sample(first_stamp + slot * timing.period_ns, 0.0)

    def _cycle_in_lockstep(self, wait: Callable[[int], int]) -> None:
        timing, lockstep = self._timing, self.lockstep
        assert lockstep is not None
        answered_period = round(timing.period_ns / timing.factor)
        due = time.monotonic_ns() + timing.period_ns
        first = self._backend.first_instant(due)  # of plant time, which may be ahead of the wall clock already
        stamp = max(first + self._wall_offset_ns, self.last_stamp_ns + timing.period_ns)
        while not self._stopping:
            now = wait(due)
            self.monitor.tick(now, now)
            self._ports.publish_clock(stamp)
            sampled = self._sample(stamp, self._drive(stamp))
            answered = sampled and lockstep.hold(stamp, lambda: self._stopping)
            stamp += timing.period_ns
            period = answered_period if answered else max(answered_period, timing.period_ns)
            due = max(due + period, now - _OWN_CLOCK_CATCH_UP * period)
        self._sample(stamp, 0.0)

    def _drive(self, now_ns: int) -> float:
        self._ports.take_commands(self._gate, now_ns)
        if self._backend.fault:
            self._gate.stop(self._backend.fault)
        return self._gate.drive(now_ns)

    def _sample(self, stamp_ns: int, drive: float) -> bool:
        sample = self._backend.step(stamp_ns, drive, self._timing.period_ns * 1e-9)
        if sample is None:
            self.lost += 1
            return False
        self._gate.observe(sample.position)
        self._ports.publish(sample)
        self.drive = sample.drive
        self.last_stamp_ns = sample.stamp_ns
        self.samples += 1
        return True
