"""The binary message that carries samples to the page."""

from __future__ import annotations

import struct

import numpy as np

from hydraulic_workbench.sample_ring import Rows

SAMPLES = 1
_HEADER = struct.Struct("<BBHIII")


def samples_frame(epoch: int, sequence: int, rows: Rows) -> bytes:
    """Header (kind, columns, rows, epoch, number of the frame), times as f64, then the columns one after the other.

    Little endian; values are f32, NaN where nothing was measured.
    """
    columns, count = rows.values.shape
    header = _HEADER.pack(SAMPLES, 0, columns, count, epoch & 0xFFFFFFFF, sequence & 0xFFFFFFFF)
    times = np.ascontiguousarray(rows.time, "<f8").tobytes()
    return b"".join((header, times, np.ascontiguousarray(rows.values, "<f4").tobytes()))
