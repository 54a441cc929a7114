"""Opening a CAN interface by the names that bus files use."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import can

from hydraulic_can_driver.errors import BusDownError

PROGRAMS_ONLY = ("virtual", "udp_multicast")
"""Interfaces on which there are no devices but virtual ones: only those can wait."""

_SYSTEM_NETWORK = Path("/sys/class/net")
_ADDRESS_AND_PORT = re.compile(r"(?P<group>[\d.]+):(?P<port>\d+)")


def open_can(interface: str, channel: str, bitrate: int = 1_000_000) -> can.BusABC:
    """A python-can bus; `udp_multicast` takes "group" or "group:port" and never leaves this machine.

    Frames from outside would move an actuator: multicast packets are sent with a life of 0 hops.

    :raises BusDownError: there is no such interface or channel.
    """
    options: dict[str, Any] = {"interface": interface, "channel": channel}
    if interface == "udp_multicast":
        options |= {"hop_limit": 0, "fd": False}
        if address := _ADDRESS_AND_PORT.fullmatch(channel):
            options |= {"channel": address["group"], "port": int(address["port"])}
    elif interface != "socketcan":  # there the kernel has the bit rate
        options["bitrate"] = bitrate
    try:
        return can.Bus(**options)
    except (can.CanError, OSError, ValueError, ImportError, TypeError) as error:
        raise BusDownError(f"CAN interface {interface}, channel {channel!r}: {error or type(error).__name__}") from None


def programs_only(interface: str, channel: str) -> bool:
    """Whether nothing but programs can be on a bus: no actuator that moves."""
    if interface == "socketcan" and channel.startswith(("vcan", "vxcan")):
        # A serial adapter is such a device of the kernel, too, but not by that name.
        return "virtual" in (_SYSTEM_NETWORK / channel).resolve().parts
    return interface in PROGRAMS_ONLY


def hears_itself(interface: str) -> bool:
    """Whether frames that are sent come back to their sender."""
    return interface == "udp_multicast"
