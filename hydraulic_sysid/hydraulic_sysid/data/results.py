"""Results on disk: one JSON document per verb in a run's folder, written whole or not at all.

Every document begins with ``schema`` (``hydraulic_sysid.<verb>/<version>``), ``created`` and ``software``;
its content is described in docs/report-json.md. Numbers are SI; NaN and infinities are written as ``null``.
"""

from __future__ import annotations

import json
import math
import platform
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_node_utils.json_file import read_json
from hydraulic_node_utils.whole_file import write_text

FAMILY = "hydraulic_sysid."
PAGE = "report.html"
PAGE_MARK = "<!-- hydraulic_sysid report -->"
EVERY_DIGIT = 17
_DIGITS = 12
_DIGITS_IN_ARRAYS = 6
_LONG = 32


class ResultError(HydraulicError, ValueError):
    """A result cannot be read (not there, not JSON, unknown schema) or must not be written over."""


def heading(verb: str, version: int = 1) -> dict[str, Any]:
    """First entries of a result document."""
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    software = {"python": platform.python_version(), "numpy": np.__version__}
    try:
        software["hydraulic_sysid"] = installed("hydraulic_sysid")
    except PackageNotFoundError:
        software["hydraulic_sysid"] = "source tree"
    return {
        "schema": f"{FAMILY}{verb}/{version}",
        "created": datetime.now(timezone.utc).isoformat(timespec="milliseconds"),
        "software": software,
    }


def plain(value: Any, digits: int = _DIGITS) -> Any:
    """The same content in JSON's own types; what is not finite becomes None.

    Single numbers and short lists keep twelve significant digits (a transfer function with a pole at 1 needs
    them), arrays longer than ``_LONG`` six, which is finer than any sensor here; with `EVERY_DIGIT` nothing is rounded.
    """
    if isinstance(value, np.ndarray):
        short = _DIGITS_IN_ARRAYS if value.size > _LONG and digits < EVERY_DIGIT else digits
        if value.ndim == 1 and value.dtype.kind == "f":
            return [float(f"{v:.{short}g}") if math.isfinite(v) else None for v in value.tolist()]
        return plain(value.tolist(), short)
    if isinstance(value, dict):
        return {str(k): plain(v, digits) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v, digits) for v in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        number = float(value)
        return float(f"{number:.{digits}g}") if math.isfinite(number) else None
    if isinstance(value, np.integer):
        return int(value)
    return value if value is None or isinstance(value, int | str) else str(value)


def write_result(folder: Path, result: dict[str, Any]) -> Path:
    """Write ``<verb>.json`` into the folder, replacing an earlier one of the verb; other files stay untouched.

    :raises ResultError: if the folder's ``<verb>.json`` is something else than a result of that verb.
    """
    verb = verb_of(result)
    path = folder / f"{verb}.json"
    check_target(folder, verb)
    write_text(path, json.dumps(plain(result), allow_nan=False, ensure_ascii=False, separators=(",", ":")) + "\n")
    return path


def check_target(folder: Path, verb: str) -> None:
    """Find out before the work whether a verb may write into the folder.

    :raises ResultError: if the folder is a file, or holds a ``<verb>.json`` or page that this project did not
    write.
    """
    if folder.exists() and not folder.is_dir():
        raise ResultError(f"{folder} is not a folder: name a folder for the results")
    path = folder / f"{verb}.json"
    if path.exists() and verb_of(read_result(path)) != verb:
        raise ResultError(f"{path} is not a result of {verb}: move it away or choose another folder")
    check_page(folder)


def check_page(folder: Path) -> None:
    """Find out whether a page may be written into the folder.

    :raises ResultError: if its ``report.html`` is not a page of this project.
    """
    page = folder / PAGE
    if page.exists():
        with page.open(encoding="utf-8", errors="replace") as stream:
            if PAGE_MARK not in stream.read(400):
                raise ResultError(f"{page} is not a page of this project: move it away or choose another folder")


def verb_of(result: dict[str, Any]) -> str:
    """Which verb a result document came from, from its schema."""
    return str(result["schema"]).removeprefix(FAMILY).partition("/")[0]


def read_result(path: Path) -> dict[str, Any]:
    """One result document.

    :raises ResultError: not there, not JSON, or without this family's schema.
    """
    document = read_json(path, ResultError)
    schema = document.get("schema") if isinstance(document, dict) else None
    if not isinstance(schema, str) or not schema.startswith(FAMILY):
        raise ResultError(f"{path}: schema is {schema!r}, expected {FAMILY}<verb>/<version>")
    return document


def read_folder(path: Path) -> list[dict[str, Any]]:
    """The results in a run's folder (or the one result file), in the order in which a user makes them.

    :raises ResultError: if there is none.
    """
    if not path.exists():
        raise ResultError(f"{path} does not exist: name a folder with results, or one result's JSON file")
    if path.is_file():
        return [read_result(path)]
    found = []
    for candidate in sorted(path.glob("*.json")):
        try:
            found.append(read_result(candidate))
        except ResultError:
            continue  # a run's folder may hold other JSON
    if not found:
        raise ResultError(f"{path} holds no result: run calibrate, compare or identify with --out {path} first")
    return sorted(found, key=lambda r: str(r["created"]))
