"""From the columns of a file to records: units, even time, absent channels."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import ColumnMapError, FileError, TimeError
from hydraulic_sysid.data.records import sampling
from hydraulic_sysid.data.records.channels import HELD
from hydraulic_sysid.data.records.column_map import Column, ColumnMap
from hydraulic_sysid.data.records.record import Record

_ANEW = ("name", "notes", "columns", "start_s", "stamp_deviation_s", "part")  # of a description: said anew when read
_WORTH_A_NOTE = 0.05  # of a period that stamps are off the even grid
_MOST_SAMPLES = 20_000_000  # of a resampled record


class Table(Protocol):
    """Named or numbered columns of numbers, read from one file."""

    path: Path
    description: Mapping[str, Any]
    """What the file says of the record, besides its channels."""

    @property
    def names(self) -> Sequence[str]:
        """Names of all columns; empty where they have none."""

    def numbers(self, column: str | int) -> Array:
        """``(N,)`` of a column; raises FileError if there is none or it holds something else."""

    def row(self, index: int) -> int:
        """Where sample ``index`` is in the file, as a user counts."""

    def label(self, column: str | int) -> str | int:
        """How to name a column to the user."""

    def own_map(self, base: ColumnMap | None = None) -> ColumnMap:
        """The map that the names of the columns state; ``base`` says the rest."""


@dataclass(frozen=True)
class Samples:
    """Channels with their stamps, before it is known that these are even.

    ``row`` gives the place of a sample in the file; ``column`` names the time there.
    """

    path: Path
    time: Array
    channels: Mapping[str, Array]
    row: Callable[[int], int]
    column: str | int
    units: Mapping[str, str] = field(default_factory=dict)
    held: Collection[str] = HELD


def records_of_table(table: Table, columns: ColumnMap | None, name: str) -> list[Record]:
    """One record per part of the map (more where it says to split at gaps); without one the table's own map.

    :raises ColumnMapError: without a map: a name that is no channel, or has a wrong unit.
    :raises FileError: a column is missing or holds a value that is not finite; names row and column.
    :raises TimeError: the time is not even, and the map does not say what to do then.
    """
    if columns is None or not columns.parts:
        columns = table.own_map(columns)
    records = []
    for part, mapped in columns.parts.items():
        notes = list(columns.notes)
        channels = {channel: _channel(table, column, columns) for channel, column in mapped.items()}
        title = f"{name}.{part}" if part else name
        kept = {key: value for key, value in table.description.items() if key not in _ANEW}
        notes += [n for n in table.description.get("notes", ()) if isinstance(n, str)]
        description: dict[str, Any] = {**kept, **({"columns": columns.name} if columns.name else {})}
        drive_from_command(channels, notes)
        given = {key: _setting(table, value) for key, value in columns.settings.items()}
        sizes = {values.size for values in channels.values()}
        if columns.dt is not None:
            if len(sizes) != 1 or min(sizes) < 2:
                raise FileError(table.path, f"columns have {sorted(sizes)} samples", expected="equal lengths ≥ 2")
            description["notes"] = notes
            for number, (first, last, own) in enumerate(pieces := _constant(given, min(sizes)), 1):
                stretch = {name: values[first:last] for name, values in channels.items()}
                whole = description | own
                label = f"{title}.{number}" if len(pieces) > 1 else title
                records.append(Record.sampled(label, columns.dt, stretch, table.path, whole, columns.units))
            continue
        assert columns.time is not None
        time = _finite(table, columns.time)
        if sizes != {time.size} or time.size < 2:
            problem = f"channels have {sorted(sizes)} samples, the time {time.size}"
            raise FileError(table.path, problem, expected="equal lengths, at least 2")
        place = table.label(columns.time.column)
        for number, (first, last, own) in enumerate(pieces := _constant(given, time.size), 1):
            stretch = {name: values[first:last] for name, values in channels.items()}
            row = partial(_row, table, first)
            held = {n for n, c in mapped.items() if (n in HELD if c.held is None else c.held)} | (HELD - mapped.keys())
            samples = Samples(table.path, time[first:last], stretch, row, place, columns.units, held)
            label = f"{title}.{number}" if len(pieces) > 1 else title
            records += evenly_sampled(samples, columns.irregular, label, notes, description | own, columns.step)
    return records


def _channel(table: Table, column: Column, columns: ColumnMap) -> Array:
    """Samples (N,) of a channel [SI], those of another file at the stamps of the first.

    :raises FileError: the other file is not there, or has no such column.
    :raises ColumnMapError: without a column of stamps the two do not belong together.
    """
    if column.file is None:
        return _finite(table, column)
    from hydraulic_sysid.data.records.formats import format_of  # which needs the errors of this package itself

    if columns.time is None:
        raise ColumnMapError(f"{columns.name}: {column.file}: a column of another file needs a time column in both")
    path = table.path.parent / column.file
    if not path.is_file():
        raise FileError(path, "does not exist")
    other: Table = format_of(path).table(path, columns)
    stamps, wanted = (_finite(one, columns.time) for one in (other, table))
    sampling.increasing(stamps)
    return np.interp(wanted, stamps, _finite(other, column))


def _row(table: Table, first: int, index: int) -> int:
    return table.row(first + index)


def _setting(table: Table, value: float | Column) -> float | Array:
    return _finite(table, value) if isinstance(value, Column) else value


def _constant(given: Mapping[str, float | Array], count: int) -> list[tuple[int, int, dict[str, Any]]]:
    """Stretches of samples over which all settings stay, and what a description says of them there."""
    if not given:
        return [(0, count, {})]
    varying = [values for values in given.values() if isinstance(values, np.ndarray)]
    changes = np.zeros(max(count - 1, 0), dtype=bool)
    for values in varying:
        changes |= np.diff(values) != 0.0
    bounds = [0, *(np.flatnonzero(changes) + 1).tolist(), count]
    found = []
    for first, last in zip(bounds, bounds[1:], strict=False):
        if last - first > 1:
            own = {key: float(v[first]) if isinstance(v, np.ndarray) else v for key, v in given.items()}
            found.append((first, last, {"settings": own}))
    return found


def evenly_sampled(
    samples: Samples, irregular: str, name: str, notes: list[str], description: Mapping[str, Any],
    step: float | None = None,
) -> list[Record]:  # fmt: skip
    """The samples as one record, or as several where ``irregular`` is "split" and samples are missing.

    :raises TimeError: the stamps do not increase, or are not even and ``irregular`` is "error".
    """
    time = samples.time
    try:
        sampling.increasing(time)
        if irregular == "resample":
            return [_resampled(samples, name, notes, description, step)]
        spans = [(0, time.size)]
        if irregular == "split":
            bounds = [0, *sampling.gaps(time), time.size]
            spans = [(a, b) for a, b in zip(bounds, bounds[1:], strict=False) if b - a > 1]
        return list(_records(samples, spans, name, notes, description))
    except sampling.IrregularTimeError as error:
        row = samples.row(error.index)
        hint = "; a column map can say time.irregular: resample or split" if irregular == "error" else ""
        raise TimeError(
            samples.path, error.problem, row=row, column=samples.column, expected=error.expected + hint
        ) from None


def drive_from_command(channels: dict[str, Array], notes: list[str]) -> None:
    """Where only the command was recorded, take it for the applied drive, and say so."""
    if "drive" not in channels and "command" in channels:
        channels["drive"] = channels["command"]
        notes.append("drive: not recorded; the command is taken for it")


def _records(
    samples: Samples, spans: Sequence[tuple[int, int]], name: str, notes: Sequence[str], description: Mapping[str, Any]
) -> Iterator[Record]:
    for number, (first, last) in enumerate(spans, 1):
        time = samples.time[first:last]
        try:
            even = sampling.sampling(time)
        except sampling.IrregularTimeError as error:
            raise sampling.IrregularTimeError(error.index + first, error.problem, error.expected) from None
        described = {
            **description,
            "notes": list(notes),
            "start_s": float(time[0]),
            "stamp_deviation_s": {"p99": even.deviation_p99, "max": even.deviation_max},
        }
        if even.deviation_p99 > _WORTH_A_NOTE * even.dt:
            off = f"99 % up to {even.deviation_p99:.3g} s, at most {even.deviation_max:.3g} s"
            described["notes"] = [*notes, f"time: stamps are off the even grid of {even.dt:.6g} s: {off}"]
        if len(spans) > 1:
            described["part"] = [number, len(spans)]
        channels = {channel: values[first:last] for channel, values in samples.channels.items()}
        title = f"{name}.{number}" if len(spans) > 1 else name
        yield Record.sampled(title, even.dt, channels, samples.path, described, samples.units)


def _resampled(
    samples: Samples, name: str, notes: Sequence[str], description: Mapping[str, Any], step: float | None = None
) -> Record:
    """On the even grid with this period, or the median one; drives hold their value, the rest is straight lines."""
    time = samples.time
    dt = step or float(f"{np.median(np.diff(time)):.9g}")
    span = float(time[-1] - time[0])
    if span > _MOST_SAMPLES * dt:
        problem = f"resampling {span:.6g} s every {dt:.6g} s makes more than {_MOST_SAMPLES} samples"
        raise sampling.IrregularTimeError(int(np.argmax(np.diff(time))) + 1, problem, "shorter gaps")
    count = int(span / dt + 1e-6) + 1
    grid = time[0] + dt * np.arange(count)
    before = np.clip(np.searchsorted(time, grid + 1e-6 * dt, side="right") - 1, 0, time.size - 1)
    channels = {
        channel: values[before] if channel in samples.held else np.interp(grid, time, values)
        for channel, values in samples.channels.items()
    }
    longest = float(np.diff(time).max())
    note = f"resampled from {time.size} irregular samples (longest step {longest:.6g} s) to dt = {dt:.9g} s"
    described = {**description, "notes": [*notes, note], "start_s": float(time[0])}
    return Record.sampled(name, dt, channels, samples.path, described, samples.units)


def _finite(table: Table, column: Column) -> Array:
    numbers = table.numbers(column.column)
    if not np.isfinite(numbers).all():
        index = int(np.flatnonzero(~np.isfinite(numbers))[0])
        raise FileError(
            table.path,
            f"value is {numbers[index]}",
            row=table.row(index),
            column=table.label(column.column),
            expected="a finite number",
        )
    values: Array = np.asarray(column.si(numbers), dtype=np.float64)
    return values
