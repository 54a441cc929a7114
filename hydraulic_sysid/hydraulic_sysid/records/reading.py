"""Reading records from whatever holds them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from hydraulic_sysid.records import bag_record, csv_file, mat_file
from hydraulic_sysid.records.column_map import ColumnMap, load_column_map
from hydraulic_sysid.records.errors import FileError, RecordError
from hydraulic_sysid.records.record import Record


def read_records(path: Path | str, columns: ColumnMap | Path | str | None = None) -> list[Record]:
    """Records in a bag folder, a .csv, .csv.gz or .mat file, or a folder of such, in the order of their names.

    ``columns`` is a column map, a YAML file with one, or the name of a shipped one; without it, headers must
    say channel and unit (``position_mm``). Bags need none.

    :raises FileError: nothing there, unknown kind, or unreadable; names file, row and column.
    :raises RecordError: see `RecordError` for its kinds.
    """
    path = Path(path)
    mapping = columns if isinstance(columns, ColumnMap) or columns is None else load_column_map(columns)
    if not path.exists():
        raise FileError(path, "does not exist")
    if path.is_dir() and not bag_record.is_bag(path):
        entries = [entry for entry in sorted(path.iterdir()) if _holds_record(entry)]
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


def _holds_record(path: Path) -> bool:
    if path.is_dir():
        return bag_record.is_bag(path)
    return path.name.lower().endswith((*csv_file.SUFFIXES, *mat_file.SUFFIXES, *bag_record.SUFFIXES))


def _read(path: Path, columns: ColumnMap | None) -> list[Record]:
    lowered = path.name.lower()
    if path.is_dir() or lowered.endswith(bag_record.SUFFIXES):
        return bag_record.read_bag(path, columns.irregular if columns else "error")
    stem = path.name[: -len(next(s for s in _suffixes() if lowered.endswith(s)))]
    if lowered.endswith(mat_file.SUFFIXES):
        return mat_file.read_mat(path, columns, stem)
    return csv_file.read_csv(path, columns, stem)


def _suffixes() -> list[str]:
    return sorted((*csv_file.SUFFIXES, *mat_file.SUFFIXES), key=len, reverse=True)


def _kinds() -> str:
    return f"a bag folder, or a file {', '.join((*csv_file.SUFFIXES, *mat_file.SUFFIXES, *bag_record.SUFFIXES))}"
