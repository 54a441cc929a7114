"""Errors of records and of the files they are read from and written to."""

from __future__ import annotations

from pathlib import Path

from hydraulic_interfaces.errors import HydraulicError


class RecordError(HydraulicError, ValueError):
    """Base of all: a record, or something asked of it, is not acceptable.

    The message says where (file, row or sample, column or channel), the value found and what is allowed.
    """


class FileError(RecordError):
    """A file or folder that should hold a record cannot be read as one.

    Attributes: ``path`` of the file, ``row`` (1-based line of the file, or 1-based sample where a file has no
    lines) and ``column`` (name or number), each None where it does not apply.
    """

    def __init__(
        self,
        path: Path | str,
        problem: str,
        *,
        row: int | None = None,
        column: str | int | None = None,
        expected: str = "",
    ) -> None:
        self.path, self.problem, self.row, self.column, self.expected = Path(path), problem, row, column, expected
        place = str(path)
        if row is not None:
            place += f", row {row}"
        if column is not None:
            place += f", column {column}"
        super().__init__(f"{place}: {problem}" + (f"; expected {expected}" if expected else ""))


class TimeError(FileError):
    """The time stamps of a file do not make a uniform time: they repeat, go back, jitter or leave gaps."""


class ColumnMapError(RecordError):
    """A column map is wrong in itself, or names columns that the file does not have."""


class BagError(FileError):
    """A bag cannot be read or written: not a bag, cut off, damaged, or without the contract's topics."""


class ChannelError(RecordError, KeyError):
    """A channel is asked for that the record does not have, or a name that is no channel."""

    def __str__(self) -> str:
        return str(self.args[0])  # KeyError would show the text in quotes
