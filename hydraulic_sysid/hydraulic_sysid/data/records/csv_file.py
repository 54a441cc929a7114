"""Tables in text files: CSV and the like, plain or gzip-compressed, with or without a header."""

from __future__ import annotations

import csv
import gzip
import io
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import ColumnMapError, FileError
from hydraulic_sysid.data.records.channels import TIME_UNIT
from hydraulic_sysid.data.records.column_map import ColumnMap, column_of_header, named_columns
from hydraulic_sysid.data.records.record import Record

SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz")
_ELEMENT = re.compile(r"(.+)\[([1-9]\d*)\]")  # of a column whose cells are lists
_GZIP_MAGIC = b"\x1f\x8b"


def content(record: Record) -> bytes:
    """The table of a record; reading gives the same numbers back.

    Channels with a unit of their own need a column map to be read again.
    """
    names = [f"time_{TIME_UNIT}", *(f"{name}_{record.unit(name)}" for name in record.channels)]
    text = io.StringIO()
    text.write(",".join(names) + "\n")
    # Seventeen digits give every double back exactly.
    np.savetxt(text, np.column_stack([record.time, *record.channels.values()]), "%.17g", ",")
    return text.getvalue().encode()


class CsvTable:
    """A table in a text file; cells become numbers when their column is asked for.

    Separator (; tab , or blanks), decimal comma and header are looked for where the map does not fix them. Rows
    are counted from 1, with the header and empty lines, as an editor shows them.

    :raises FileError: unreadable, empty, or ragged; names row and column.
    """

    def __init__(self, path: Path, columns: ColumnMap | None = None) -> None:
        self.path = path
        self.description: Mapping[str, Any] = {}
        lines = _text(path).splitlines()
        skip = columns.skip if columns else 0
        rows = [number for number, line in enumerate(lines, 1) if number > skip and line and not line.isspace()]
        if len(rows) != len(lines):
            lines = [lines[number - 1] for number in rows]
        # A comment of '#' lines may stand before the table.
        comments = next((k for k, line in enumerate(lines) if not line.lstrip().startswith("#")), len(lines))
        del lines[:comments], rows[:comments]
        if not lines:
            raise FileError(path, "the file is empty", expected="a header and rows of numbers")
        self._delimiter = (columns and columns.delimiter) or _delimiter(lines[min(1, len(lines) - 1)])
        self.names: Sequence[str] = ()
        self._header_row = 0
        cells = self._cells(lines[0])
        if _has_header(path, rows[0], cells, columns.header if columns else None):
            self.names = [cell.strip() for cell in cells]
            self._header_row = rows[0]
            del lines[0], rows[0]
            twice = [name for index, name in enumerate(self.names) if name in self.names[:index]]
            if twice:
                raise FileError(path, f"two columns are called {twice[0]!r}", row=self._header_row)
        if len(lines) < 2:
            raise FileError(path, f"{len(lines)} rows of numbers", expected="at least two")
        self._rows, self._lines = rows, lines
        self.width = len(cells)
        if not (columns and columns.ragged):
            self._check_ragged()
        decimal = columns.decimal if columns else None
        if decimal is None:
            commas = self._delimiter != "," and any("," in line for line in lines)
            decimal = "," if commas and not any("." in line for line in lines) else "."
        if decimal == "," and self._delimiter == ",":
            raise ColumnMapError(f"{path}: decimal and delimiter cannot both be ','")
        self._comma = decimal == ","
        self._numbers: Array | None = None

    def own_map(self, base: ColumnMap | None = None) -> ColumnMap:
        """The map that a header of ``<channel>_<unit>`` states; ``base`` says the rest, and perhaps the time.

        :raises ColumnMapError: no header, no time, or a name that is no channel with a unit.
        """
        if not self.names:
            raise ColumnMapError(
                f"{self.path}: no header such as time_s, drive_V, position_m; say by a column map what the "
                f"{self.width} columns are"
            )
        try:
            found = dict(column_of_header(name) for name in self.names)
        except ColumnMapError as error:
            raise ColumnMapError(f"{self.path}, row {self._header_row}: {error}") from None
        if len(found) != len(self.names):
            raise ColumnMapError(f"{self.path}, row {self._header_row}: two columns are the same channel: {self.names}")
        columns = named_columns(found, base)
        if columns.time is None and columns.dt is None:
            raise ColumnMapError(f"{self.path}, row {self._header_row}: no time column; expected one such as time_s")
        if not columns.parts[""]:
            raise ColumnMapError(f"{self.path}, row {self._header_row}: only a time; expected channels beside it")
        return columns

    def numbers(self, column: str | int) -> Array:
        """``(N,)`` numbers of a column; a `FileError` names row and column of a cell that is no number.

        Of cells that are lists, ``name[2]`` is the second number.
        """
        index = self._index(column)
        if isinstance(column, str) and column not in self.names:
            return self._elements(index, int(_ELEMENT.fullmatch(column)[2]))  # type: ignore[index]
        if self._numbers is None:
            try:
                self._numbers = self._parse(None)
            except ValueError:
                self._numbers = np.empty((0, 0))  # some column is no number: it may be one that nobody wants
        if self._numbers.size:
            return self._numbers[:, index]
        try:
            return self._parse([index])[:, 0]
        except ValueError as error:
            raise self._complaint(index, error) from None

    def row(self, index: int) -> int:
        """Line of a sample in the file, from 1."""
        return self._rows[index]

    def label(self, column: str | int) -> str | int:
        """Name in the header where there is one, else the number counted from 1."""
        index = self._index(column)
        if isinstance(column, str):
            return column
        return self.names[index] if self.names else index + 1

    def _cells(self, line: str) -> list[str]:
        if self._delimiter == " ":
            return line.split()
        try:
            return next(csv.reader([line], delimiter=self._delimiter))
        except csv.Error as error:
            raise FileError(self.path, f"not a row of cells ({error}): {line[:40]!r}") from None

    def _check_ragged(self) -> None:
        if self._delimiter == " ":
            widths = [len(line.split()) for line in self._lines]
        else:
            widths = [line.count(self._delimiter) + 1 for line in self._lines]
        for index, width in enumerate(widths):
            if width != self.width and len(self._cells(self._lines[index])) != self.width:
                cells = len(self._cells(self._lines[index]))
                raise FileError(self.path, f"{cells} cells", row=self._rows[index], expected=f"{self.width} cells")

    def _index(self, column: str | int) -> int:
        if isinstance(column, str):
            element = _ELEMENT.fullmatch(column)
            if column not in self.names and element and element[1] in self.names:
                return list(self.names).index(element[1])
            if column not in self.names:
                there = ", ".join(self.names) if self.names else "no header"
                raise FileError(self.path, f"no column {column!r}; there is {there}")
            return list(self.names).index(column)
        if column > self.width:
            raise FileError(self.path, f"no column {column}; there are 1 … {self.width}")
        return column - 1

    def _parse(self, wanted: Sequence[int] | None) -> Array:
        lines = [line.replace(",", ".") for line in self._lines] if self._comma else self._lines
        numbers = np.loadtxt(
            lines,
            delimiter=None if self._delimiter == " " else self._delimiter,
            usecols=wanted,
            comments=None,
            quotechar='"',
            ndmin=2,
        )
        if numbers.shape[0] != len(lines):  # a quote that is not closed takes the next row in
            raise ValueError("a quotation mark is not closed")
        return numbers

    def _elements(self, index: int, number: int) -> Array:
        """The ``number``-th entry, from 1, of the lists in a column."""
        found = np.empty(len(self._lines))
        for k, line in enumerate(self._lines):
            cell = self._cells(line)[index]
            try:
                found[k] = float(json.loads(cell)[number - 1])
            except (ValueError, TypeError, IndexError, KeyError):
                problem = f"{cell[:40]!r} has no number {number}"
                raise FileError(
                    self.path, problem, row=self._rows[k], column=self.names[index], expected="a list of numbers"
                ) from None
        return found

    def _complaint(self, index: int, error: ValueError) -> FileError:
        for row, line in zip(self._rows, self._lines, strict=True):
            cell = self._cells(line)[index].strip()
            if not _is_number(cell, self._comma):
                problem = f"{cell!r} is no number" if cell else "the cell is empty"
                label = self.names[index] if self.names else index + 1
                return FileError(self.path, problem, row=row, column=label, expected="a number")
        return FileError(self.path, str(error))


