"""Which ROS 2 the bench runs on: a sourced Jazzy, or the wheels in the virtual environment."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

DISTRO = "jazzy"
WHEELS = "wheels"

_PATH_LISTS = (
    "AMENT_PREFIX_PATH",
    "CMAKE_PREFIX_PATH",
    "COLCON_PREFIX_PATH",
    "LD_LIBRARY_PATH",
    "PATH",
    "PKG_CONFIG_PATH",
    "PYTHONPATH",
)


@dataclass(frozen=True)
class Ros:
    """A ROS 2 Jazzy: `prefix` of the sourced one and the Python it is for, or neither for the wheels."""

    prefix: Path | None = None
    python: tuple[int, int] | None = None

    @property
    def label(self) -> str:
        """Prefix of a sourced Jazzy, or "wheels"."""
        return str(self.prefix) if self.prefix else WHEELS

    def __str__(self) -> str:
        return f"the sourced ROS 2 Jazzy in {self.prefix}" if self.prefix else "ROS 2 Jazzy wheels"


def prefixes(environ: Mapping[str, str]) -> list[Path]:
    """Folders of AMENT_PREFIX_PATH, in order."""
    return [Path(p) for p in environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]


def sourced(environ: Mapping[str, str]) -> Ros:
    """The Jazzy whose set-up file was sourced in `environ`; the wheels if there is none.

    The prefix is recognised by its rclpy; a virtual environment (ours, in a `./bench shell`) does not count.
    """
    if environ.get("ROS_DISTRO") == DISTRO:
        for prefix in prefixes(environ):
            for rclpy in sorted(prefix.glob("lib/python3.*/site-packages/rclpy")):
                version = re.fullmatch(r"python3\.(\d+)", rclpy.parents[1].name)
                if version and not (prefix / "pyvenv.cfg").exists():
                    return Ros(prefix, (3, int(version[1])))
    return Ros()


def without_foreign(environ: Mapping[str, str]) -> dict[str, str]:
    """`environ` without another ROS distribution: its folders and variables would break Jazzy's libraries."""
    if environ.get("ROS_DISTRO", DISTRO) == DISTRO:
        return dict(environ)
    foreign = prefixes(environ)
    kept = {k: v for k, v in environ.items() if not re.fullmatch(r"ROS_(DISTRO|VERSION|PYTHON_VERSION)", k)}
    for name in _PATH_LISTS:
        if name in kept:
            parts = [p for p in kept[name].split(os.pathsep) if p and not _below(Path(p), foreign)]
            kept[name] = os.pathsep.join(parts)
    return {k: v for k, v in kept.items() if v or k not in _PATH_LISTS}


def _below(path: Path, roots: list[Path]) -> bool:
    return any(path == root or root in path.parents for root in roots)
