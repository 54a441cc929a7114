"""The colcon workspace: builds what changed since the last build, by file content."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from .checkout import Checkout
from .steps import run_step

STAMP = "bench.json"
LEFT_OUT = re.compile(r"^\.|^__pycache__$|\.egg-info$")
COLCON = "import sys; from colcon_core.command import main; sys.exit(main())"

Files = dict[str, str]


def fingerprint(package: Path) -> Files:
    """Content hash of every file of a package that goes into its build, by relative path."""
    found: Files = {}
    for folder, subfolders, names in os.walk(package):
        subfolders[:] = sorted(s for s in subfolders if not LEFT_OUT.search(s))
        for name in sorted(names):
            path = Path(folder, name)
            if not name.startswith(".") and path.is_file():
                found[str(path.relative_to(package))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


class Build:
    """State of the last build by `./bench`, kept in `ros_ws/build`.

    :param key: what else a build depends on (Python, ROS); another key makes every package stale
    """

    def __init__(self, checkout: Checkout, key: str) -> None:
        self.checkout, self.key = checkout, key
        self.sources = {name: fingerprint(path) for name, path in checkout.packages().items()}
        self._stamp = checkout.workspace / "build" / STAMP

    def stale(self) -> dict[str, str]:
        """Packages to build, each with the reason."""
        last = self._read()
        return {
            name: reason
            for name, files in self.sources.items()
            if (reason := staleness(last.get(name), files, self.key, self._result(name)))
        }

    def leaves_remains(self, package: str) -> bool:
        """Whether a build over the last one would leave something: a deleted module, another Python's folder."""
        last = self._read().get(package) or {}
        return last.get("key", self.key) != self.key or not set(last.get("files", ())) <= set(self.sources[package])

    def forget(self, packages: Iterable[str]) -> None:
        """Mark `packages` as not built: the next call builds them, whatever happens to this one."""
        doomed = set(packages)
        self._write({name: entry for name, entry in self._read().items() if name not in doomed})

    def remember(self, packages: Iterable[str]) -> None:
        """Mark `packages` as built from the sources as they were when this object was made."""
        entries = self._read()
        for name in packages:
            entries[name] = {"key": self.key, "result": self._result(name), "files": self.sources[name]}
        self._write(entries)

    def _result(self, name: str) -> str:
        """Identifies the result of a build, also one by a plain `colcon build`; empty where there is none."""
        try:
            manifest = self.checkout.install / name / "share" / name / "package.xml"
            outcome = self.checkout.workspace / "build" / name / "colcon_build.rc"
            return f"{outcome.stat().st_mtime_ns}" if manifest.is_file() and outcome.read_text().strip() == "0" else ""
        except OSError:
            return ""

    def _read(self) -> dict[str, dict]:
        try:
            entries = json.loads(self._stamp.read_text(encoding="utf-8"))
            return entries if isinstance(entries, dict) else {}
        except (OSError, ValueError):
            return {}

    def _write(self, entries: Mapping[str, dict]) -> None:
        self._stamp.parent.mkdir(parents=True, exist_ok=True)
        new = self._stamp.with_suffix(".new")
        new.write_text(json.dumps(entries, indent=1), encoding="utf-8")
        new.replace(self._stamp)


def staleness(last: Mapping | None, files: Files, key: str, result: str) -> str:
    """Why a package has to be built; empty if it has not.

    :param last: what was remembered of its last build
    :param result: mark of what is installed now
    """
    if not last or not result:
        return "not built yet"
    if last.get("key") != key:
        return "Python or ROS 2 changed"
    if last.get("result") != result:
        return "built by another command"
    before = last.get("files", {})
    changed = {name for name in before.keys() | files.keys() if before.get(name) != files.get(name)}
    return f"{len(changed)} file{'s' if len(changed) > 1 else ''} changed" if changed else ""


def build(state: Build, packages: Iterable[str], environ: Mapping[str, str], lock: int) -> None:
    """Build `packages`; call with the lock held.

    :raises BenchError: with the end of colcon's output
    """
    checkout, chosen = state.checkout, sorted(packages)
    unclean = [name for name in chosen if state.leaves_remains(name)]
    state.forget(chosen)
    for name in unclean:  # colcon copies over what is there
        for part in ("build", "install"):
            shutil.rmtree(checkout.workspace / part / name, ignore_errors=True)
    everything = len(chosen) == len(state.sources)
    run_step(
        "Building the workspace" if everything else f"Building {', '.join(chosen)}",
        [checkout.python, "-c", COLCON, "build", *([] if everything else ["--packages-select", *chosen])],
        log=checkout.logs / "build.log",
        environ=environ,
        cwd=checkout.workspace,
        remedy="Correct the named file, then call ./bench again.",
        describe=_describe_colcon,
        keep_open=[lock],
    )
    state.remember(chosen)


def _describe_colcon(line: str) -> str | None:
    match = re.match(r"(Starting >>>|Finished <<<|Failed\s+<<<) (\S+)", line)
    return f"{match[1].split()[0].lower()} {match[2]}" if match else None
