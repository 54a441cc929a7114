"""Faults that virtual devices can be given, each by the name of what happens on a real bench.

`VirtualBench.inject` begins one, `VirtualBench.clear` ends it; `VirtualBench.at` begins it at a moment of the dialogue.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import inf
from typing import ClassVar, Protocol

import can
import canopen

from hydraulic_can_driver.virtual.device import Device
from hydraulic_can_driver.virtual.lvdt import ABOVE, BELOW, Lvdt
from hydraulic_can_driver.virtual.transducer import Transducer
from hydraulic_can_driver.virtual.valve import Valve

BUS_OFF_FRAME = 0x40  # class of an error frame of SocketCAN: the controller has left the bus (linux/can/error.h)
_LOW_SUPPLY, _LOW_SUPPLY_REGISTER = 0x3412, 0x04
_VALVE_CABLE, _VALVE_REGISTER = 0x5001, 0x80


class FaultyBench(Protocol):
    """What a fault happens to: the devices of a bench, and their bus."""

    devices: dict[str, Device]
    network: canopen.Network


@dataclass(frozen=True)
class InjectedFault(ABC):
    """Something wrong with the device ``node``; ``profiles`` that can have it, all if empty."""

    node: str
    profiles: ClassVar[tuple[int, ...]] = ()

    @abstractmethod
    def begin(self, bench: FaultyBench) -> None:
        """It happens."""

    def end(self, bench: FaultyBench) -> None:  # noqa: B027 - what happens only once has nothing to end
        """It is over."""


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
        _valve(bench, self.node).fail(f"fault 0x{self.code:04X}", self.code, self.register, lasts=True)

    def end(self, bench: FaultyBench) -> None:
        _valve(bench, self.node).recover(f"fault 0x{self.code:04X}")


@dataclass(frozen=True)
class MissingPdo(InjectedFault):
    """The next ``frames`` process data frames are not sent; all until the end by default."""

    frames: float = inf

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.lost_frames = self.frames

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.lost_frames = 0.0


@dataclass(frozen=True)
class LatePdo(InjectedFault):
    """Process data come ``delay`` [s] after their SYNC."""

    delay: float = 0.005

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.delay = self.delay

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.delay = 0.0


@dataclass(frozen=True)
class PdoLength(InjectedFault):
    """Process data frames have ``length`` bytes, whatever is mapped."""

    length: int = 3

    def begin(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.length = self.length

    def end(self, bench: FaultyBench) -> None:
        bench.devices[self.node].upsets.length = None


@dataclass(frozen=True)
class PositionJump(InjectedFault):
    """The LVDT reads ``by`` [m] too much."""

    profiles = (406,)
    by: float = 0.05

    def begin(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).jump = self.by

    def end(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).jump = 0.0


@dataclass(frozen=True)
class PositionFrozen(InjectedFault):
    """The LVDT repeats its last position."""

    profiles = (406,)

    def begin(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).frozen = True

    def end(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).frozen = False


@dataclass(frozen=True)
class PositionStuck(InjectedFault):
    """The LVDT reads the position ``at`` [m]; by default one outside of any stroke."""

    profiles = (406,)
    at: float = 5.0

    def begin(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).stuck_at = self.at

    def end(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).stuck_at = None


@dataclass(frozen=True)
class LimitSwitch(InjectedFault):
    """A limit switch of the LVDT closes where the piston is: ``side`` is "extended" or "retracted"."""

    profiles = (406,)
    side: str = "extended"

    def begin(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).area = ABOVE if self.side == "extended" else BELOW

    def end(self, bench: FaultyBench) -> None:
        _lvdt(bench, self.node).area = 0


@dataclass(frozen=True)
class CableBreak(InjectedFault):
    """The cable to the sensor of a device breaks: the spool's of a valve, its own of a transducer."""

    def begin(self, bench: FaultyBench) -> None:
        device = bench.devices[self.node]
        if isinstance(device, Valve):
            device.fail("cable break", _VALVE_CABLE, _VALVE_REGISTER, lasts=True)
        elif isinstance(device, Lvdt | Transducer):
            device.broken = True

    def end(self, bench: FaultyBench) -> None:
        device = bench.devices[self.node]
        if isinstance(device, Valve):
            device.recover("cable break")
        elif isinstance(device, Lvdt | Transducer):
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


FAULTS: dict[str, type[InjectedFault]] = {
    "heartbeat_stop": HeartbeatStop,
    "emergency": Emergency,
    "status_fault": StatusFault,
    "missing_pdo": MissingPdo,
    "late_pdo": LatePdo,
    "pdo_length": PdoLength,
    "position_jump": PositionJump,
    "position_frozen": PositionFrozen,
    "position_stuck": PositionStuck,
    "limit_switch": LimitSwitch,
    "cable_break": CableBreak,
    "wrong_identity": WrongIdentity,
    "sdo_abort": SdoAbort,
    "power_cut": PowerCut,
    "unplugged": Unplugged,
    "bus_off": BusOff,
}
"""All of them, by the names that a command line uses."""


def _valve(bench: FaultyBench, name: str) -> Valve:
    device = bench.devices[name]
    if not isinstance(device, Valve):
        raise ValueError(f"{name} is no valve; profiles are {_profiles(bench)}")
    return device


def _lvdt(bench: FaultyBench, name: str) -> Lvdt:
    device = bench.devices[name]
    if not isinstance(device, Lvdt):
        raise ValueError(f"{name} is no LVDT; profiles are {_profiles(bench)}")
    return device


def _profiles(bench: FaultyBench) -> dict[str, int]:
    return {name: device.spec.profile for name, device in bench.devices.items()}
