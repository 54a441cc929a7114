"""Result documents and the report's figures, for the page."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_sysid.data.decimation import envelope
from hydraulic_sysid.data.display import TITLES
from hydraulic_sysid.data.results import plain, read_folder, verb_of
from hydraulic_workbench.errors import UnknownError, WorkbenchError

BULKY = ("spectra", "error_growth", "spectrum", "lag", "cross_lag", "autocorrelation",
         "exact_autocorrelation", "cross_correlation", "software", "description")  # fmt: skip
"""Entries that only figures need, where they are more than a text; those that the page draws itself stay."""
SAMPLES = "samples.npz"


def _results(folder: Path) -> list[dict[str, Any]]:
    return _read(folder, max(f.stat().st_mtime for f in (folder, *folder.glob("*.json"))))


@lru_cache(maxsize=4)
def _read(folder: Path, changed: float) -> list[dict[str, Any]]:
    return read_folder(folder)


def summary(folder: Path) -> dict[str, Any]:
    """Verb and verdict of a run."""
    last = _results(folder)[-1]
    verdict = last.get("verdict")
    text = verdict.get("text", "") if isinstance(verdict, dict) else ""
    return {"verb": verb_of(last), "verdict": text}


def document(folder: Path, whole: bool) -> dict[str, Any]:
    """The last result of a run, and which ``model_files`` lie beside it."""
    found = _results(folder)[-1]
    files = sorted(file.name for file in (*folder.glob("model.yaml"), *folder.glob("competing_*.yaml")))
    found = {**found, "model_files": files}
    if whole:
        return found
    slim: dict[str, Any] = _without(found)
    if verb_of(found) == "compare":  # as large as the records
        slim["records"] = [{k: v for k, v in r.items() if k not in ("traces", "drive")} for r in slim["records"]]
    return slim


def _without(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without(v) for k, v in value.items() if k not in BULKY or isinstance(v, str)}
    return [_without(v) for v in value] if isinstance(value, list) else value


@lru_cache(maxsize=2)
def _figures(folder: Path, changed: float) -> list[tuple[str, Any]]:
    from hydraulic_sysid.report.page import figures_of  # takes long to import, and the server itself needs none

    return [pair for result in _read(folder, changed) for pair in figures_of(result)]


def _known(folder: Path) -> list[tuple[str, Any]]:
    return _figures(folder, max(f.stat().st_mtime for f in (folder, *folder.glob("*.json"))))


def figures(folder: Path) -> list[dict[str, Any]]:
    """The figures of a run's page: names and titles."""
    return [
        {"name": str(number), "title": title, "height": int(figure.layout.height or 400)}
        for number, (title, figure) in enumerate(_known(folder))
    ]


def figure(folder: Path, name: str) -> str:
    """One figure as Plotly's JSON.

    :raises UnknownError: there is none of that name.
    """
    known = _known(folder)
    if not name.isdigit() or int(name) >= len(known):
        raise UnknownError(f"there is no figure {name!r}; there are 0 … {len(known) - 1}", "figure")
    return str(known[int(name)][1].to_json())


def samples(folder: Path, channel: str, variable: str, low: float, high: float, points: int) -> dict[str, Any]:
    """The samples of a comparison at which a variable is at least ``low`` and below ``high``: where, and their errors.

    :raises WorkbenchError: the run has kept no samples, or not of these.
    """
    file = folder / SAMPLES
    if not file.is_file():
        raise WorkbenchError("this run has kept no samples: compare once more")
    compared = [result for result in _results(folder) if verb_of(result) == "compare"]
    names = [record["name"] for result in compared for record in result["records"]]
    segments: list[dict[str, Any]] = []
    rows: list[Any] = []
    with np.load(file) as kept:
        for index, name in enumerate(names):
            keys = f"{index}/time", f"{index}/error/{channel}", f"{index}/variable/{variable}"
            if any(key not in kept for key in keys):
                raise WorkbenchError(f"{name} has no {channel} over {variable}", "channel")
            time, error, value = (kept[key] for key in keys)
            inside = (value >= low) & (value < high) & np.isfinite(error)
            segments += _segments(name, time, inside)
            rows.append((index, time[inside], error[inside], value[inside]))
    segments.sort(key=lambda s: -s["count"])
    total = sum(time.size for _, time, _, _ in rows)
    found = _thinned(rows, max(points // max(len(rows), 1), 50))
    titles = [TITLES.get(name, name.replace("_", " ")) for name in (channel, variable)]
    text = f"{total} samples of {titles[0]} with {titles[1]} in that range"
    return plain({"segments": segments[:200], "samples": found, "count": total, "text": text})


def _segments(name: str, time: Any, inside: Any) -> list[dict[str, Any]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(np.int8)))
    return [
        {"record": name, "from": float(time[a]), "to": float(time[b - 1]), "count": int(b - a)}
        for a, b in edges.reshape(-1, 2).tolist()
    ]


def _thinned(rows: list[Any], points: int) -> dict[str, Any]:
    found: dict[str, list[Any]] = {"record": [], "time": [], "error": [], "value": []}
    for index, time, error, value in rows:
        kept, shown = envelope(time, error, points // 2)
        found["record"] += [index] * kept.size
        found["time"] += kept.tolist()
        found["error"] += shown.tolist()
        found["value"] += np.interp(kept, time, value).tolist() if time.size else []
    return found
