"""A small virtual machine with another kernel than this machine's, under software emulation, and with its files.

What an emulated processor does takes some fifty times as long, so it does little: no distribution is booted. The first
process is a shell script that loads the modules, mounts this machine's files (read-only, but for one folder), runs one
program and turns the machine off.
"""

from __future__ import annotations

import contextlib
import gzip
import lzma
import os
import shlex
import shutil
import signal
import stat
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import zstandard

FILE_SYSTEM = "virtio_pci", "9pnet_virtio", "9p"
UNPACK: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.decompress,
    ".xz": lzma.decompress,
    ".zst": lambda packed: zstandard.ZstdDecompressor().decompressobj().decompress(packed),
}
INIT = """#!/busybox sh
for module in {modules}; do /busybox insmod $module; done
/busybox mount -t 9p -o ro,cache=loose,trans=virtio,version=9p2000.L,msize=512000 files /files || /busybox poweroff -f
/busybox mount -t proc proc /files/proc
/busybox mount -t sysfs sys /files/sys
/busybox mount -t tmpfs run /files/run
/busybox mount -t devtmpfs dev /files/dev
/busybox mkdir -p /files/dev/shm
/busybox mount -t tmpfs shm /files/dev/shm
/busybox mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000 folder /files{folder}
/busybox chroot /files {program}
/busybox poweroff -f
"""
QUIET = "console=ttyS0 quiet loglevel=1 panic=-1 mitigations=off nokaslr"


def module_files(kernel: str, modules: Sequence[str], path: str) -> list[Path]:
    """Files of these modules and of those that they need, in the order in which they are loaded."""
    found: list[Path] = []
    for module in modules:
        lines = subprocess.run(
            ["modprobe", "--show-depends", "-C", "/var/empty", "-S", kernel, module],
            env={"PATH": path}, capture_output=True, text=True,
        ).stdout.splitlines()  # fmt: skip
        found += [Path(words[1]) for line in lines if (words := line.split())[:1] == ["insmod"]]  # others are built in
    return list(dict.fromkeys(found))


def archive(entries: Sequence[tuple[str, int, bytes]]) -> bytes:
    """Files and folders (name, mode, content) as the kernel unpacks them: cpio, "newc"."""
    packed = b""
    for number, (name, mode, content) in enumerate([*entries, ("TRAILER!!!", 0, b"")], start=1):
        fields = (number, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name) + 1, 0)
        head = b"070701" + b"".join(b"%08x" % field for field in fields) + name.encode() + b"\0"
        packed += head + b"\0" * (-len(head) % 4) + content + b"\0" * (-len(content) % 4)
    return packed


def run(
    kernel: Path, modules: Sequence[str], program: Sequence[str], folder: Path, log: Path, patience: float, path: str
) -> int:
    """Boot `kernel` (/boot/vmlinuz-…) with these modules besides, and run `program`, which may write to `folder`.

    Returns the exit code of the emulator; `log` is the machine's console.

    :raises subprocess.TimeoutExpired: it has not ended within `patience` [s]; nothing of it is left then either.
    """
    loaded = {}
    for file in module_files(kernel.name.removeprefix("vmlinuz-"), [*FILE_SYSTEM, *modules], path):
        unpack = UNPACK.get(file.suffix, bytes)
        loaded[f"{len(loaded):02d}.ko"] = unpack(file.read_bytes())
    busybox = shutil.which("busybox", path=path)
    assert busybox is not None
    text = INIT.format(modules=" ".join(loaded), folder=shlex.quote(str(folder)), program=shlex.join(program))
    executable = stat.S_IFREG | 0o755
    begin = folder / "begin.cpio"
    begin.write_bytes(
        archive(
            [
                ("busybox", executable, Path(busybox).read_bytes()),
                ("init", executable, text.encode()),
                ("files", stat.S_IFDIR | 0o755, b""),
                *((name, stat.S_IFREG | 0o644, content) for name, content in loaded.items()),
            ]
        )
    )
    share = "local,security_model=none,multidevs=remap"
    command = [
        "qemu-system-x86_64", "-machine", "q35", "-accel", "tcg,thread=multi", "-cpu", "max", "-smp", "2", "-m", "2G",
        "-nodefaults", "-no-reboot", "-display", "none", "-serial", "stdio",
        "-fsdev", f"{share},id=files,path=/,readonly=on", "-device", "virtio-9p-pci,fsdev=files,mount_tag=files",
        "-fsdev", f"{share},id=folder,path={folder}", "-device", "virtio-9p-pci,fsdev=folder,mount_tag=folder",
        "-kernel", str(kernel), "-initrd", str(begin), "-append", QUIET,
    ]  # fmt: skip
    with log.open("wb") as sink:
        emulator = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=sink, stderr=subprocess.STDOUT, start_new_session=True,
            env={**os.environ, "PATH": path},
        )  # fmt: skip
        try:
            return emulator.wait(patience)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(emulator.pid, signal.SIGKILL)
            emulator.wait()
