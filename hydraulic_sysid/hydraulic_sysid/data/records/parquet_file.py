"""Parquet files: every column of numbers; stamps and durations become seconds from the first."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hydraulic_interfaces.errors import one_line
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import FileError
from hydraulic_sysid.data.records.channels import TIME
from hydraulic_sysid.data.records.column_map import ColumnMap
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.vectors import DESCRIPTION, Vectors, columns_of, described, description_of, spread

SUFFIXES = (".parquet", ".pq")


def table(path: Path, columns: ColumnMap | None = None) -> Vectors:
    """The columns of a Parquet file; a gap in one is NaN.

    :raises FileError: unreadable.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        read = pq.read_table(path)
        found: dict[str, Array] = {}
        for name, column in zip(read.column_names, read.columns, strict=True):
            if pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type):
                unit = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[column.type.unit]
                counts = np.asarray(column.cast(pa.int64()).to_numpy())
                spread(found, f"{TIME}_s" if name == TIME else name, (counts - counts[0]) * unit)
            elif pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
                spread(found, name, np.asarray(column.to_numpy()))
        metadata = read.schema.metadata or {}
    except Exception as error:  # of a damaged file the library lets through whatever it trips over
        raise FileError(path, f"no readable Parquet file ({one_line(error, 200)})") from None
    return Vectors(path, found, described(metadata.get(DESCRIPTION.encode())))


def content(record: Record) -> bytes:
    """A Parquet file with a column for the time and for each channel."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    made = pa.table(columns_of(record)).replace_schema_metadata({DESCRIPTION: description_of(record)})
    sink = pa.BufferOutputStream()
    pq.write_table(made, sink, compression="zstd")
    return bytes(sink.getvalue())
