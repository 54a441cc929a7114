"""Faults that virtual devices can be given, each by the name of what happens on a real bench.

`VirtualBench.inject` begins one, `VirtualBench.clear` ends it; `VirtualBench.at` begins it at a moment of the dialogue.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import inf
from typing import ClassVar, Protocol, TypeVar

import can
import canopen

from hydraulic_can_driver.virtual.device import Device, Sensor
from hydraulic_can_driver.virtual.lvdt import ABOVE, BELOW, Lvdt
from hydraulic_can_driver.virtual.valve import Valve

BUS_OFF_FRAME = 0x40  # class of an error frame of SocketCAN: the controller has left the bus (linux/can/error.h)
_LOW_SUPPLY, _LOW_SUPPLY_REGISTER = 0x3412, 0x04
_VALVE_CABLE, _VALVE_REGISTER = 0x5001, 0x80


FAULTS: dict[str, type[InjectedFault]] = {}
"""All of them, by the names that a command line uses: those of the classes, "pdo_length"."""

AnyDevice = TypeVar("AnyDevice", bound=Device)


class FaultyBench(Protocol):
    """What a fault happens to: the devices of a bench, and their bus."""

    devices: dict[str, Device]
    network: canopen.Network


@dataclass(frozen=True)
class InjectedFault(ABC):
    """Something wrong with the device ``node``; ``profiles`` that can have it, all if empty."""

    node: str
    profiles: ClassVar[tuple[int, ...]] = ()

    def __init_subclass__(cls) -> None:
        if not cls.__name__.startswith("_"):
            FAULTS[re.sub(r"\B(?=[A-Z])", "_", cls.__name__).lower()] = cls

    @abstractmethod
    def begin(self, bench: FaultyBench) -> None:
        """It happens."""

    def end(self, bench: FaultyBench) -> None:  # noqa: B027 - what happens only once has nothing to end
        """It is over."""


class _Switch(InjectedFault):
    """One attribute of a device, or of its upsets, has the value of the fault's own field (else True) until the end."""

    attribute: ClassVar[str]
    off: ClassVar[object]

    def begin(self, bench: FaultyBench) -> None:
        self._set(bench, next((value for name, value in vars(self).items() if name != "node"), True))

    def end(self, bench: FaultyBench) -> None:
        self._set(bench, self.off)

    def _set(self, bench: FaultyBench, value: object) -> None:
        device = _device(bench, self.node, Lvdt) if self.profiles else bench.devices[self.node]
        setattr(device.upsets if hasattr(device.upsets, self.attribute) else device, self.attribute, value)


@dataclass(frozen=True)
class HeartbeatStop(InjectedFault):
    """No more heartbeats, all else goes on."""

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].stop_heartbeat(True)

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].stop_heartbeat(False)


@dataclass(frozen=True)
class Emergency(InjectedFault):
    """An EMCY, with which the device goes on working; the end is the EMCY of code 0."""

    code: int = 0xFF00
    register: int = 0x81

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].emergency(self.code, self.register)

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].emergency(0, 0)


@dataclass(frozen=True)
class StatusFault(InjectedFault):
    """The valve finds something wrong with itself; it can be reset once the fault has ended."""

    profiles = (408,)
    code: int = _LOW_SUPPLY
    register: int = _LOW_SUPPLY_REGISTER

    def begin(self, bench: FaultyBench) -> None:
        _device(bench, self.node, Valve).fail(f"fault 0x{self.code:04X}", self.code, self.register, lasts=True)

    def end(self, bench: FaultyBench) -> None:
        _device(bench, self.node, Valve).recover(f"fault 0x{self.code:04X}")


@dataclass(frozen=True)
class MissingPdo(_Switch):
    """The next ``frames`` process data frames are not sent; all until the end by default."""

    attribute, off = "lost_frames", 0.0
    frames: float = inf


@dataclass(frozen=True)
class LatePdo(_Switch):
    """Process data come ``delay`` [s] after their SYNC."""

    attribute, off = "delay", 0.0
    delay: float = 0.005


