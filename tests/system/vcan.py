"""Where a real virtual CAN interface of the kernel is to be had: here, or in a small virtual machine."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from system import machine

SYSTEM_PATHS = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
MODULES = "vcan", "can_raw", "can_bcm"
REQUIRED = "BENCH_REQUIRE_VCAN"
"""Environment variable: set, a machine that can have no vcan fails these tests instead of skipping them."""


def path() -> str:
    """Search path with this environment's programs and the system's."""
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", ""), SYSTEM_PATHS])


def lacking_here() -> str:
    """Why this kernel cannot have a vcan interface of ours; empty if it can."""
    try:
        with interface("vcan_probe"):
            return ""
    except (OSError, subprocess.CalledProcessError) as error:
        output = getattr(error, "stderr", b"") or b""
        return output.decode().strip() or str(error)


@contextmanager
def interface(name: str) -> Iterator[str]:
    """A vcan interface of this machine, for as long as it is needed."""

    def ip(*arguments: str) -> None:
        subprocess.run(["ip", "link", *arguments], check=True, capture_output=True, env={"PATH": path()})

    ip("add", "dev", name, "type", "vcan")
    try:
        ip("set", name, "up")
        yield name
    finally:
        ip("delete", name)


def kernels() -> list[Path]:
    """Kernels on this machine whose modules are here as well, newest last."""
    found = sorted(Path("/boot").glob("vmlinuz-*"))
    return [k for k in found if any(Path(f"/lib/modules/{k.name[8:]}").rglob("vcan.ko*"))]


def lacking_machine() -> str:
    """Why no virtual machine can be started; empty if one can."""
    if platform.machine() != "x86_64":
        return f"the virtual machine is for x86_64, this is {platform.machine()}"
    programs = ["qemu-system-x86_64", "busybox", "modprobe", "ip", "candump"]
    missing = [name for name in programs if shutil.which(name, path=path()) is None]
    if missing:
        return f"missing: {', '.join(missing)} (.ci/run installs them as root)"
    return "" if kernels() else "no kernel with the module vcan in /boot (.ci/run installs one as root)"


def in_machine(script: Path, channel: str, folder: Path, log: Path, patience: float) -> int:
    """Run `script channel folder` in a virtual machine with that interface; exit code of the emulator.

    :raises subprocess.TimeoutExpired: it has not ended within `patience` [s]; nothing of it is left then either.
    """
    # Compiled here to byte code: the machine reads this one's files, and would take minutes over it.
    imports = "import runpy, sys; runpy.run_path(sys.argv[1])"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    subprocess.run([sys.executable, "-c", imports, str(script)], env=environment, check=True)
    lines = [
        f"export PATH={shlex.quote(path())} HOME=/run TMPDIR=/run ROS_LOG_DIR=/run/ros PYTHONDONTWRITEBYTECODE=1",
        "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=1 PYTHONUNBUFFERED=1 OPENBLAS_NUM_THREADS=1",
        f"export PYTHONPATH={shlex.quote(environment['PYTHONPATH'])}",
        f"cd {shlex.quote(str(folder))} || exit 3",
        f"ip link set lo up && ip link add dev {channel} type vcan && ip link set {channel} up || exit 4",
        f"exec {shlex.quote(sys.executable)} {shlex.quote(str(script))} {channel} {shlex.quote(str(folder))}",
    ]
    start = folder / "guest.sh"
    start.write_text("\n".join(lines) + "\n")
    return machine.run(kernels()[-1], MODULES, ["/bin/bash", str(start)], folder, log, patience, path())


def in_process(script: Path, channel: str, folder: Path, log: Path, patience: float) -> int:
    """Run `script channel folder` on this machine, which has the interface; its exit code."""
    environment = {
        **os.environ,
        "PATH": path(),
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
        "PYTHONUNBUFFERED": "1",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": "101",
    }
    command = [sys.executable, str(script), channel, str(folder)]
    with log.open("wb") as sink:
        return subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=sink, stderr=subprocess.STDOUT, timeout=patience, env=environment
        ).returncode
