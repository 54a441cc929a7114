"""Following a folder of bags: the verb `monitor`, called again in a process of its own whenever a bag is complete.

A process of its own, at low priority and with one thread: fitting bags must not take a bench's processors.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from typing import Any

from hydraulic_node_utils.json_file import read_json
from hydraulic_sysid.data.bag.metadata import FILE_NAME
from hydraulic_sysid.data.errors import FileError, RecordError

DOCUMENT, LOG = "monitor.json", "monitor.log"


@dataclass(frozen=True)
class Row:
    """What is told of one parameter, or of all (``name`` empty): a sentence, whether it needs looking at, figures."""

    name: str
    text: str
    changed: bool
    figures: Mapping[str, object]


def complete(pattern: str) -> list[Path]:
    """Bags and files that match, in the order of their names, without bags that are still recorded."""
    found = [Path(path) for path in sorted(glob(os.path.expanduser(pattern)))]
    return [path for path in found if path.is_file() or (path / FILE_NAME).is_file()]


class Follower:
    """Calls `monitor` for the complete bags of a pattern; `poll` starts it, and takes what it has found.

    ``options`` of the verb besides the bags and the folder. ``problem`` says why the last call gave nothing.
    """

    def __init__(self, pattern: str, folder: Path, options: Sequence[str], niceness: int = 10) -> None:
        if not pattern:
            raise FileError("bags", "is empty", expected="a pattern such as 'bags/*'")
        self._pattern, self._folder, self._options = pattern, folder, list(options)
        self._niceness = niceness
        self._process: subprocess.Popen[bytes] | None = None
        self._seen: list[tuple[Path, int]] = []
        self.bags = 0
        self.problem = ""

    @property
    def busy(self) -> bool:
        """Whether bags are being fitted now."""
        return self._process is not None

    def poll(self) -> dict[str, Any] | None:
        """Go on: start where there are new bags; the document where one has just been made, else None."""
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                return None
            self._process = None
            return self._ended(code)
        bags = complete(self._pattern)
        now = [(bag, bag.stat().st_mtime_ns) for bag in bags]
        if bags and now != self._seen:
            self._seen = now
            self._start(bags)
        return None

    def _start(self, bags: Sequence[Path]) -> None:
        self.bags = len(bags)
        command = [sys.executable, "-m", "hydraulic_sysid", "monitor", *self._options]
        command += ["--record", *map(str, bags), "--out", str(self._folder), "--workers", "1", "--json"]
        environment = {**os.environ, "HYDRAULIC_THREADS": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._folder.mkdir(parents=True, exist_ok=True)
        with (self._folder / LOG).open("wb") as log:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=log, start_new_session=True,
                env=environment,
            )  # fmt: skip
        os.setpriority(os.PRIO_PROCESS, self._process.pid, self._niceness)

    def _ended(self, code: int) -> dict[str, Any] | None:
        if code in (0, 1):  # 1: something has changed
            self.problem = ""
            try:
                return dict(read_json(self._folder / DOCUMENT, RecordError))
            except RecordError as error:
                self.problem = str(error)
                return None
        said = (self._folder / LOG).read_text(encoding="utf-8", errors="replace").strip()
        self.problem = said.rpartition("\n")[2] or f"the fit ended with exit code {code}"
        return None

    def close(self) -> None:
        """End what is running."""
        if self._process is not None:
            for number in (signal.SIGTERM, signal.SIGKILL):
                try:
                    os.killpg(self._process.pid, number)
                    self._process.wait(timeout=5.0)
                    break
                except (ProcessLookupError, subprocess.TimeoutExpired):
                    continue
            self._process = None


def rows(document: Mapping[str, Any]) -> list[Row]:
    """What a document of `monitor` says: of all parameters together, then of each."""
    failed = [b["name"] for b in document["bags"] if b["state"] != "done"]
    figures: dict[str, object] = {"bags": len(document["bags"]), "not_fitted": ", ".join(failed) or "none"}
    found = [Row("", document["verdict"]["text"], bool(document["changed"]), figures)]
    for parameter in document["parameters"]:
        alarm, trend, forecast = parameter["alarm"], parameter["trend"], parameter["forecast"]
        told: dict[str, object] = {
            "value": f"{parameter['values'][-1]:.6g}",
            "standard_error": f"{parameter['errors'][-1]:.3g}",
            "unit": parameter["unit"],
            "bag": parameter["bags"][-1],
        }
        text = "no change"
        if alarm:
            text = f"changed since {alarm['onset']}: {alarm['before']:.4g} → {alarm['after']:.4g} {parameter['unit']}"
            told |= {"changed_since": alarm["onset"], "before": f"{alarm['before']:.6g}", "wear": parameter["wear"]}
        if trend:
            told["slope"] = f"{trend['slope']:.4g} {parameter['unit']}/{document['time_unit']}"
        if forecast:
            told |= {"limit": f"{parameter['limit']:.6g}", "limit_reached_at": f"{forecast['time']:.6g}"}
        found.append(Row(parameter["key"], text, bool(alarm), told))
    return found
