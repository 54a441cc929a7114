"""Commands, references, states and parameters: what comes over topics and services, put through the pure parts."""

from __future__ import annotations

import math
import random
from pathlib import Path

from hydraulic_can_driver.nodes.can_driver import PARAMETERS as CAN_DRIVER
from hydraulic_control.controller import Controller
from hydraulic_control.parameters import SPECS as CONTROLLER
from hydraulic_control.session import ControlSession
from hydraulic_interfaces.contract import DRIVE_LIMIT_V, PISTON, SERVOVALVE, WATCHDOG_S
from hydraulic_interfaces.conversions import MessageError, command_from_message, reference_from_message
from hydraulic_interfaces.samples import Command, PlantSample
from hydraulic_node_utils.parameter_spec import ParameterError
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.nodes.plant_node import PARAMETERS as PLANT
from hydraulic_plant_node.travel_limits import EndsOfTravel, TravelLimits
from hydraulic_sim.nodes.simulator import PARAMETERS as SIMULATOR
from hydraulic_sysid.nodes.recorder import PARAMETERS as RECORDER

from . import must
from .values import anything, joints, number, text

MS = 1_000_000
BATCH = 1000
_SOURCES = ("controller", "excitation", "b", "")
_ENDS = EndsOfTravel(-0.75, 0.75, 0.05, 0.8)


