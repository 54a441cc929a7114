"""CAN: what the kernel offers, and what is only needed for hardware."""

from __future__ import annotations

import os
import shutil
import socket
from pathlib import Path

from ..bench import Bench
from ..findings import NOTE, Finding

TITLE = "CAN (for hardware; the virtual devices need none of it)"
ORDER = 3

ARPHRD_CAN = "280"  # type of a CAN device in /sys/class/net, linux/if_arp.h
VCAN_UP = "sudo modprobe vcan && sudo ip link add dev vcan0 type vcan && sudo ip link set vcan0 up"


def probe(bench: Bench) -> list[Finding]:
    """Kernel support, devices, python-can, can-utils."""
    return [_kernel(), _devices(), _python_can(bench), _tools()]


def _kernel() -> Finding:
    if not hasattr(socket, "AF_CAN"):
        return Finding("SocketCAN", "this Python has no AF_CAN sockets", "use a Python built on Linux", NOTE)
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as error:
        remedy = f"sudo modprobe can_raw ({_module('vcan')})"
        return Finding("SocketCAN", f"not in this kernel: {error.strerror}", remedy, NOTE)
    return Finding("SocketCAN", f"the kernel opens CAN sockets; {_module('vcan')}")


def _module(name: str) -> str:
    release = os.uname().release
    folders = [Path("/lib/modules", release), Path("/usr/lib/modules", release)]
    if Path("/sys/module", name).is_dir():
        return f"module {name} is loaded"
    if any(next(folder.rglob(f"{name}.ko*"), None) for folder in folders if folder.is_dir()):
        return f"module {name} can be loaded"
    return f"no module {name} for kernel {release}"


def _devices() -> Finding:
    devices = []
    for entry in sorted(Path("/sys/class/net").glob("*")):
        try:
            if (entry / "type").read_text().strip() == ARPHRD_CAN:
                devices.append(f"{entry.name} ({(entry / 'operstate').read_text().strip()})")
        except OSError:
            continue
    if devices:
        return Finding("devices", ", ".join(devices))
    return Finding("devices", "none", f"for trying: {VCAN_UP}", NOTE)


def _python_can(bench: Bench) -> Finding:
    found = sorted(bench.checkout.venv.glob("lib/python3*/site-packages/can/interfaces"))
    if not found:
        return Finding("python-can", "comes with the environment", "./bench build", NOTE)
    names = sorted(p.stem for p in found[0].glob("[!_]*") if p.suffix in ("", ".py"))
    return Finding("python-can", f"{len(names)} interfaces, among them socketcan and virtual")


def _tools() -> Finding:
    if shutil.which("candump"):
        return Finding("can-utils", "found")
    return Finding("can-utils", "not there (candump, cansend: only to look at a bus)", "apt install can-utils", NOTE)
