"""What a bus file says, as plain data: interface, nodes, process data, boot list, limits. Read by `load_bus`.

All quantities are SI. `Signal`s have names of their own over the whole bus; those that the driver knows are listed in
`SIGNALS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hydraulic_plant_node.travel_limits import EndsOfTravel

TYPES: Mapping[str, str] = {"u8": "B", "u16": "H", "u32": "I", "i8": "b", "i16": "h", "i32": "i", "f32": "f"}
"""Types of objects, and their letters in `struct` (always little-endian)."""

SENT = ("control_word", "drive")
"""Signals that the driver sends to the valve; both are needed."""

NEEDED = ("status_word", "position")
"""Signals without which no bench can be driven."""

SIGNALS: Mapping[str, str] = {
    "control_word": "",
    "drive": "V",
    "status_word": "",
    "spool": "m",
    "position": "m",
    "velocity": "m/s",
    "switches": "",
    "pressure_a": "Pa",
    "pressure_b": "Pa",
    "pressure_supply": "Pa",
    "position_status": "",
    "pressure_a_status": "",
    "pressure_b_status": "",
    "pressure_supply_status": "",
}
"""Every signal that the driver uses, with the unit of its quantity; "" for words of bits."""

SWITCHES = ("limit_retracted", "limit_extended")


@dataclass(frozen=True)
class Address:
    """An object in a device's dictionary: index, sub-index, type (a key of `TYPES`)."""

    index: int
    sub: int
    type: str

    @property
    def bits(self) -> int:
        """Length of the object, bits."""
        return {"b": 8, "h": 16, "i": 32, "f": 32}[TYPES[self.type].lower()]

    @property
    def mapping(self) -> int:
        """The object as an entry of a PDO mapping: index, sub-index, bits (CiA 301, 7.4.8)."""
        return self.index << 16 | self.sub << 8 | self.bits

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.sub}"


@dataclass(frozen=True)
class Scale:
    """quantity = gain · raw + offset, in `unit`; a word of bits has no unit, gain 1 and offset 0."""

    gain: float = 1.0
    offset: float = 0.0
    unit: str = ""


@dataclass(frozen=True)
class Signal:
    """One object in a PDO; `bits` names single bits of it."""

    name: str
    address: Address
    scale: Scale = Scale()
    bits: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Pdo:
    """A process data object: `number` counts from 1, `transmission` as in CiA 301.

    `timeout` [s] of a received one; 0: the device waits for it for ever.
    """

    number: int
    cob_id: int
    transmission: int
    signals: tuple[Signal, ...]
    timeout: float = 0.0

    @property
    def length(self) -> int:
        """Bytes of its frame."""
        return sum(signal.address.bits for signal in self.signals) // 8


@dataclass(frozen=True)
class SdoWrite:
    """One line of a boot list: the raw `value` that goes into an object."""

    address: Address
    value: int | float
    comment: str = ""


@dataclass(frozen=True)
class Reading:
    """An object that is read back at the start.

    Where its quantity differs from `neutral`, and the reading named `switch` differs from its own, the device does what
    the physical `effect` does.
    """

    name: str
    address: Address
    scale: Scale = Scale()
    neutral: float | None = None
    effect: str = ""
    switch: str = ""


@dataclass(frozen=True)
class Node:
    """A device: `profile` is the lower half of its 0x1000, `identity` what its 0x1018 must say.

    `heartbeat` in s; 0: it sends none.
    """

    name: str
    id: int
    profile: int
    eds: str = ""
    identity: Mapping[str, int] = field(default_factory=dict)
    heartbeat: float = 0.0
    boot: tuple[SdoWrite, ...] = ()
    receive: tuple[Pdo, ...] = ()
    transmit: tuple[Pdo, ...] = ()
    inspect: tuple[Reading, ...] = ()


@dataclass(frozen=True)
class Master:
    """The driver's own node `id`, the period of its heartbeat [s], and after which silence the valve gives up [s]."""

    id: int
    heartbeat: float
    lost_after: float


@dataclass(frozen=True)
class Cylinder:
    """Piston areas, m^2; NaN where unknown: the force is then not reported."""

    area_a: float
    area_b: float


@dataclass(frozen=True)
class Limits:
    """What the actuator may be asked to do, and what its sensors may say; V, m, m/s, share of travel, Pa.

    `full_speed` is that of the piston at 10 V. `braking` before the ends of the stroke: None where there is to be none.
    """

    drive: float
    position: tuple[float, float]
    position_margin: float
    velocity: float
    full_speed: float
    braking: EndsOfTravel | None
    frozen_travel: float
    frozen_spool: float
    frozen_supply: float


@dataclass(frozen=True)
class Monitoring:
    """How long the driver waits before it calls something a fault; shares of a period, cycles, s, heartbeats."""

    frames_within: float
    missed_cycles: int
    sync_gap: float
    state_change: float
    heartbeats: int


@dataclass(frozen=True)
class Bus:
    """A bench on a CAN bus; `rate` in Hz."""

    name: str
    description: str
    interface: str
    channel: str
    bitrate: int
    rate: float
    master: Master
    cylinder: Cylinder
    limits: Limits
    monitoring: Monitoring
    nodes: Mapping[str, Node]
    path: Path = Path()

    def signals(self) -> Iterator[tuple[Node, Pdo, Signal]]:
        """Every signal that a device sends, with its frame and its node."""
        for node in self.nodes.values():
            for pdo in node.transmit:
                for signal in pdo.signals:
                    yield node, pdo, signal

    @property
    def unprotected(self) -> tuple[str, ...]:
        """Protections that the file does without, each by an explicit `none`."""
        silent = [f"heartbeat of {node.name}" for node in self.nodes.values() if not node.heartbeat]
        timeout = [] if self.drive_pdo.timeout else ["drive timeout of the valve"]
        switches = [] if self.signal("switches") else ["limit switches"]
        braking = [] if self.limits.braking else ["braking before the ends of travel"]
        return (*silent, *timeout, *switches, *braking)

    @property
    def valve(self) -> Node:
        """The node that takes the drive."""
        return next(node for node in self.nodes.values() if node.receive)

    @property
    def drive_pdo(self) -> Pdo:
        """The frame that carries control word and drive."""
        return self.valve.receive[0]

    def signal(self, name: str) -> Signal | None:
        """A signal that a device sends, by its name; None where no device does."""
        return next((signal for _, _, signal in self.signals() if signal.name == name), None)
