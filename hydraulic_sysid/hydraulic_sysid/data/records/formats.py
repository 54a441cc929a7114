"""The kinds of files that hold a record as a table, each a module with ``SUFFIXES``, ``table`` and ``content``."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from hydraulic_sysid.data.errors import FileError
from hydraulic_sysid.data.records import csv_file, hdf5_file, json_file, mat_file, parquet_file

FORMATS: tuple[ModuleType, ...] = (csv_file, mat_file, hdf5_file, parquet_file, json_file)
SUFFIXES: tuple[str, ...] = tuple(suffix for f in FORMATS for suffix in f.SUFFIXES)


def suffix_of(path: Path) -> str:
    """The suffix of a table's file, the longest that fits; empty where it is none of `SUFFIXES`."""
    name = path.name.lower()
    return max((s for s in SUFFIXES if name.endswith(s)), key=len, default="")


def format_of(path: Path) -> ModuleType:
    """The module that reads and writes such files.

    :raises FileError: a suffix that is none of `SUFFIXES`.
    """
    suffix = suffix_of(path)
    for module in FORMATS:
        if suffix in module.SUFFIXES:
            return module
    raise FileError(path, "is of no known kind", expected=f"a file {', '.join(SUFFIXES)}")
