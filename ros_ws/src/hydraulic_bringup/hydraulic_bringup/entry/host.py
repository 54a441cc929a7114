"""Which machines the bench runs on: Linux on x86-64, and others that bring a ROS 2 Jazzy of their own."""

from __future__ import annotations

from .errors import BenchError
from .ros import DISTRO, Ros

_WHEELS = ("x86_64", "amd64")
_NAMES = {"darwin": "macOS", "win32": "Windows", "cygwin": "Windows", "msys": "Windows"}


def check_system(system: str) -> None:
    """See that this is Linux (`sys.platform`).

    :raises BenchError: it is not
    """
    if not system.startswith("linux"):
        raise BenchError(
            f"The bench runs on Linux; this is {_NAMES.get(system, system)}.",
            why="its plants need SocketCAN, abstract sockets and the ROS 2 wheels, which are for Linux.",
            remedy="use a Linux machine, a virtual one or a container on x86-64; on Windows: WSL 2.",
        )


def check_machine(machine: str, ros: Ros) -> None:
    """See that there are ROS 2 wheels for this processor (`platform.machine()`), or that none are needed.

    :raises BenchError: they are needed, and there are none
    """
    if ros.prefix is None and machine.lower() not in _WHEELS:
        raise BenchError(
            f"There are no ROS 2 wheels for {machine}: they are for Linux on x86-64 alone.",
            remedy=f"install ROS 2 {DISTRO.capitalize()} (Ubuntu 24.04 has it for arm64, too), source its set-up file "
            "and call ./bench again; docs.ros.org/en/jazzy/Installation.\nOn that the bench has not been tried on "
            "other processors.",
        )
