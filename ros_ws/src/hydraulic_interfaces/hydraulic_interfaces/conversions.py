"""Between the contract's messages and plain samples, exactly and both ways.

Publishing at 1 kHz goes through the encoders: they write the changing numbers into a message that was
serialised once, which costs a tenth of building and serialising it anew.
"""

from __future__ import annotations

import math
import struct
from contextlib import suppress
from functools import cache
from importlib import import_module
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Header

from hydraulic_interfaces.contract import PISTON, PLANT_FRAME, SERVOVALVE
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_interfaces.samples import NAN, Command, PlantSample, Reference

_SECOND = 1_000_000_000
_ENCAPSULATION = 4


class MessageError(HydraulicError, ValueError):
    """A message that does not carry what the contract says: the text names the field and what it holds."""


@cache
def interface_class(name: str) -> Any:
    """Class of a message or service type by its name, "sensor_msgs/msg/JointState"."""
    package, kind, short = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), short)


def to_time(stamp_ns: int) -> Time:
    """Message stamp of nanoseconds since the epoch."""
    seconds, nanoseconds = divmod(stamp_ns, _SECOND)
    return Time(sec=seconds, nanosec=nanoseconds)


def from_time(stamp: Time) -> int:
    """Nanoseconds since the epoch of a message stamp."""
    return stamp.sec * _SECOND + stamp.nanosec


def command_to_message(command: Command) -> JointState:
    """Message of a command."""
    header = Header(stamp=to_time(command.stamp_ns), frame_id=command.source)
    return JointState(header=header, name=[SERVOVALVE], effort=[float(command.drive)])


def command_from_message(message: JointState) -> Command:
    """Command in a message; position and velocity are not looked at.

    :raises MessageError: other names than [servovalve], or not exactly one effort.
    """
    if message.name != [SERVOVALVE]:
        raise MessageError(f"command: name is {list(message.name)}, must be [{SERVOVALVE!r}]")
    if len(message.effort) != 1:
        raise MessageError(f"command: effort has {len(message.effort)} values, must have 1 (the drive in V)")
    return Command(from_time(message.header.stamp), message.header.frame_id, message.effort[0])


def state_to_message(sample: PlantSample) -> JointState:
    """The `state` message of a sample."""
    return JointState(
        header=Header(stamp=to_time(sample.stamp_ns), frame_id=PLANT_FRAME),
        name=[PISTON, SERVOVALVE],
        position=[sample.position, sample.spool],
        velocity=[sample.velocity, NAN],
        effort=[sample.force, sample.drive],
    )


def pressure_to_message(stamp_ns: int, pressure: float) -> FluidPressure:
    """The message of one pressure [Pa]."""
    return FluidPressure(header=Header(stamp=to_time(stamp_ns), frame_id=PLANT_FRAME), fluid_pressure=pressure)


def sample_to_messages(sample: PlantSample) -> tuple[JointState, FluidPressure, FluidPressure, FluidPressure]:
    """Messages of `state`, `pressure_a`, `pressure_b`, `pressure_supply` of a sample."""
    pressures = (sample.pressure_a, sample.pressure_b, sample.pressure_supply)
    a, b, supply = (pressure_to_message(sample.stamp_ns, value) for value in pressures)
    return state_to_message(sample), a, b, supply


def sample_from_messages(
    state: JointState,
    pressure_a: FluidPressure | None = None,
    pressure_b: FluidPressure | None = None,
    pressure_supply: FluidPressure | None = None,
    limit_retracted: bool = False,
    limit_extended: bool = False,
) -> PlantSample:
    """Sample in messages of one instant; a pressure that is not given is NaN.

    :raises MessageError: names other than [piston, servovalve], lists of other lengths, or unequal stamps.
    """
    if state.name != [PISTON, SERVOVALVE]:
        raise MessageError(f"state: name is {list(state.name)}, must be [{PISTON!r}, {SERVOVALVE!r}]")
    for field in ("position", "velocity", "effort"):
        if len(getattr(state, field)) != 2:
            raise MessageError(f"state: {field} has {len(getattr(state, field))} values, must have 2")
    stamp = from_time(state.header.stamp)
    pressures = {"pressure_a": pressure_a, "pressure_b": pressure_b, "pressure_supply": pressure_supply}
    for name, message in pressures.items():
        if message is not None and from_time(message.header.stamp) != stamp:
            other = from_time(message.header.stamp)
            raise MessageError(f"{name}: stamp {other} ns is not the state's {stamp} ns")
    return PlantSample(
        stamp_ns=stamp,
        position=state.position[0],
        velocity=state.velocity[0],
        force=state.effort[0],
        drive=state.effort[1],
        spool=state.position[1],
        limit_retracted=limit_retracted,
        limit_extended=limit_extended,
        **{name: NAN if m is None else m.fluid_pressure for name, m in pressures.items()},
    )


