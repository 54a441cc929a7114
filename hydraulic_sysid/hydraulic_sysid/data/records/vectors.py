"""Tables in which each column is a vector with a name: variables, datasets or columns of a file of numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_node_utils.json_file import json_object
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import ColumnMapError, FileError
from hydraulic_sysid.data.records.channels import TIME_UNIT
from hydraulic_sysid.data.records.column_map import Column, ColumnMap, column_of_header, named_columns
from hydraulic_sysid.data.records.record import Record

DESCRIPTION = "description"
"""Under this name a file keeps a record's description, as JSON."""


class Vectors:
    """The vectors of a file by name, and what the file says of the record.

    Such files often hold more than one experiment's channels: names that are no channel are left out.
    """

    def __init__(self, path: Path, columns: Mapping[str, Array], description: Mapping[str, Any] | None = None) -> None:
        self.path = path
        self.description = dict(description or {})
        self._columns = dict(columns)

    @property
    def names(self) -> Sequence[str]:
        """Names of all columns."""
        return list(self._columns)

    def own_map(self, base: ColumnMap | None = None) -> ColumnMap:
        """The map of vectors called ``<channel>_<unit>``; others are left out. ``base`` says the rest.

        :raises ColumnMapError: no time, no channel, or one that is there twice.
        """
        found: dict[str, Column] = {}
        for name in self._columns:
            try:
                quantity, column = column_of_header(name.rpartition("/")[2])
            except ColumnMapError:
                continue
            if quantity in found:
                raise ColumnMapError(f"{self.path}: {found[quantity].column} and {name} are both {quantity}; say by a "
                                     "column map which one is meant")  # fmt: skip
            found[quantity] = replace(column, column=name)
        columns = named_columns(found, base)
        if (columns.time is None and columns.dt is None) or not columns.parts[""]:
            there = ", ".join(self._columns) or "none"
            raise ColumnMapError(
                f"{self.path}: no vectors time_s and <channel>_<unit>; there are {there}; "
                "say by a column map what they are"
            )
        return columns

    def numbers(self, column: str | int) -> Array:
        """``(N,)`` numbers of a vector; `FileError` where it is missing."""
        name = self._name(column)
        return np.asarray(self._columns[name], dtype=np.float64)

    def row(self, index: int) -> int:
        """Sample counted from 1."""
        return index + 1

    def label(self, column: str | int) -> str | int:
        """Name of the vector."""
        return self._name(column)

    def _name(self, column: str | int) -> str:
        if isinstance(column, int) and column <= len(self._columns):
            return self.names[column - 1]
        if column not in self._columns:
            there = ", ".join(self._columns) or "no vectors"
            raise FileError(self.path, f"no vector {column!r}; there are {there}")
        return str(column)


def spread(columns: dict[str, Array], name: str, value: Any) -> None:
    """Put an array of a file among the columns: a vector under its name, a matrix as ``name.1``, ``name.2`` and so on.

    What holds no real numbers, or one alone, is left out.
    """
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub" or value.size < 2:
        return
    if value.ndim == 1 or (value.ndim == 2 and 1 in value.shape):
        columns[name] = value.ravel()
    elif value.ndim == 2:
        columns |= {f"{name}.{index}": column for index, column in enumerate(value.T, start=1)}


def described(text: object) -> dict[str, Any]:
    """The description that a file keeps as JSON; empty where there is none."""
    found = json_object(text) if isinstance(text, str | bytes) else {}
    return found if isinstance(found.get("notes", []), list) else {}


def header(record: Record, channel: str) -> str:
    """``<channel>_<unit>`` in letters that every program takes for a name (metres per second: mps)."""
    unit = re.sub(r"\W", "_", record.unit(channel).replace("m/s", "mps"))
    return f"{channel}_{unit}"


def columns_of(record: Record) -> dict[str, Array]:
    """A record's time and channels under their headers."""
    return {f"time_{TIME_UNIT}": record.time, **{header(record, name): v for name, v in record.channels.items()}}


def description_of(record: Record) -> str:
    """A record's description as JSON."""
    return json.dumps({"name": record.name, **record.description}, ensure_ascii=False)