class _Stranger:
    """Makes commands: of several sources, in and out of order, replayed, too old, too new, malformed."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._sent: list[tuple[int, str, float]] = []

    def command(self, now_ns: int):
        rng = self._rng
        if self._sent and rng.random() < 0.1:
            stamp, source, drive = rng.choice(self._sent[-50:])
        else:
            stamp = now_ns - (0 if rng.random() < 0.7 else rng.randrange(-100 * MS, 100 * MS))
            source = rng.choice(_SOURCES) if rng.random() < 0.3 else _SOURCES[0]
            drive = number(rng, 8.0)
            self._sent.append((stamp, source, drive))
        return joints(rng, stamp, source, [SERVOVALVE], {"effort": [drive]}, 0.1)


def commands(rng: random.Random, folder: Path) -> int:
    """Commands and switches through the gate; what it lets through is judged by rules of its own."""
    gate, stranger = CommandGate(), _Stranger(rng)
    limits = TravelLimits(_ENDS, 1e-3) if rng.random() < 0.5 else None
    gate.limits = limits
    now, sent, enabled, latched, numbers = 10**18, 0, False, False, 0
    excuses: list[tuple[int, float]] = []  # arrival and drive of commands that could be obeyed
    last = 0.0
    while sent < BATCH:
        now += MS if rng.random() < 0.95 else rng.choice((0, 40 * MS, 60 * MS, 10**10, -5 * MS, -(10**10)))
        if rng.random() < 0.03:
            switch, before = rng.choice(("enable", "enable", "enable", "disable", "stop", "reset")), (enabled, latched)
            if switch == "stop":
                gate.stop(text(rng))
                enabled, latched = False, True
            elif switch == "reset":
                gate.reset()
                enabled, latched = enabled and not latched, False
            else:
                must(gate.enable(switch == "enable") == (switch != "enable" or not latched), "answer of enable")
                enabled = switch == "enable" and not latched
            if switch == "stop" or (enabled, latched) != before:
                excuses.clear()
        for _ in range(rng.choice((0, 1, 1, 1, 2, 5))):
            message = stranger.command(now)
            sent, numbers = sent + 1, numbers + 1
            given = rng.choice((None, numbers, numbers, rng.randrange(1, numbers + 2)))
            try:
                command = command_from_message(message)
            except MessageError as error:
                gate.reject(str(error))
                continue
            gate.accept(command, now, given, rng.random() < 0.8)
            if gate.stopped and not latched:  # two publishers of one name that met
                latched, enabled = True, False
                excuses.clear()
            if _could_move(command, now) and enabled:
                excuses.append((now, command.drive))
        allowed = limits.allowed() if limits else math.inf
        drive = gate.drive(now)
        excuses = [(at, value) for at, value in excuses[-200:] if 0 <= now - at <= WATCHDOG_S * 1e9]
        _judge(drive, enabled, excuses, allowed)
        if limits:
            grown = abs(drive) - (abs(last) if last * drive > 0.0 else 0.0)
            must(grown <= _ENDS.slew * 1e-3 + 1e-9, f"the drive grows by {grown} V in a cycle")
            gate.observe(rng.choice((math.nan, rng.uniform(-0.76, 0.76), number(rng))))
        last = drive
    must(sum(gate.counts.values()) == sent, f"{sent} commands came, {sum(gate.counts.values())} are counted")
    return sent


def _could_move(command: Command, now: int) -> bool:
    age = abs(now - command.stamp_ns) * 1e-9
    return bool(command.source) and math.isfinite(command.drive) and age <= WATCHDOG_S + 1e-9


def _judge(drive: float, enabled: bool, excuses: list[tuple[int, float]], allowed: float) -> None:
    must(math.isfinite(drive) and abs(drive) <= min(DRIVE_LIMIT_V, allowed), f"drive {drive} V, allowed {allowed}")
    if drive:
        must(enabled, f"drive {drive} V while disabled or stopped")
        wished = any(0.0 < drive <= value or value <= drive < 0.0 for _, value in excuses)
        must(wished, f"drive {drive} V, which nobody has commanded within the watchdog time")


def references(rng: random.Random, folder: Path) -> int:
    """References and states through the controller's session: drives stay finite and within the limits."""
    session = ControlSession(Controller({"controller": rng.choice(("npid", "pid"))}))
    now, sent = 10**18, 0
    while sent < BATCH // 2:
        now += MS if rng.random() < 0.97 else rng.choice((0, 30 * MS, 10**9, -3 * MS, -(10**10)))
        if rng.random() < 0.5:
            fields = {"position": [number(rng, 0.3)], "velocity": [number(rng)][: rng.randrange(2)]}
            message = joints(rng, now - rng.choice((0, 0, 0, 10**8, 10**10)), "x", [PISTON], fields, 0.1)
            sent += 1
            try:
                session.follow(reference_from_message(message), now)
            except MessageError:
                continue
        if rng.random() < 0.01:
            session.disobeyed(text(rng), now)
        position = rng.uniform(-0.7, 0.7) if rng.random() < 0.02 else 0.1
        values = [value if rng.random() < 0.99 else number(rng) for value in (position, 0.0, 0.0, 0.0)]
        late = rng.choice((0, 0, 0, 0, 10**8, -(10**8)))
        sample = PlantSample(now - late, values[0], values[1], values[2], values[3], values[3], 7e6, 7e6, 14e6)
        drive = session.answer(sample, now)
        sent += 1
        good = drive is None or math.isfinite(drive) and abs(drive) <= DRIVE_LIMIT_V
        must(good, f"the controller commands {drive} V")
    return sent


SPECS = (*PLANT, *SIMULATOR, *CAN_DRIVER, *RECORDER, *CONTROLLER.values())


def parameters(rng: random.Random, folder: Path) -> int:
    """Values for parameters of the nodes: taken in the right type and range, or refused."""
    for _ in range(BATCH):
        spec = rng.choice(SPECS)
        value = anything(rng)
        if rng.random() < 0.5:
            value = number(rng) if isinstance(spec.default, float) else text(rng)
        try:
            taken = spec.check(value)
        except ParameterError:
            continue
        must(type(taken) is type(spec.default), f"{spec.name} takes {value!r} as {taken!r}")
        if isinstance(taken, float | int):
            low = -math.inf if spec.minimum is None else spec.minimum
            high = math.inf if spec.maximum is None else spec.maximum
            must(math.isfinite(taken) and low <= taken <= high, f"{spec.name} takes {value!r}")
        must(not spec.choices or taken in spec.choices, f"{spec.name} takes {value!r}")
    return BATCH