def reference_to_message(reference: Reference) -> JointState:
    """Message of a reference."""
    return JointState(
        header=Header(stamp=to_time(reference.stamp_ns), frame_id=PLANT_FRAME),
        name=[PISTON],
        position=[float(reference.position)],
        velocity=[float(reference.velocity)],
    )


def reference_from_message(message: JointState) -> Reference:
    """Reference in a message; velocity is NaN where the message has none.

    :raises MessageError: names other than [piston], or not exactly one position.
    """
    if message.name != [PISTON]:
        raise MessageError(f"reference: name is {list(message.name)}, must be [{PISTON!r}]")
    if len(message.position) != 1 or len(message.velocity) > 1:
        sizes = f"{len(message.position)} positions and {len(message.velocity)} velocities"
        raise MessageError(f"reference: has {sizes}, must have 1 and at most 1")
    velocity = message.velocity[0] if len(message.velocity) else NAN
    return Reference(from_time(message.header.stamp), message.position[0], velocity)


# Numbers whose eight bytes do not turn up by chance, not even with the arbitrary bytes that padding holds.
_MARKS = (math.pi, math.e, math.sqrt(2.0), math.sqrt(3.0), math.log(2.0))


def _exact(message: Any) -> bytearray:
    """The serialised message without what the middleware leaves behind it.

    Its buffer has an estimated size, up to 8 bytes too many; strict readers of recorded bags refuse those.
    """
    buffer = bytearray(serialize_message(message))
    with suppress(Exception):  # rclpy raises several types when the bytes no longer suffice
        while len(buffer) > _ENCAPSULATION:
            deserialize_message(bytes(buffer[:-1]), type(message))
            del buffer[-1]
    return buffer


class _Template:
    """A serialised message in which the stamp and some numbers are overwritten in place."""

    # The stamp follows the 4 bytes of the encapsulation header in every stamped message.
    _STAMP_AT = 4

    def __init__(self, message: Any, *fields: tuple[float, ...]) -> None:
        """`fields`: values that stand side by side in `message` and mark where numbers go later."""
        self._buffer = _exact(message)
        order = "<" if self._buffer[1] else ">"
        self._stamp = struct.Struct(f"{order}iI")
        self._fields = []
        for values in fields:
            form = struct.Struct(f"{order}{len(values)}d")
            # The first occurrence is the field: what the serialiser leaves unwritten before it is too short to
            # hold another, while behind the last field there may be some, left over from an earlier message.
            self._fields.append((form, self._buffer.index(form.pack(*values))))

    def __call__(self, stamp_ns: int, *numbers: float) -> bytes:
        """CDR bytes for `Publisher.publish`: this stamp, and a number for each field."""
        return self.fill(stamp_ns, *((number,) for number in numbers))

    def fill(self, stamp_ns: int, *fields: tuple[float, ...]) -> bytes:
        """The message with this stamp and these numbers."""
        buffer = self._buffer
        self._stamp.pack_into(buffer, self._STAMP_AT, *divmod(stamp_ns, _SECOND))
        for (form, offset), values in zip(self._fields, fields, strict=True):
            form.pack_into(buffer, offset, *values)
        return bytes(buffer)


class StateEncoder:
    """Serialised `state` messages, equal in content to those of `state_to_message`."""

    def __init__(self) -> None:
        x, v, force, drive, spool = _MARKS
        marked = PlantSample(0, position=x, velocity=v, force=force, drive=drive, spool=spool)
        self._template = _Template(state_to_message(marked), (x, spool), (v,), (force, drive))

    def __call__(self, sample: PlantSample) -> bytes:
        """CDR bytes for `Publisher.publish`."""
        position, effort = (sample.position, sample.spool), (sample.force, sample.drive)
        return self._template.fill(sample.stamp_ns, position, (sample.velocity,), effort)


class CommandEncoder(_Template):
    """Serialised `command` messages of one source by stamp and drive, as of `command_to_message`."""

    def __init__(self, source: str) -> None:
        super().__init__(command_to_message(Command(0, source, _MARKS[0])), _MARKS[:1])


class ReferenceEncoder(_Template):
    """Serialised `reference` messages by stamp, position and velocity, as of `reference_to_message`."""

    def __init__(self) -> None:
        x, v = _MARKS[:2]
        super().__init__(reference_to_message(Reference(0, x, v)), (x,), (v,))


class PressureEncoder(_Template):
    """Serialised pressure messages by stamp and pressure, as of `pressure_to_message`."""

    def __init__(self) -> None:
        super().__init__(pressure_to_message(0, _MARKS[0]), _MARKS[:1])


class ClockEncoder(_Template):
    """Serialised `/clock` messages by stamp."""

    def __init__(self) -> None:
        super().__init__(Clock())
