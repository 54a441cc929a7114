"""MATLAB files: every vector is a column. Version 4 to 7, and 7.3, which is HDF5."""

from __future__ import annotations

import io
from pathlib import Path

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import FileError
from hydraulic_sysid.data.records import hdf5_file
from hydraulic_sysid.data.records.column_map import ColumnMap
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.vectors import (
    DESCRIPTION,
    Vectors,
    columns_of,
    described,
    description_of,
    spread,
)

SUFFIXES = (".mat",)


def table(path: Path, columns: ColumnMap | None = None) -> Vectors:
    """The variables of a MATLAB file.

    :raises FileError: unreadable.
    """
    from scipy.io import loadmat

    if path.stat().st_size == 0:
        raise FileError(path, "the file is empty")
    try:
        variables = loadmat(str(path))
    except NotImplementedError:  # scipy's word for version 7.3
        return hdf5_file.table(path, columns)
    except MemoryError:
        raise FileError(path, "is damaged: it states sizes that do not fit in memory") from None
    except Exception as error:  # scipy lets through whatever it trips over in a damaged file
        raise FileError(path, f"no readable MATLAB file ({type(error).__name__}: {error})") from None
    found: dict[str, Array] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            spread(found, name, value)
    text = variables.get(DESCRIPTION)
    return Vectors(path, found, described(str(text[0]) if getattr(text, "size", 0) == 1 else None))


def content(record: Record) -> bytes:
    """A MATLAB file of version 5 with a column vector for the time and for each channel."""
    from scipy.io import savemat

    stream = io.BytesIO()
    variables = {name: values[:, None] for name, values in columns_of(record).items()}
    savemat(stream, {**variables, DESCRIPTION: description_of(record)}, do_compression=True)
    return stream.getvalue()
