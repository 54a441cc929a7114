"""The last minutes of all columns on the time of `state`: rows come with the state, other topics fill them in."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.arrays import Array

Stamps = NDArray[np.int64]
Values = NDArray[np.float32]


@dataclass(frozen=True)
class Rows:
    """Rows from number ``first`` on: seconds since the base ``(N,)``, values ``(C, N)``."""

    first: int
    time: Array
    values: Values


class SampleRing:
    """Keeps ``capacity`` rows of ``columns`` values; may be filled and read from different threads.

    Rows are numbered from 0 within an epoch. A new epoch begins where the stamps go back: another plant, or another
    clock. What arrives for an instant that has no row yet waits for it; what belongs to none is counted.
    """

    def __init__(self, capacity: int, columns: int, longest_wait_ns: int) -> None:
        self._capacity, self._columns, self._longest_wait_ns = capacity, columns, longest_wait_ns
        self._lock = threading.Lock()
        # Twice the room: the last half moves to the front when the end is reached, so that rows lie side by side.
        # Written to at once: the memory of an empty array is only taken as it fills, over minutes.
        self._stamps: Stamps = np.full(2 * capacity, -1, np.int64)
        self._values: Values = np.full((columns, 2 * capacity), np.nan, np.float32)
        self.epoch, self.base_ns, self.unmatched = 0, 0, 0
        self._begin(0)

    def _begin(self, base_ns: int) -> None:
        self.epoch += 1
        self.base_ns = base_ns
        self._first = self._count = 0  # number of the row at index 0, rows in use
        self._reached: dict[int, int] = {}  # first column of a topic → stamp up to which it has come
        self._early: dict[int, tuple[Sequence[int], Stamps, Values]] = {}

    def append(self, columns: Sequence[int], stamps: Stamps, values: Values) -> None:
        """Rows of the state: stamps ``(N,)``, values ``(len(columns), N)``. What goes back begins a new epoch."""
        if not stamps.size:
            return
        with self._lock:
            back = np.flatnonzero(np.diff(stamps) <= 0)
            start = int(back[-1]) + 1 if back.size else 0
            stamps, values = stamps[start:], values[:, start:]
            if start or not self._count or stamps[0] <= self._stamps[self._count - 1]:
                self._begin(int(stamps[0]))
            stamps, values = stamps[-self._capacity :], values[:, -self._capacity :]
            self._make_room(stamps.size)
            rows = slice(self._count, self._count + stamps.size)
            self._stamps[rows] = stamps
            self._values[:, rows] = np.nan
            self._values[list(columns), rows] = values
            self._count += stamps.size
            early, self._early = self._early, {}
        for waiting in early.values():
            self.fill(*waiting)

    def fill(self, columns: Sequence[int], stamps: Stamps, values: Values) -> None:
        """Values of another topic, each for the row at its stamp or the last one before it."""
        if not stamps.size:
            return
        with self._lock:
            if not self._count:
                return
            known = self._stamps[: self._count]
            last = int(known[-1])
            at = np.searchsorted(known, stamps, side="right") - 1
            there = (at >= 0) & (stamps <= last)
            late = stamps > last
            if late.any():
                near = late & (stamps - last < self._longest_wait_ns)
                self._early[columns[0]] = (columns, stamps[near], values[:, near])
            self.unmatched += int(np.count_nonzero(~there & ~late))
            self._values[np.array(columns)[:, None], at[there]] = values[:, there]
            self._reached[columns[0]] = int(stamps.max())

    def _make_room(self, rows: int) -> None:
        if self._count + rows <= self._stamps.size:
            return
        keep = min(self._capacity, self._stamps.size - rows, self._count)
        start = self._count - keep
        self._stamps[:keep] = self._stamps[start : self._count]
        for column in self._values:  # one by one: the heap keeps the room of a copy of all
            column[:keep] = column[start : self._count]
        self._first, self._count = self._first + start, keep

    def complete(self, awaited: Sequence[int]) -> int:
        """Number of the first row that still waits for one of the topics (by their first columns), but not for long."""
        with self._lock:
            if not self._count:
                return self._first
            known = self._stamps[: self._count]
            limit = min((self._reached.get(first, 0) for first in awaited), default=int(known[-1]))
            limit = max(limit, int(known[-1]) - self._longest_wait_ns)
            return self._first + int(np.searchsorted(known, limit, side="right"))

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest row; 0 where there is none."""
        with self._lock:
            return int(self._stamps[self._count - 1]) if self._count else 0

    def newest(self, column: int) -> float | None:
        """Value of a column in the newest row; None where there is none."""
        with self._lock:
            value = float(self._values[column, self._count - 1]) if self._count else float("nan")
        return value if value == value else None

    def rows(self, first: int, end: int) -> Rows:
        """Rows ``first`` … ``end`` of this epoch, as far as they are still kept."""
        with self._lock:
            first = min(max(first, self._first), self._first + self._count)
            end = min(max(end, first), self._first + self._count)
            part = slice(first - self._first, end - self._first)
            time = np.asarray((self._stamps[part] - self.base_ns) * 1e-9, np.float64)
            return Rows(first, time, self._values[:, part].copy())

    def number_at(self, seconds_ago: float, end: int) -> int:
        """Number of the first row that lies at most so many seconds before row ``end``."""
        with self._lock:
            index = min(end - self._first, self._count)
            if index <= 0:
                return self._first
            stamp = int(self._stamps[index - 1]) - round(seconds_ago * 1e9)
            return self._first + int(np.searchsorted(self._stamps[:index], stamp))
