"""Records as the page shows them: what they hold, and curves of their channels at any zoom."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_sysid import data
from hydraulic_sysid.data.decimation import envelope
from hydraulic_sysid.data.display import TITLES, shown
from hydraulic_sysid.data.records import Record, TimeError, read_records
from hydraulic_sysid.data.results import plain
from hydraulic_workbench.errors import UnknownError, WorkbenchError

MOST_POINTS = 20_000
MOST_MISSING = 0.05
RESAMPLE, SPLIT = (Path(data.__file__).with_name("columns") / f"{name}.yaml" for name in ("resample", "split"))
_KEPT = 6
_cache: OrderedDict[tuple[str, str, float], list[Record]] = OrderedDict()


def records_of(file: Path, columns: Path | None) -> list[Record]:
    """The records of a file or bag; the last few are kept, until their file changes."""
    key = str(file), str(columns or ""), _changed(file)
    if key not in _cache:
        _cache[key] = read_records(file, columns)
        while len(_cache) > _KEPT:
            _cache.popitem(last=False)
    _cache.move_to_end(key)
    return _cache[key]


def _changed(file: Path) -> float:
    inner = list(file.iterdir()) if file.is_dir() else []
    return max(one.stat().st_mtime for one in (file, *inner))


def describe(file: Path, columns: Path | None) -> dict[str, Any]:
    """Duration, sampling time, samples, channels, column map.

    A bag in which a few samples are missing is resampled, and says so.
    """
    try:
        found, lost = records_of(file, columns), []
    except TimeError:
        if columns is not None or not file.is_dir():
            raise
        found, columns = records_of(file, RESAMPLE), RESAMPLE
        missing = sum(map(len, found)) - sum(map(len, records_of(file, SPLIT)))
        if missing > MOST_MISSING * sum(map(len, found)):
            raise
        lost = [f"{missing} samples are missing and were interpolated"]
    first = found[0]
    event = first.description.get("experiment", {})
    plan = event.get("plan", {}) if isinstance(event, dict) else {}
    return {
        "duration": sum(r.duration for r in found),
        "sampling_time": first.dt,
        "samples": sum(map(len, found)),
        "channels": list(first.channels),
        "notes": [*lost, *first.notes],
        "columns": str(columns) if columns else None,
        "plan_name": plan.get("name") if isinstance(plan, dict) else None,
    }


def traces(
    file: Path, columns: Path | None, channels: Sequence[str], start: float | None, end: float | None, points: int
) -> dict[str, Any]:
    """Curves between two times; all samples where they are fewer than the points, else each bucket's extremes."""
    record = records_of(file, columns)[0]
    part, span = window(record, start, end)
    points = min(max(points, 10), MOST_POINTS)
    found = {name: curve(record, name, part, points) for name in list(channels) or list(record.channels)}
    return {**span, "decimated": part.stop - part.start > points, "channels": found}


def window(record: Record, start: float | None, end: float | None) -> tuple[slice, dict[str, float]]:
    """Samples between two times and one beyond each, and the times.

    :raises WorkbenchError: nothing lies there.
    """
    low = 0.0 if start is None else start
    high = record.duration if end is None else end
    first, last = np.searchsorted(record.time, (low - 1e-9, high + 1e-9))
    part = slice(max(int(first) - 1, 0), min(int(last) + 1, len(record)))
    if part.stop - part.start < 1 or high < low:
        raise WorkbenchError(f"nothing of {record.name} lies between {low:g} and {high:g} s", "from")
    return part, {"from": low, "to": high}


def curve(record: Record, name: str, part: slice, points: int) -> dict[str, Any]:
    """One channel: time, value, unit, and how it is shown.

    :raises UnknownError: the record has no such channel.
    """
    if name not in record:
        raise UnknownError(f"{record.name} has no channel {name!r}; it has {', '.join(record.channels)}", "channels")
    time, value = envelope(record.time[part], record[name][part], points // 2)
    return {"time": plain(time), "value": plain(value), **labels(name, record.unit(name))}


def labels(name: str, unit: str) -> dict[str, Any]:
    """Title, unit and display of a channel."""
    factor, display = shown(unit)
    return {"title": TITLES.get(name, name), "unit": unit, "display": {"factor": factor, "unit": display}}
