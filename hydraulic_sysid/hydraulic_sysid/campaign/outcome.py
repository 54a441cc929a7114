"""A case, and what came of it: one JSON file each, whole or not there."""

from __future__ import annotations

import hashlib
import json
import os
import resource
import shutil
import socket
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_node_utils.whole_file import write_text
from hydraulic_sysid.data.results import plain

CASES = "cases"
DONE, FAILED = "done", "failed"
_KEY_LENGTH = 20


def digest(inputs: Any) -> str:
    """Key of a case: a hash of its inputs, which are JSON."""
    text = json.dumps(inputs, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:_KEY_LENGTH]


@dataclass(frozen=True)
class Case:
    """What one call of the work is given.

    ``key`` names its outcome; cases with equal inputs have equal keys. ``labels`` are its columns in tables (record,
    model, options). ``argument`` is what the work takes; it must be picklable.
    """

    key: str
    labels: Mapping[str, str]
    argument: Any


@dataclass(frozen=True)
class Outcome:
    """What came of a case: ``state`` "done" with a ``row`` of figures, or "failed" with an ``error``.

    ``seconds`` by the clock and of the processor; ``peak_mib`` is the most memory that its process has had so far.
    """

    key: str
    labels: Mapping[str, str]
    state: str
    row: Mapping[str, Any] = field(default_factory=dict)
    error: str = ""
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_mib: float = 0.0
    worker: str = ""

    @property
    def failed(self) -> bool:
        """Whether there is no result."""
        return self.state == FAILED


def file_of(folder: Path, key: str) -> Path:
    """Where the outcome of a case is kept."""
    return folder / CASES / f"{key}.json"


def keep(folder: Path, outcome: Outcome) -> None:
    """Write an outcome, whole."""
    write_text(file_of(folder, outcome.key), json.dumps(plain(asdict(outcome)), ensure_ascii=False) + "\n")


def kept(folder: Path, case: Case) -> Outcome | None:
    """The outcome of a case, with the labels that it has now; None where there is none that can be read."""
    try:
        found = json.loads(file_of(folder, case.key).read_text(encoding="utf-8"))
        return Outcome(**{**found, "labels": dict(case.labels)})
    except (OSError, ValueError, TypeError):
        return None


def attempt(work: Callable[[Any, Path], Mapping[str, Any]], case: Case, folder: Path) -> Outcome:
    """Do the work on a case and keep what came of it; runs in a worker.

    ``work(argument, place)`` returns a row of figures; ``place`` is a folder of the case's own, made if it is used,
    without what a killed attempt has left in it.
    """
    place = folder / CASES / case.key
    shutil.rmtree(place, ignore_errors=True)
    begun, busy = time.perf_counter(), time.process_time()
    row: Mapping[str, Any] = {}
    error = ""
    try:
        row = work(case.argument, place)
    except Exception as problem:
        error = f"{problem}" if isinstance(problem, CaseError) else traceback.format_exc()
    outcome = Outcome(
        key=case.key,
        labels=case.labels,
        state=FAILED if error else DONE,
        row=plain(row),
        error=error,
        seconds=time.perf_counter() - begun,
        cpu_seconds=time.process_time() - busy,
        peak_mib=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        worker=f"{socket.gethostname()}:{os.getpid()}",
    )
    keep(folder, outcome)
    return outcome


class CaseError(Exception):
    """The work says that a case has no result, and why; nothing is wrong with the program."""
