"""One bench on a bus, from opening it to giving it back: boot, start, one cycle per SYNC, stop.

Lifecycle calls come from one thread, `cycle` from the loop's own once it runs. Until the valve says that it is ACTIVE,
and whenever anything is wrong, the setpoint sent is 0.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

from hydraulic_can_driver.bus import Bus, Node
from hydraulic_can_driver.can_bus import PROGRAMS_ONLY, programs_only
from hydraulic_can_driver.cia408 import CONTROL_WORDS, State, StateMachine, describe, state_of
from hydraulic_can_driver.codec import PdoCodec
from hydraulic_can_driver.errors import BusDownError, BusFileError, DeviceError
from hydraulic_can_driver.faults import NEEDS_CONFIGURE, BusFault, FaultLatch
from hydraulic_can_driver.frames import Frames
from hydraulic_can_driver.master import ERROR_REGISTER, PRE_OPERATIONAL, START, Master
from hydraulic_can_driver.measuring import Measuring
from hydraulic_can_driver.receiver import HEARTBEAT, OPERATIONAL, Receiver
from hydraulic_can_driver.supervision import Supervision
from hydraulic_can_driver.sync import Beat, KernelBeat, LockstepBeat, LoopBeat
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_interfaces.samples import PlantSample

KERNEL_SYNC = ("socketcan",)
"""Interfaces whose kernel sends messages periodically by itself."""

LONGEST_LOSS_S = 0.5
"""How long a real valve may go on after it has lost its driver: `lost_after` and the timeout of its drives."""

_QUIET = (State.INIT, State.DISABLED, State.FAULT_DISABLED, State.NOT_READY)
"""States in which the spool does not follow the setpoint; the last two only after a fault."""

_STOPPING_S = 0.4
"""Patience with a valve that is to be disabled: whoever stops the bench does not wait much longer."""

_LOCKSTEP_S = 5.0
"""Patience (wall time) with devices in lockstep, whose own clock stands still meanwhile."""


class Bench:
    """The devices of `bus` on an open interface.

    In `lockstep` each SYNC waits for all answers to the one before, time is counted in SYNCs, and devices that do not
    answer are a fault at once.

    :raises BusDownError: the interface cannot be opened, or is not one for lockstep.
    :raises BusFileError: the valve would go on for too long without its driver, and is no virtual one.
    """

    def __init__(self, bus: Bus, interface: str = "", channel: str = "", lockstep: bool = False) -> None:
        interface = interface or bus.interface
        kernel = interface in KERNEL_SYNC
        if lockstep and interface not in PROGRAMS_ONLY:
            raise BusDownError(f"lockstep on {interface}: only virtual devices wait, on {' or '.join(PROGRAMS_ONLY)}")
        _check_loss(bus, interface, channel or bus.channel)
        if lockstep:
            bus = replace(bus, monitoring=replace(bus.monitoring, missed_cycles=1))
        self.bus = bus
        self.faults = FaultLatch()
        self.frames = Frames(bus, self.faults)
        self._period = 1.0 / bus.rate
        self._lockstep = lockstep
        self.receiver = Receiver(bus, self.frames, self.faults, interface, kernel, self.now)
        self.supervision = Supervision(bus, self.receiver, self.frames, self.faults)
        self.machine = StateMachine(bus.monitoring.state_change)
        self.measuring = Measuring(bus, programs_only(interface, channel or bus.channel))
        self.readings: dict[str, dict[str, float]] = {}
        self.operational = False
        self._codec = PdoCodec(bus.drive_pdo)
        self._status_pdo, self._status = next(
            (pdo, signal.address) for _, pdo, signal in bus.signals() if signal.name == "status_word"
        )
        self._valve_state: State | None = None
        self._changed = threading.Condition()
        self._looping = False
        self._next_heartbeat = 0.0
        self._left_by = 0.0  # until then the valve may take to get ready; inf: its fault has been reset
        self.master = Master(bus, self.receiver, interface, channel)
        beat = LockstepBeat if lockstep else KernelBeat if kernel else LoopBeat
        self.beat: Beat = beat(self.master, self.frames, round(1e9 * self._period))

    def now(self) -> float:
        """Time [s] in which faults are judged: that of the SYNCs in lockstep, else the monotonic clock's."""
        return self.frames.cycle * self._period if self._lockstep else time.monotonic()

    def boot(self) -> None:
        """Check who is there, set the valve to 0 and off, boot and map all devices, read back what they are set to.

        :raises DeviceError: a device does not answer, is another one, or refuses something.
        :raises BusDownError: nothing can be sent.
        """
        for node in self.bus.nodes.values():
            self.master.command(node, PRE_OPERATIONAL)
            self.master.identify(node)
        self._quieten()
        for node in self.bus.nodes.values():
            self.master.boot(node)
        self.readings = {node.name: self.master.readings(node) for node in self.bus.nodes.values()}

    def inspect(self) -> None:
        """Check who is there and read back what they are set to; nothing is written.

        :raises DeviceError: as `boot`.
        :raises BusDownError: nothing can be sent.
        """
        for node in self.bus.nodes.values():
            self.master.identify(node)
        self.readings = {node.name: self.master.readings(node) for node in self.bus.nodes.values()}

    def start(self) -> None:
        """All devices operational, all frames there, the valve DISABLED at 0 V.

        A fault that was left behind in the valve, as by a driver that was killed, is reset once, and logged.

        :raises DeviceError: it does not come to that; the text says why.
        """
        self._no_errors(self._sensors())
        self.master.watch_master(self.bus.valve, True)
        self.faults.clear()
        self.machine = StateMachine(self.bus.monitoring.state_change)
        self.measuring.forget()
        self.frames.forget()
        self._looping, self.operational = False, True
        self._left_by = self.now() + self.bus.monitoring.state_change
        self.beat.start()
        for node in self.bus.nodes.values():
            self.master.command(node, START)
        self._cycles_until(self._ready, 3.0 * self.bus.monitoring.state_change)
        if not self._ready():
            raise DeviceError(f"the bench is not ready: {self._reason()}")
        self.supervision.begin(self.now())
        self.receiver.watching = self.faults.armed = True

    def follow(self, goal: State) -> None:
        """Lead the valve to ACTIVE or DISABLED; once the loop runs, wait until the valve says that it is there.

        :raises DeviceError: it does not follow.
        """
        with self._changed:
            if self.problem and goal is not State.DISABLED:
                raise DeviceError(self.problem)
            self.machine.ask(goal, self.now())
            if self._looping and not self._wait(lambda: self.machine.arrived or bool(self.machine.problem)):
                raise DeviceError(f"{self._reason()}; expected {goal.name}")
            if self.machine.problem and goal is not State.DISABLED:
                raise DeviceError(self.machine.problem)

    def cycle(self, stamp_ns: int, drive: float) -> PlantSample | None:
        """One SYNC of the running loop: send the drive [V], give the sample; None if not all frames came in time."""
        self._looping = True
        self.supervision.check(self.now())
        complete, frame = self._exchange(drive, stamp_ns)
        self.supervision.cycle(stamp_ns, complete)
        with self._changed:
            self._hear_valve()
            sample = self._take(stamp_ns, frame) if complete else None
            if self.machine.problem and not self.faults.text:
                self.faults.report(BusFault.VALVE, self.machine.problem)
            self._changed.notify_all()
        return sample

    def reset(self) -> None:
        """Reset the fault of the valve, and forget all others whose cause is gone; nothing where nothing is wrong.

        :raises DeviceError: a cause is still there, or the devices have to be configured anew.
        """
        if not self._looping or not (self.problem or self.machine.problem):
            return
        if any(fault in self.faults for fault in NEEDS_CONFIGURE):
            raise DeviceError(f"{self.faults.text}: deactivate, clean up and configure anew")
        if silent := self.supervision.silent(self.now()):
            raise DeviceError(f"no heartbeat: {', '.join(silent)}")
        if late := self.frames.debtors():
            raise DeviceError(f"frames come late: {', '.join(late)}; deactivate and activate where that stays so")
        self._no_errors(self._sensors())
        with self._changed:
            self.faults.clear()
            self.measuring.forget()
            self.supervision.begin(self.now())
            self.machine.reset(self.now())
            if not self._wait(lambda: self.machine.arrived or bool(self.faults.text)) or self.faults.text:
                raise DeviceError(self.faults.text or self._reason())
        self._no_errors([self.bus.valve])

    def stop(self) -> None:
        """0 V and disabled, seen in the status word; then nobody operational any more. May be called again.

        :raises DeviceError: the valve was not seen to be disabled.
        """
        if not self.operational:
            return
        self.receiver.watching = self.faults.armed = False
        why, valve = self.faults.text, self.bus.valve
        try:
            for goal in (State.DISABLED, State.INIT):
                self.machine = StateMachine(self.bus.monitoring.state_change)
                self.machine.fail("stopping")
                self.machine.control = CONTROL_WORDS[goal]
                if not valve.heartbeat or self.receiver.states.get(valve.name) == OPERATIONAL:
                    self._cycles_until(lambda goal=goal: self.machine.state in (goal, *_QUIET[2:]), _STOPPING_S)  # type: ignore[misc]
        finally:
            self.operational = self._looping = False
            self.beat.stop()
            self._dismiss()
        state = self.machine.state if self._valve_state is None else self._valve_state
        if state not in _QUIET:
            raise DeviceError(f"the valve was not seen to be disabled, it is {state.name}: {why or self._reason()}")

    def close(self) -> None:
        """Give the bus back."""
        try:
            self.stop()
        finally:
            self.master.close()

    @property
    def problem(self) -> str:
        """What is wrong while the bench runs."""
        return self.faults.text

    def _exchange(self, drive: float, sync_ns: int) -> tuple[bool, bytes]:
        """Send drive and SYNC; whether all frames came, and the frame that was sent."""
        with self._changed:
            problem = self.faults.text
            if problem and not self.machine.problem:
                self.machine.fail(problem)
            setpoint = self.measuring.allowed(drive) if self.machine.active else 0.0
            frame, _ = self._codec.encode({"control_word": self.machine.control, "drive": setpoint})
        try:
            now = self.now()
            if self._looping and now >= self._next_heartbeat:
                self._next_heartbeat = now + self.bus.master.heartbeat
                self.master.send(HEARTBEAT + self.bus.master.id, bytes([OPERATIONAL]))
            in_time = self.beat.exchange(self.bus.drive_pdo.cob_id, frame, sync_ns)
        except BusDownError as error:
            self.faults.report(BusFault.BUS, str(error))
            in_time = False
        cycle = self.frames.cycle
        patience = _LOCKSTEP_S if self._lockstep else self.bus.monitoring.frames_within * self._period
        complete = self.frames.wait(time.monotonic() + patience)
        # Where the kernel's next SYNC has come meanwhile, the frames are answers to that.
        complete &= self.frames.cycle == cycle
        self.frames.end()
        return complete and in_time, frame

    def _hear_valve(self) -> None:
        """The valve's word counts also where another device is silent."""
        if self.frames.has(self._status_pdo.cob_id):
            self.machine.advance(int(self.frames.quantities()["status_word"]), self.now())

    def _take(self, stamp_ns: int, frame: bytes) -> PlantSample:
        found = self.frames.quantities()
        # By the SYNC itself: where the loop was held up, that is later than the instant it was due.
        for fault, text in self.measuring.problems(self.frames.sync_ns, found):
            self.faults.report(fault, text)
        return self.measuring.sample(stamp_ns, self._codec.decode(frame)["drive"], found)

    def _cycles_until(self, done: Callable[[], bool], patience: float) -> None:
        """Cycles of its own at 0 V, before the loop begins and after it has ended.

        In lockstep patience counts periods, and the time that is waited for devices which do not answer.
        """
        due, spent = time.monotonic(), 0.0
        while not done() and spent < patience:
            begun = time.monotonic()
            complete, frame = self._exchange(0.0, self.beat.next_sync())
            with self._changed:
                self._hear_valve()
                if complete:
                    self._take(self.frames.sync_ns, frame)
            if self._lockstep:
                spent += self._period if complete else max(time.monotonic() - begun, self._period)
                continue
            due = max(due + self._period, time.monotonic() - self._period)
            time.sleep(max(due - time.monotonic(), 0.0))
            spent += time.monotonic() - begun

    def _ready(self) -> bool:
        if self.machine.arrived and self.machine.goal is State.INIT:
            self.machine.ask(State.DISABLED, self.now())
        self._reset_what_was_left()
        states = self.receiver.states
        operational = all(states.get(node.name) == OPERATIONAL for node in self.bus.nodes.values() if node.heartbeat)
        if not operational:
            self.frames.forget()  # who is not operational does not answer
        answered = operational and not self.frames.lacking()
        return answered and self.machine.arrived and self.machine.goal is State.DISABLED

    def _reset_what_was_left(self) -> None:
        """NOT_READY is as well what a fault in INIT looks like."""
        now, state = self.now(), self.machine.state
        if self._left_by < float("inf") and (state.faulty or state is State.NOT_READY and now > self._left_by):
            self._left_by = float("inf")
            self.faults.report(BusFault.VALVE, f"reset at the start: {describe(self.machine.status or 0)}")
            self.machine.reset(now)

    def _reason(self) -> str:
        states, nodes = self.receiver.states, self.bus.nodes.values()
        silent = [node.name for node in nodes if node.heartbeat and states.get(node.name) != OPERATIONAL]
        if lacking := self.frames.lacking():
            return f"no frames from {', '.join(lacking)}"
        if self.machine.problem:
            return self.machine.problem
        if silent:
            return f"no heartbeat that says OPERATIONAL from {', '.join(silent)}"
        return f"the valve is {describe(self.machine.status or 0)}"

    def _wait(self, done: Callable[[], bool]) -> bool:
        patience = 4.0 * self.bus.monitoring.state_change + 1.0
        return self._changed.wait_for(done, max(patience, _LOCKSTEP_S) if self._lockstep else patience)

    def _sensors(self) -> list[Node]:
        """All but the valve, which tells its faults in the status word and is reset by the control word."""
        return [node for node in self.bus.nodes.values() if node is not self.bus.valve]

    def _no_errors(self, nodes: list[Node]) -> None:
        for node in nodes:
            if register := int(self.master.read(node, ERROR_REGISTER)):
                raise DeviceError(f"{node.name} reports an error: error register 0x{register:02X}")

    def _quieten(self) -> None:
        """Setpoint 0 and control word 0 by SDO: the valve may have been left, or have started, active."""
        for signal in reversed(self.bus.drive_pdo.signals):
            self.master.write(self.bus.valve, signal.address, 0)

    def _dismiss(self) -> None:
        """Everybody pre-operational, the valve at 0 once more; then nobody watches the driver any more."""
        self._valve_state = None
        with self.master.impatient():
            try:
                for node in self.bus.nodes.values():
                    self.master.command(node, PRE_OPERATIONAL)
                self._quieten()
                self.master.watch_master(self.bus.valve, False)
                self._valve_state = state_of(int(self.master.read(self.bus.valve, self._status)))
            except HydraulicError as error:
                self.faults.report(BusFault.BUS, str(error))


def _check_loss(bus: Bus, interface: str, channel: str) -> None:
    if programs_only(interface, channel):
        return
    for name, seconds in (("lost_after", bus.master.lost_after), ("timeout of the drive", bus.drive_pdo.timeout)):
        if seconds > LONGEST_LOSS_S:
            where = f"on {interface} {channel}, where a valve may be real"
            raise BusFileError(f"{bus.path}: {name} is {seconds:g} s; allowed {where}: up to {LONGEST_LOSS_S:g} s")
