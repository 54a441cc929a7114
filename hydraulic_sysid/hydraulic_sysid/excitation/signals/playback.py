"""A drive read from a CSV file."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import RecordError
from hydraulic_sysid.excitation.declared import number, path, text
from hydraulic_sysid.excitation.errors import PlaybackError
from hydraulic_sysid.excitation.signals._base import Signal

TIME_COLUMN = "time_s"
DRIVE_COLUMNS = ("drive_V", "command_V")


@dataclass(frozen=True)
class Playback(Signal):
    """The drive of a CSV file (.csv or .csv.gz), each value held until the next one's time; 0 V after the last.

    Columns by header: `time_s` and `drive_V` (or `command_V`), others are passed over; without a header,
    exactly two columns: time [s], drive [V]. Times start anywhere and rise; they need not be regular.
    `sha256` is filled in when the file is read, so that a plan that was played names the very content.
    """

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

    :raises PlaybackError: no such columns, a value that is no finite number, or times that do not rise; names row and
        column.
    """
    from hydraulic_sysid.data.records.csv_file import CsvTable  # only here: few plans play a file back

    try:
        table = CsvTable(file)
        names = _columns(file, table.names, table.width)
        times, drives = (table.numbers(name) for name in names)
    except RecordError as error:
        raise PlaybackError(str(error)) from error
    for name, values in zip(names, (times, drives), strict=True):
        for index in np.flatnonzero(~np.isfinite(values))[:1]:
            where = f"{file}: row {table.row(index)}, column {table.label(name)}"
            raise PlaybackError(f"{where}: {values[index]} is not a finite number")
    for index in np.flatnonzero(np.diff(times) <= 0.0)[:1] + 1:
        where = f"{file}: row {table.row(index)}, column {table.label(names[0])}"
        raise PlaybackError(f"{where}: {times[index]:g} s does not come after {times[index - 1]:g} s")
    return times, drives


def _columns(file: Path, names: Sequence[str], width: int) -> tuple[str | int, str | int]:
    """The time and the drive column, by their names or, without a header, by their numbers."""
    if not names:
        if width != 2:
            raise PlaybackError(f"{file}: has {width} columns and no header; allowed without one: time [s], drive [V]")
        return 1, 2
    drive = next((name for name in DRIVE_COLUMNS if name in names), None)
    if TIME_COLUMN not in names or drive is None:
        needed = f"{TIME_COLUMN} and {' or '.join(DRIVE_COLUMNS)}"
        raise PlaybackError(f"{file}: header {', '.join(names)}; needed: {needed}")
    return TIME_COLUMN, drive