@dataclass(frozen=True)
class PdoLength(_Switch):
    """Process data frames have ``length`` bytes, whatever is mapped."""

    attribute, off = "length", None
    length: int = 3


@dataclass(frozen=True)
class PositionJump(_Switch):
    """The LVDT reads ``by`` [m] too much."""

    attribute, off = "jump", 0.0
    profiles = (406,)
    by: float = 0.05


@dataclass(frozen=True)
class PositionFrozen(_Switch):
    """The LVDT repeats its last position, but for a count that flickers."""

    attribute, off = "frozen", False
    profiles = (406,)


@dataclass(frozen=True)
class PositionStuck(_Switch):
    """The LVDT reads the position ``at`` [m]; by default one outside of any stroke; a count flickers."""

    attribute, off = "stuck_at", None
    profiles = (406,)
    at: float = 5.0


@dataclass(frozen=True)
class LimitSwitch(InjectedFault):
    """A limit switch of the LVDT closes where the piston is: ``side`` is "extended" or "retracted"."""

    profiles = (406,)
    side: str = "extended"

    def begin(self, bench: FaultyBench) -> None:
        _device(bench, self.node, Lvdt).area = ABOVE if self.side == "extended" else BELOW

    def end(self, bench: FaultyBench) -> None:
        _device(bench, self.node, Lvdt).area = 0


@dataclass(frozen=True)
class CableBreak(InjectedFault):
    """The cable to the sensor of a device breaks: the spool's of a valve, its own of a transducer."""

    def begin(self, bench: FaultyBench) -> None:
        device = bench.devices[self.node]
        if isinstance(device, Valve):
            device.fail("cable break", _VALVE_CABLE, _VALVE_REGISTER, lasts=True)
        elif isinstance(device, Sensor):
            device.broken = True

    def end(self, bench: FaultyBench) -> None:
        device = bench.devices[self.node]
        if isinstance(device, Valve):
            device.recover("cable break")
        elif isinstance(device, Sensor):
            device.broken = False


@dataclass(frozen=True)
class WrongIdentity(InjectedFault):
    """0x1018 reads ``value`` at ``sub``: another maker's device has the node ID."""

    sub: int = 1
    value: int = 0xBAD

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.identity[self.sub] = self.value

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.identity.pop(self.sub, None)


@dataclass(frozen=True)
class SdoAbort(InjectedFault):
    """Reading or writing an object is answered by an abort with ``code``."""

    index: int = 0x6042
    sub: int = 0
    code: int = 0x08000020  # data cannot be transferred or stored

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.aborts[self.index, self.sub] = self.code

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.aborts.pop((self.index, self.sub), None)


@dataclass(frozen=True)
class PowerCut(InjectedFault):
    """The device loses its supply; with the end it boots again, with nothing but its stored settings."""

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].power_off()

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].power_on()


@dataclass(frozen=True)
class Unplugged(InjectedFault):
    """The connector of the device is out, or its controller bus-off: it has power, and neither hears nor speaks."""

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].disconnect()

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].connect()


@dataclass(frozen=True)
class BusOff(InjectedFault):
    """The master's own controller goes bus-off, which an error frame tells it; ``node`` says nothing here.

    Only interfaces that carry error frames between programs can do this: `virtual`, `udp_multicast`, vcan.
    """

    node: str = "valve"

    def begin(self, bench: FaultyBench) -> None:
        frame = can.Message(arbitration_id=BUS_OFF_FRAME, is_error_frame=True, is_extended_id=False, data=bytes(8))
        assert bench.network.bus is not None
        with bench.network.send_lock:
            bench.network.bus.send(frame)


def _device(bench: FaultyBench, name: str, kind: type[AnyDevice]) -> AnyDevice:
    device = bench.devices[name]
    if not isinstance(device, kind):
        wanted = "LVDT" if kind is Lvdt else "valve"
        profiles = {name: device.spec.profile for name, device in bench.devices.items()}
        raise ValueError(f"{name} is no {wanted}; profiles are {profiles}")
    return device
