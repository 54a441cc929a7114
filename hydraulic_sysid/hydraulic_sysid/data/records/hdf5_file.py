"""HDF5 files: every vector is a column, called by its path; an attribute ``unit`` or ``units`` says its unit."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.errors import one_line
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import FileError
from hydraulic_sysid.data.records.channels import CHANNELS, TIME
from hydraulic_sysid.data.records.column_map import ColumnMap
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.vectors import DESCRIPTION, Vectors, columns_of, described, description_of, spread

SUFFIXES = (".h5", ".hdf5", ".hdf")
_UNIT = ("unit", "units")


def table(path: Path, columns: ColumnMap | None = None) -> Vectors:
    """The datasets of a file, those in groups included; a table of records gives its fields.

    :raises FileError: unreadable.
    """
    import h5py

    found: dict[str, Array] = {}

    def add(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):  # "#refs#": MATLAB's own
            return
        if item.dtype.names:
            for field in item.dtype.names:
                spread(found, f"{name}/{field}", np.asarray(item[field]))
        elif item.dtype.kind in "fiub" and item.ndim <= 2:  # pictures and the like are not even read
            spread(found, _header(name, item), np.asarray(item))

    try:
        with h5py.File(path, "r") as file:
            file.visititems(add)
            return Vectors(path, found, described(file.attrs.get(DESCRIPTION)))
    except Exception as error:  # of a damaged file the library lets through whatever it trips over
        raise FileError(path, f"no readable HDF5 file ({one_line(error, 200)})") from None


def _header(name: str, item: Any) -> str:
    """A dataset's path, with the unit of its attribute where the name is a bare channel's."""
    unit = next((text for key in _UNIT if (text := item.attrs.get(key))), None)
    text = unit.decode(errors="replace") if isinstance(unit, bytes) else unit
    bare = name.rpartition("/")[2] in (TIME, *CHANNELS)
    return f"{name}_{text}" if bare and isinstance(text, str) else name


def content(record: Record) -> bytes:
    """An HDF5 file with one dataset for the time and for each channel."""
    import h5py

    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs[DESCRIPTION] = description_of(record)
        for name, values in columns_of(record).items():
            file.create_dataset(name, data=values, compression="gzip", shuffle=True, track_times=False)
    return stream.getvalue()
