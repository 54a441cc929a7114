"""Serialised messages of one stream to stamps and values, a batch at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hydraulic_sysid.data.bag import cdr
from hydraulic_workbench.columns import Column
from hydraulic_workbench.sample_ring import Stamps, Values

_SECOND = 1_000_000_000


class StreamDecoder:
    """Decodes the messages of one topic; the layout is found once, as messages of a stream differ only in numbers."""

    def __init__(self, kind: str, columns: Sequence[Column]) -> None:
        self._kind, self._columns = kind, columns
        self._layout: cdr.Layout | None = None
        self._size = 0
        self._fixed: NDArray[np.uint8] = np.empty(0, np.uint8)
        self.refused = 0

    def __call__(self, payloads: Sequence[bytes]) -> tuple[Stamps, Values]:
        """Stamps ``(N,)`` [ns] and values ``(columns, N)``; messages that are none of this type are left out, counted.

        A field that is shorter than the contract says is NaN.
        """
        rows = self._like_before(payloads)
        if rows is not None and self._layout is not None:
            return self._take(self._layout, rows)
        parts = [self._one(payload) for payload in payloads]
        known = [part for part in parts if part is not None]
        self.refused += len(parts) - len(known)
        if not known:
            return np.empty(0, np.int64), np.empty((len(self._columns), 0), np.float32)
        return np.concatenate([s for s, _ in known]), np.concatenate([v for _, v in known], axis=1)

    def _like_before(self, payloads: Sequence[bytes]) -> NDArray[np.uint8] | None:
        """The messages as rows of bytes, if all have the layout that is known."""
        if self._layout is None or any(len(p) != self._size for p in payloads):
            return None
        rows = np.frombuffer(b"".join(payloads), np.uint8).reshape(len(payloads), -1)
        return rows if bool((rows[:, self._layout.fixed] == self._fixed).all()) else None

    def _one(self, payload: bytes) -> tuple[Stamps, Values] | None:
        try:
            layout = cdr.layout(self._kind, payload)
        except cdr.CdrError:
            return None
        row = np.frombuffer(payload, np.uint8)
        self._layout, self._size, self._fixed = layout, len(payload), row[layout.fixed]
        return self._take(layout, row[None, :])

    def _take(self, layout: cdr.Layout, rows: NDArray[np.uint8]) -> tuple[Stamps, Values]:
        seconds = _numbers(layout, rows, "header.stamp.sec", None)
        nanoseconds = _numbers(layout, rows, "header.stamp.nanosec", None)
        assert seconds is not None and nanoseconds is not None  # every stream of the contract is stamped
        stamps = seconds.astype(np.int64) * _SECOND + nanoseconds.astype(np.int64)
        values = np.full((len(self._columns), len(rows)), np.nan, np.float32)
        for index, column in enumerate(self._columns):
            found = _numbers(layout, rows, column.field, column.place)
            if found is not None:
                values[index] = found
        return stamps, values


def _numbers(layout: cdr.Layout, rows: NDArray[np.uint8], field: str, place: int | None) -> NDArray | None:
    known = layout.numbers.get(field)
    if known is None or (place is not None and place >= (known.count or 0)):
        return None
    start = known.offset + known.dtype.itemsize * (place or 0)
    part = np.ascontiguousarray(rows[:, start : start + known.dtype.itemsize])
    return part.view(known.dtype)[:, 0]
