"""Tables in MATLAB files (version 4 to 7): every vector is a column."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import ColumnMapError, FileError
from hydraulic_sysid.data.records.column_map import ColumnMap, column_of_header, named_columns

SUFFIXES = (".mat",)


class MatTable:
    """The variables of a MATLAB file; a matrix gives its columns as ``name.1``, ``name.2`` and so on.

    :raises FileError: unreadable.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._columns: dict[str, Array] = {}
        for name, value in _load(path).items():
            if name.startswith("__") or not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
                continue
            if value.ndim == 2 and 1 in value.shape and value.size > 1:
                self._columns[name] = value.ravel()
            elif value.ndim == 2 and value.size > 1:
                for index, column in enumerate(value.T, start=1):
                    self._columns[f"{name}.{index}"] = column

    @property
    def names(self) -> Sequence[str]:
        """Names of all columns."""
        return list(self._columns)

    def own_map(self, base: ColumnMap | None = None) -> ColumnMap:
        """The map of vectors called ``<channel>_<unit>``; other variables are left out. ``base`` says the rest.

        :raises ColumnMapError: no time, or no channel.
        """
        found = {}
        for name in self._columns:
            try:
                quantity, column = column_of_header(name)
            except ColumnMapError:
                continue  # a MATLAB file is a whole workspace: what is not named as a channel is not meant
            found[quantity] = column
        columns = named_columns(found, base)
        if (columns.time is None and columns.dt is None) or not columns.parts[""]:
            there = ", ".join(self._columns) or "none"
            raise ColumnMapError(
                f"{self.path}: no vectors time_s and <channel>_<unit>; there are {there}; "
                "say by a column map what they are"
            )
        return columns

    def numbers(self, column: str | int) -> Array:
        """``(N,)`` numbers of a variable; `FileError` where it is missing or no vector of real numbers."""
        name = self._name(column)
        return np.asarray(self._columns[name], dtype=np.float64)

    def row(self, index: int) -> int:
        """Sample counted from 1, as MATLAB does."""
        return index + 1

    def label(self, column: str | int) -> str | int:
        """Name of the variable."""
        return self._name(column)

    def _name(self, column: str | int) -> str:
        if isinstance(column, int) and column <= len(self._columns):
            return self.names[column - 1]
        if column not in self._columns:
            there = ", ".join(self._columns) or "no vectors"
            raise FileError(self.path, f"no variable {column!r}; there are {there}")
        return str(column)


def _load(path: Path) -> dict[str, object]:
    from scipy.io import loadmat

    if path.stat().st_size == 0:
        raise FileError(path, "the file is empty")
    try:
        return dict(loadmat(str(path)))
    except NotImplementedError:
        problem = "is a MATLAB file of version 7.3 (HDF5)"
        raise FileError(path, problem, expected="version 4 to 7; in MATLAB: save -v7") from None
    except MemoryError:
        raise FileError(path, "is damaged: it states sizes that do not fit in memory") from None
    except Exception as error:  # scipy lets through whatever it trips over in a damaged file
        raise FileError(path, f"no readable MATLAB file ({type(error).__name__}: {error})") from None
