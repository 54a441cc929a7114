"""Executables of ROS 2 packages, found as `ros2 run` finds them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from .errors import UsageError

SHOWN = 12  # names in a message; a whole ROS 2 has hundreds


def executables(prefixes: list[Path]) -> dict[str, dict[str, Path]]:
    """Executables by package and name; of several prefixes the first counts.

    A package is known by its marker in the ament index, its executables lie in `lib/PACKAGE`.
    """
    found: dict[str, dict[str, Path]] = {}
    for prefix in prefixes:
        for marker in sorted(prefix.glob("share/ament_index/resource_index/packages/*")):
            if marker.name not in found:
                files = sorted(prefix.joinpath("lib", marker.name).glob("*"))
                found[marker.name] = {f.name: f for f in files if f.is_file() and os.access(f, os.X_OK)}
    return found


def find(prefixes: list[Path], package: str, executable: str) -> Path:
    """Path of one executable.

    :raises UsageError: no such package, or no such executable in it; with those there are
    """
    known = executables(prefixes)
    if package not in known:
        offered = [name for name, files in known.items() if files]  # those of the workspace come first
        raise UsageError(f"There is no package {package!r}.", remedy=f"packages with executables: {_listed(offered)}")
    if executable not in known[package]:
        raise UsageError(
            f"There is no executable {executable!r} in {package}.",
            remedy=f"it has: {_listed(known[package])}",
        )
    return known[package][executable]


def _listed(names: Iterable[str]) -> str:
    shown, hidden = list(names)[:SHOWN], len(list(names)) - SHOWN
    return (", ".join(shown) or "none") + (f" and {hidden} more" if hidden > 0 else "")
