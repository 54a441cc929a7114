"""A drive read from a CSV file."""

from __future__ import annotations

import csv
import gzip
import hashlib
import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.errors import PlaybackError
from hydraulic_sysid.excitation.settings import number, path, text
from hydraulic_sysid.excitation.signals._base import Signal

TIME_COLUMN = "time_s"
DRIVE_COLUMNS = ("drive_V", "command_V")


@dataclass(frozen=True)
class Playback(Signal):
    """The drive of a CSV file (.csv or .csv.gz), each value held until the next one's time; 0 V after the
    last.

    Columns by header: `time_s` and `drive_V` (or `command_V`), others are passed over; without a header,
    exactly two columns: time [s], drive [V]. Times start anywhere and rise; they need not be regular.
    `sha256` is filled in when the file is read, so that a plan that was played names the very content.
    """

    label = "playback"

    file: str = path("the CSV file")
    gain: float = number("", "factor on the drive", 1.0, minimum=-100.0, maximum=100.0)
    sha256: str = text("digest of the file's content; empty: any", "")

    def check(self) -> None:
        try:
            content = Path(self.file).read_bytes()
        except OSError as error:
            raise PlaybackError(f"{self.file}: cannot be read: {error.strerror}") from error
        digest = hashlib.sha256(content).hexdigest()
        if self.sha256 not in ("", digest):
            raise self.error("sha256", self.sha256, f"{digest}, which is what {self.file} has now")
        object.__setattr__(self, "sha256", digest)
        if abs(self.gain) * np.abs(self._table[1]).max() > DRIVE_LIMIT_V:
            raise self.error("gain", self.gain, f"a factor that keeps the drive within ±{DRIVE_LIMIT_V:g} V")

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        times, drives = read_drive(Path(self.file))
        return times - times[0], drives

    def scaled(self, factor: float) -> Playback:
        return replace(self, gain=factor * self.gain)

    @property
    def size(self) -> float:
        return float(abs(self.gain) * np.abs(self._table[1]).max())

    @property
    def length(self) -> float:
        times = self._table[0]
        return float(times[-1] + np.median(np.diff(times)))  # the last value stands as long as the others

    def sample(self, t: Array) -> Array:
        times, drives = self._table
        slack = 1e-9 * max(times[-1], 1.0)
        at = np.asarray(t) + slack
        held = self.gain * drives[np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)]
        return np.where((at >= 0.0) & (at < self.length), held, 0.0)


def read_drive(file: Path) -> tuple[Array, Array]:
    """Times [s] and drive [V], (N,) each, N ≥ 2, of a CSV file.

    Raises:
        PlaybackError: no such columns, a value that is no finite number, or times that do not rise;
            names row and column.
    """
    times: list[float] = []
    drives: list[float] = []
    try:
        with gzip.open(file, "rt", newline="") if file.suffix == ".gz" else open(file, newline="") as stream:
            rows = csv.reader(stream)
            columns: list[tuple[int, str]] | None = None
            for row in rows:
                if not row or (columns is None and row[0].lstrip().startswith("#")):
                    continue
                if columns is None:
                    columns, is_header = _columns(file, [cell.strip() for cell in row])
                    if is_header:
                        continue
                time, drive = (_number(file, rows.line_num, row, *column) for column in columns)
                if times and time <= times[-1]:
                    where = f"{file}: row {rows.line_num}, column {columns[0][1]}"
                    raise PlaybackError(f"{where}: {time:g} s does not come after {times[-1]:g} s")
                times.append(time)
                drives.append(drive)
    except (OSError, EOFError, UnicodeDecodeError, csv.Error) as error:
        raise PlaybackError(f"{file}: is not a readable CSV file: {error}") from error
    if len(times) < 2:
        raise PlaybackError(f"{file}: has {len(times)} rows of numbers; at least 2 are needed")
    return np.array(times), np.array(drives)


def _columns(file: Path, row: list[str]) -> tuple[list[tuple[int, str]], bool]:
    """Index and name of the time and the drive column, and whether `row` is a header."""
    if not any(cell[:1].isalpha() for cell in row):
        if len(row) != 2:
            raise PlaybackError(
                f"{file}: has {len(row)} columns and no header; allowed without one: time [s], drive [V]"
            )
        return [(0, "1 (time)"), (1, "2 (drive)")], False
    drive = next((name for name in DRIVE_COLUMNS if name in row), None)
    if TIME_COLUMN not in row or drive is None:
        needed = f"{TIME_COLUMN} and {' or '.join(DRIVE_COLUMNS)}"
        raise PlaybackError(f"{file}: header {', '.join(row)}; needed: {needed}")
    return [(row.index(TIME_COLUMN), TIME_COLUMN), (row.index(drive), drive)], True


def _number(file: Path, line: int, row: list[str], index: int, name: str) -> float:
    if index >= len(row):
        raise PlaybackError(f"{file}: row {line} has {len(row)} columns; column {name} is missing")
    try:
        value = float(row[index])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlaybackError(f"{file}: row {line}, column {name}: {row[index]!r} is not a finite number")
    return value
