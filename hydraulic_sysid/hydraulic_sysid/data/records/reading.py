"""Reading records from whatever holds them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from hydraulic_sysid.data.errors import FileError, RecordError
from hydraulic_sysid.data.records.column_map import ColumnMap, load_column_map
from hydraulic_sysid.data.records.formats import SUFFIXES, format_of, suffix_of
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.table import records_of_table

_MCAP, _SQLITE = ".mcap", ".db3"
_SUFFIXES = (*SUFFIXES, _MCAP, _SQLITE)


def read_records(path: Path | str, columns: ColumnMap | Path | str | None = None) -> list[Record]:
    """Records in a bag folder, a file of one of the suffixes, or a folder of such, in the order of their names.

    Bags are of MCAP or SQLite; files .mcap and .db3, and tables as CSV, MATLAB, HDF5 and Parquet files.

    ``columns`` is a column map, a YAML file with one, or the name of a shipped one; without it, headers must
    say channel and unit (``position_mm``). Bags need none.

    :raises FileError: nothing there, unknown kind, or unreadable; names file, row and column.
    :raises RecordError: see `RecordError` for its kinds.
    """
    path = Path(path)
    mapping = columns if isinstance(columns, ColumnMap) or columns is None else load_column_map(columns)
    if not path.exists():
        raise FileError(path, "does not exist")
    if path.is_dir() and not _is_bag(path):
        # Results are kept as JSON, and notes as text: such are records only where a column map says what they hold.
        entries = [
            entry
            for entry in sorted(path.iterdir())
            if _holds_record(entry) and (mapping or entry.suffix not in (".json", ".txt"))
        ]
        if not entries:
            raise FileError(path, "holds no records", expected=_kinds())
        return [record for entry in entries for record in _read(entry, mapping)]
    if not _holds_record(path):
        raise FileError(path, "is of no known kind", expected=_kinds())
    return _read(path, mapping)


def read_all(paths: Iterable[Path | str], columns: ColumnMap | Path | str | None = None) -> list[Record]:
    """Records of several paths, in this order.

    :raises RecordError: as `read_records`, and for no path at all.
    """
    mapping = columns if isinstance(columns, ColumnMap) or columns is None else load_column_map(columns)
    records = [record for path in paths for record in read_records(path, mapping)]
    if not records:
        raise RecordError("no record is named")
    return records


def _is_bag(folder: Path) -> bool:
    """Whether a folder is a bag, complete or left behind by a recorder."""
    return (folder / "metadata.yaml").is_file() or any(any(folder.glob(f"*{s}")) for s in (_MCAP, _SQLITE))


def _holds_record(path: Path) -> bool:
    return _is_bag(path) if path.is_dir() else path.name.lower().endswith(_SUFFIXES)


def _read(path: Path, columns: ColumnMap | None) -> list[Record]:
    if path.is_dir() or path.name.lower().endswith((_MCAP, _SQLITE)):
        # Here and not above: what reads bags takes long to load, most records are tables, and it needs the errors
        # of this package itself.
        from hydraulic_sysid.data.records.bag_record import read_bag

        return read_bag(path, columns.irregular if columns else "error")
    name = path.name[: -len(suffix_of(path))]
    columns = columns and columns.for_file(path.name)
    if columns and columns.several_files:
        name = path.absolute().parent.name
    return records_of_table(format_of(path).table(path, columns), columns, name)


def _kinds() -> str:
    return f"a bag folder, or a file {', '.join(_SUFFIXES)}"