table = CsvTable


def _text(path: Path) -> str:
    data = path.read_bytes()
    if data.startswith(_GZIP_MAGIC):
        try:
            data = gzip.decompress(data)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise FileError(path, f"the gzip file is cut off or damaged ({error})") from None
    elif path.suffix == ".gz" and data:
        raise FileError(path, "is called .gz but is no gzip file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise FileError(path, f"not text in UTF-8 (byte {error.start})", row=row) from None


def _delimiter(line: str) -> str:
    """The separator of a row of numbers; a comma is one only where nothing else is."""
    return next((mark for mark in (";", "\t", ",") if mark in line), " ")


def _has_header(path: Path, row: int, cells: Sequence[str], wanted: bool | None) -> bool:
    if wanted is not None:
        return wanted
    numeric = [_is_number(cell) for cell in cells]
    if any(numeric) and not all(numeric):
        odd = numeric.index(False)
        raise FileError(
            path,
            f"{cells[odd].strip()!r} stands among numbers",
            row=row,
            column=odd + 1,
            expected="a header of names only, or numbers only",
        )
    return not any(numeric)


def _is_number(cell: str, comma: bool = True) -> bool:
    """Whether a cell is a number as `numpy.loadtxt` reads it, with a comma for the point if that is allowed."""
    if not cell.isascii() or "_" in cell:  # Python itself reads 1_000 and digits of other scripts
        return False
    try:
        float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return False
    return True
