"""A servo valve with on-board amplifier (CiA 408)."""

from __future__ import annotations

import math

from hydraulic_can_driver.bus import Node
from hydraulic_can_driver.virtual.amplifier import Amplifier, Shaping
from hydraulic_can_driver.virtual.device import Device
from hydraulic_can_driver.virtual.plant import Reading
from hydraulic_can_driver.virtual.supervision import MasterWatch
from hydraulic_can_driver.virtual.valve_state import State, StateMachine
from hydraulic_can_driver.virtual.wiring import Wiring

FULL = 16384
"""Counts of full scale."""

LOCAL_BIT, RAMP_BIT, LIMIT_BIT, DEVIATION_BIT = 1 << 4, 1 << 9, 1 << 10, 1 << 11
"""Further bits of the status word 0x6041."""

_BUS_MODE = 1
_GENERIC, _COMMUNICATION = 0x01, 0x10  # bits of the error register 0x1001


class Valve(Device):
    """Follows control word and set-point, shapes the set-point, and centres its spool where it loses its master."""

    profile = 408

    def __init__(self, spec: Node, wiring: Wiring) -> None:
        super().__init__(spec, wiring)
        self.machine = StateMachine()
        self.amplifier = Amplifier()
        self.opening = 0.0
        self.causes: set[str] = set()  # what keeps a fault from being reset
        self.master = MasterWatch(wiring.bus.master.id, wiring.now)
        self._spool_sign, _ = wiring.mounting("spool")
        drive = wiring.signal("drive")
        assert drive is not None  # the loader of the bus file has seen to it
        self._rated = FULL * drive.scale.gain  # V at full scale, with the sign of the wiring
        self._deviating = 0.0

    def start(self) -> None:
        """Self-test passed: INIT, spool centred."""
        self.machine = StateMachine()
        self.machine.ready()
        self.amplifier = Amplifier()
        self.opening = 0.0
        self.master.forget()
        self._take_settings()
        self._show()

    def halt(self) -> None:
        """Springs centre the spool."""
        self.opening = 0.0

    def drive(self, dt: float) -> float:
        """What the spool is told for the next ``dt`` [s], as drive [V]."""
        if self.powered:
            self._cycle(dt)
        return self.drive_now

    @property
    def drive_now(self) -> float:
        """What the spool is told at this moment, as drive [V]."""
        return self.opening * self._rated

    def sense(self, reading: Reading) -> None:
        """Spool position, and whether it follows."""
        spool = self._spool_sign * (reading.spool if math.isfinite(reading.spool) else self.opening)
        self.set(0x6301, 1, round(FULL * spool))
        difference = FULL * (self.opening - spool)
        outside = not self.get(0x6355, 1) <= difference <= self.get(0x6354, 1)
        self._deviating = self._deviating + 1.0 / self.wiring.bus.rate if outside else 0.0
        self._show()

    def written(self, index: int, sub: int) -> None:
        """New settings, or a new control word over SDO."""
        if 0x6320 <= index <= 0x6346 or index == 0x2346:
            self._take_settings()
        elif index == 0x1016:
            self.master.expect_heartbeat(self.get(0x1016, 1))
        elif index == 0x6040 and not self.operational and self.powered:
            self._cycle(0.0)

    def refuse(self, index: int, sub: int, value: int) -> int:
        """Set-points and control words of the bus are not for local mode."""
        return 0x08000022 if index in (0x6040, 0x6300) and self.get(0x6042) != _BUS_MODE else 0

    def received(self, number: int) -> None:
        """The master is there."""
        self.master.command()

    def take_over(self) -> None:
        """See `Device.take_over`; every SYNC is a sign of the master."""
        if self.operational:
            self.master.sync()
        super().take_over()

    def watch(self, now: float) -> None:
        """Has the master been silent for too long?"""
        super().watch(now)
        if not self.powered:
            return
        silence = self.get(0x2201) * 1e-3
        for cause, code in self.master.silent(now, self.pdos.deadline, silence, self.started):
            self.fail(cause, code, _COMMUNICATION)
            self._leave_operational()
            return

    def fail(self, cause: str, code: int, register: int = _GENERIC, lasts: bool = False) -> None:
        """A fault of its own, with an EMCY; ``lasts`` until `recover`."""
        if not self.powered:
            return
        if lasts:
            self.causes.add(cause)
        self.machine.fault(cause)
        self._rest()
        self._show()
        self._say("state", self.machine.state.label)
        self.emergency(code, register | _GENERIC)

    def recover(self, cause: str) -> None:
        """The cause is gone; the fault stays until the master resets it."""
        self.causes.discard(cause)
        if self.powered and not self.causes and self.get(0x1001):
            self.emergency(0, 0)

    def left_operational(self) -> None:
        """Without process data nobody is in control: as a control word of 0."""
        self.master.forget()
        self.set(0x6040, 0, 0)
        self.set(0x6300, 1, 0)
        self._cycle(0.0)

    def entered_operational(self) -> None:
        """From now on silence of SYNC counts."""
        self.master.sync()

    def _leave_operational(self) -> None:
        action = self.get(0x1029, 1)
        if self.started and action != 1 and self.node is not None:
            self.node.nmt.on_command(0, bytes([2 if action == 2 else 128, self.spec.id]), 0.0)
            self._say("nmt", self.node.nmt.state)
            self.left_operational()

    def _advance(self) -> None:
        was = self.machine.faulty
        for state in self.machine.advance(self.get(0x6040), bool(self.causes)):
            self._say("state", state.label)
        if was and not self.machine.faulty and self.get(0x1001):
            self.emergency(0, 0)
        self._show()

    def _cycle(self, dt: float) -> None:
        self._advance()
        if self.machine.state is State.ACTIVE and self.get(0x6042) == _BUS_MODE:
            self.opening = self.amplifier.opening(self.get(0x6300, 1) / FULL, dt)
        else:
            self._rest()

    def _rest(self) -> None:
        """Where the spool goes when no set-point of the bus holds."""
        state = self.machine.state
        self.amplifier.rest()
        holds = state is State.HOLD or (state in (State.FAULT_HOLD, State.FAULT_REACTION) and self.get(0x2200) == 1)
        self.opening = self.get(0x6314, 1) / FULL if holds else 0.0

    def _show(self) -> None:
        word = self.machine.state.bits
        word |= LOCAL_BIT * (self.get(0x6042) != _BUS_MODE)
        word |= RAMP_BIT * self.amplifier.ramping | LIMIT_BIT * self.amplifier.limited
        word |= DEVIATION_BIT * (self.get(0x6351) != 0 and self._deviating * 1e3 > self.get(0x6352, 1))
        self.set(0x6041, 0, word)

    def _take_settings(self) -> None:
        def share(index: int) -> float:
            return self.get(index, 1) / FULL

        def ramp(*indices: int) -> tuple[float, ...]:
            return tuple(self.get(index, 1) * 1e-3 for index in indices)

        kind = self.get(0x6330)
        ramps = {
            0: (0.0, 0.0, 0.0, 0.0),
            1: ramp(0x6331, 0x6331, 0x6331, 0x6331),
            2: ramp(0x6331, 0x6331, 0x6334, 0x6334),
            3: ramp(0x6332, 0x6333, 0x6335, 0x6336),
        }[kind]
        compensated = self.get(0x6342) != 0
        self.amplifier.shaping = Shaping(
            gain=share(0x6322),
            offset=share(0x6323),
            lower=share(0x6321),
            upper=share(0x6320),
            ramps=ramps,  # type: ignore[arg-type]
            positive_gain=share(0x6341) if self.get(0x6340) else 1.0,
            dead_band=(share(0x6343), share(0x6344), share(0x6345)) if compensated else (0.0, 0.0, 0.0),
            table=[self.get(0x2346, n) / FULL for n in range(1, 12)] if self.get(0x6346) else (),
            zero=share(0x6324),
        )
