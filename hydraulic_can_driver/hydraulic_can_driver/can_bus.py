"""Opening a CAN interface by the names that bus files use."""

from __future__ import annotations

import os
import re
import socket
import struct
from pathlib import Path
from typing import Any

import can

from hydraulic_can_driver.errors import BusDownError

PROGRAMS_ONLY = ("virtual", "udp_multicast")
"""Interfaces on which there are no devices but virtual ones: only those can wait."""

_SYSTEM_NETWORK = Path("/sys/class/net")
_ADDRESS_AND_PORT = re.compile(r"(?P<group>[\d.]+):(?P<port>\d+)")


def open_can(interface: str, channel: str, bitrate: int = 1_000_000) -> can.BusABC:
    """A python-can bus; `udp_multicast` takes "group" or "group:port" (IPv4) and never leaves this machine.

    Frames from outside would move an actuator: packets are sent with a life of 0 hops, and taken from the loopback
    interface alone.

    :raises BusDownError: there is no such interface or channel.
    """
    options: dict[str, Any] = {"interface": interface, "channel": channel}
    if interface == "udp_multicast":
        if ":" in channel.partition(":")[2]:
            raise BusDownError(f"CAN interface {interface}, channel {channel!r}: only IPv4 groups stay on this machine")
        options |= {"hop_limit": 0, "fd": False}
        if address := _ADDRESS_AND_PORT.fullmatch(channel):
            options |= {"channel": address["group"], "port": int(address["port"])}
    elif interface != "socketcan":  # there the kernel has the bit rate
        options["bitrate"] = bitrate
    try:
        bus = can.Bus(**options)
        if interface == "udp_multicast":
            _keep_on_this_machine(bus, options["channel"])
        return bus
    except (can.CanError, OSError, ValueError, ImportError, TypeError) as error:
        raise BusDownError(f"CAN interface {interface}, channel {channel!r}: {error or type(error).__name__}") from None


def _keep_on_this_machine(bus: can.BusABC, group: str) -> None:
    """Move the socket of a multicast bus, which python-can opens on every interface, to the loopback interface."""
    with socket.socket(fileno=os.dup(bus.fileno())) as end:
        lo = socket.if_nametoindex("lo")
        end.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
        where = struct.pack("@4s4si", socket.inet_aton(group), socket.inet_aton("127.0.0.1"), lo)
        end.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, where)
        end.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, where)


def programs_only(interface: str, channel: str) -> bool:
    """Whether nothing but programs can be on a bus: no actuator that moves."""
    if interface == "socketcan" and channel.startswith(("vcan", "vxcan")):
        # A serial adapter is such a device of the kernel, too, but not by that name.
        return "virtual" in (_SYSTEM_NETWORK / channel).resolve().parts
    return interface in PROGRAMS_ONLY


def stamps_by_wall_clock(interface: str) -> bool:
    """Whether each frame says when it was received, by this machine's clock and not by that of an adapter."""
    return interface in ("socketcan", *PROGRAMS_ONLY)


def hears_itself(interface: str) -> bool:
    """Whether frames that are sent come back to their sender."""
    return interface == "udp_multicast"
