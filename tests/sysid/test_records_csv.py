"""CSV files to records: what is understood, and that everything else is named with file, row and column."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sysid.data.records import (
    ColumnMap,
    FileError,
    Record,
    RecordError,
    TimeError,
    load_column_map,
    parse_column_map,
    read_all,
    read_records,
)

HEADER = "time_s,command_V,position_m,pressure_a_Pa"
ROWS = [[0.001 * k, 0.5 * k, 0.01 * k, 7e6 + k] for k in range(20)]


def text(rows: list[list[float]] = ROWS, header: str = HEADER) -> str:
    lines = [header] if header else []
    return "\n".join([*lines, *(",".join(f"{v:.9g}" for v in row) for row in rows)]) + "\n"


def write(path: Path, content: str | bytes) -> Path:
    data = content.encode() if isinstance(content, str) else content
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


def read(path: Path, columns: ColumnMap | None = None) -> Record:
    (record,) = read_records(path, columns)
    return record


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "run.csv"


@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz"])
def test_headers_name_channels_and_units(tmp_path: Path, name: str) -> None:
    record = read(write(tmp_path / name, text()))
    assert record.name == "run"
    assert record.dt == 0.001
    np.testing.assert_array_equal(record.time, 0.001 * np.arange(20))
    np.testing.assert_allclose(record["position"], 0.01 * np.arange(20))
    np.testing.assert_allclose(record["pressure_a"], 7e6 + np.arange(20))
    assert "pressure_b" not in record and not record["position"].flags.writeable


def test_the_command_stands_in_for_a_drive_that_was_not_recorded(file: Path) -> None:
    record = read(write(file, text()))
    np.testing.assert_array_equal(record["drive"], record["command"])
    assert any("drive" in note for note in record.notes)


def test_units_in_headers_go_to_si(file: Path) -> None:
    header = "time_ms,drive_mV,position_mm,velocity_mm_per_s,pressure_supply_bar"
    write(file, header + "\n0,500,10,20,140\n2,500,10,20,140\n4,500,10,20,140\n")
    record = read(file)
    assert record.dt == 0.002
    expected = {"drive": 0.5, "position": 0.01, "velocity": 0.02, "pressure_supply": 14e6}
    assert set(record.channels) == set(expected)
    for name, value in expected.items():
        np.testing.assert_allclose(record[name], value, rtol=1e-12)


@pytest.mark.parametrize(
    "content",
    [
        "# bench 3\n#\n" + text(),
        "\ufeff" + text(),
        text().replace("\n", "\r\n"),
        text().replace("\n", "\n\n"),
        text().replace(",", ";").replace(".", ","),
        text().replace(",", "\t"),
        text().replace(",", "   "),
        "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in text().splitlines()),
        text()[:-1],
    ],
    ids=["comment", "bom", "crlf", "blank", "decimal comma", "tab", "spaces", "quotes", "no last newline"],
)
def test_the_dialects_of_csv_say_the_same(file: Path, content: str) -> None:
    record = read(write(file, content))
    np.testing.assert_allclose(record["pressure_a"], 7e6 + np.arange(20))
    assert record.dt == 0.001


def test_a_column_map_gives_columns_units_signs_and_offsets(file: Path) -> None:
    columns = parse_column_map(
        {
            "header": False,
            "time": {"column": 1, "unit": "ms"},
            "channels": {
                "drive": {"column": 2, "unit": "mV", "sign": -1},
                "position": {"column": 3, "unit": "mm", "scale": 20.0, "offset": -100.0},
                "pressure_a": None,
            },
            "extra": {"speed_signal": {"column": 4, "unit": "V", "scale": 2.0}},
            "notes": "from the old rig",
        }
    )
    write(file, "0,1000,5,3\n10,1000,6,4\n20,1000,4,5\n")
    record = read(file, columns)
    assert record.dt == 0.01
    np.testing.assert_allclose(record["drive"], -1.0)
    np.testing.assert_allclose(record["position"], [0.0, 0.02, -0.02])
    np.testing.assert_allclose(record["speed_signal"], [6.0, 8.0, 10.0])
    assert record.unit("speed_signal") == "V" and record.unit("position") == "m"
    assert record.notes == ["from the old rig"]
    write(file, "".join(f"{10 * k},0,0,{k}\n" for k in range(10)))
    for part in read(file, columns).split(0.5):
        assert part.unit("speed_signal") == "V"


def test_one_file_may_hold_several_records(file: Path) -> None:
    records = {
        "left": {"position": {"column": "a", "unit": "m"}},
        "right": {"position": {"column": "b", "unit": "m", "sign": -1}},
    }
    columns = parse_column_map({"time": {"dt": 0.1}, "records": records})
    write(file, "a,b\n1,2\n3,4\n")
    left, right = read_records(file, columns)
    assert (left.name, right.name) == ("run.left", "run.right")
    np.testing.assert_array_equal(left["position"], [1.0, 3.0])
    np.testing.assert_array_equal(right["position"], [-2.0, -4.0])


def test_a_column_that_nobody_asks_for_may_hold_text(file: Path) -> None:
    columns = parse_column_map({"time": {"dt": 0.5}, "channels": {"drive": {"column": "u", "unit": "V"}}})
    record = read(write(file, "u,remark\n1,ok\n2,\n3,odd\n"), columns)
    np.testing.assert_array_equal(record["drive"], [1.0, 2.0, 3.0])


@pytest.mark.parametrize("cell", ["nan", "inf", "-inf", "1e999", "abc", "", "1_0", "0x1F", "1.2.3", "٣", "true"])
@pytest.mark.parametrize("column", [0, 2])
def test_a_cell_that_is_no_finite_number_is_named(file: Path, cell: str, column: int) -> None:
    lines = text().splitlines()
    cells = lines[7].split(",")
    cells[column] = cell
    lines[7] = ",".join(cells)
    with pytest.raises(FileError) as caught:
        read(write(file, "\n".join(lines)))
    assert (caught.value.path, caught.value.row) == (file, 8)
    assert caught.value.column == HEADER.split(",")[column]
    assert "number" in str(caught.value)


def test_rows_are_counted_as_an_editor_shows_them(file: Path) -> None:
    content = "# comment\n\n" + HEADER + "\n\n0,0,0,0\n0.1,0,0,0\n\n0.2,x,0,0\n"
    with pytest.raises(FileError) as caught:
        read(write(file, content))
    assert (caught.value.row, caught.value.column) == (8, "command_V")


@pytest.mark.parametrize("row", ["0.005,1,2", "0.005,1,2,3,4", "0.005"])
def test_a_row_of_another_length_is_named(file: Path, row: str) -> None:
    lines = text().splitlines()
    lines[6] = row
    with pytest.raises(FileError, match="cells") as caught:
        read(write(file, "\n".join(lines)))
    assert caught.value.row == 7


def test_a_file_that_is_cut_off_in_its_last_row_is_refused(file: Path) -> None:
    content = text()
    with pytest.raises(FileError) as caught:
        read(write(file, content[: content.rindex(",")]))
    assert caught.value.row == 21


@pytest.mark.parametrize("kept", [1, 10, 30, -1])
def test_a_gzip_file_that_is_cut_off_is_named(tmp_path: Path, kept: int) -> None:
    path = write(tmp_path / "run.csv.gz", text())
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(FileError, match="gzip") as caught:
        read(path)
    assert caught.value.path == path


def test_a_damaged_gzip_file_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv.gz", text())
    data = bytearray(path.read_bytes())
    data[40] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(FileError, match="gzip"):
        read(path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "empty"),
        ("\n \n", "empty"),
        (HEADER + "\n", "at least two"),
        (HEADER + "\n0,0,0,0\n", "at least two"),
        ("0,1,2\n1,2,3\n", "no header"),
        ("command_V,position_m\n0,1\n1,2\n", "time"),
        ("time_s\n0\n1\n", "channels"),
        ("time_s,positon_m\n0,1\n1,2\n", "positon_m.*position"),
        ("time_s,position\n0,1\n1,2\n", "unit"),
        ("time_s,position_V\n0,1\n1,2\n", "position_V.*V.*m"),
        ("time_s,position_parsnip\n0,1\n1,2\n", "parsnip"),
        ("time_s,position_m,position_mm\n0,1,1\n1,2,2\n", "same channel"),
        ("time_s,position_m,position_m\n0,1,1\n1,2,2\n", "position_m"),
        ("time_s,1\n0,1\n1,2\n", "time_s"),
        (b"time_s,position_m\n0,1\n1,\xff\n", "UTF-8"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "UTF-8"),
    ],
)
def test_what_is_no_record_is_refused_with_a_reason(file: Path, content: str | bytes, said: str) -> None:
    with pytest.raises(RecordError, match=said) as caught:
        read(write(file, content))
    assert str(file) in str(caught.value)


def altered(change: dict[int, float], drop: tuple[int, ...] = ()) -> str:
    rows = [[change.get(k, row[0]), *row[1:]] for k, row in enumerate(ROWS) if k not in drop]
    return text(rows)


@pytest.mark.parametrize(
    ("content", "row", "said"),
    [
        (altered({9: 0.008}), 11, "twice"),
        (altered({9: 0.0035}), 11, "back"),
        (altered({}, drop=(9,)), 11, "1 sample missing"),
        (altered({}, drop=(9, 10, 11)), 11, "3 samples missing"),
        (altered({}, drop=(1,)), 3, "1 sample missing"),
        (altered({}, drop=(18,)), 20, "1 sample missing"),
        (altered({9: 0.00965}), 11, "off|since"),
    ],
)
def test_time_that_is_not_even_is_named(file: Path, content: str, row: int, said: str) -> None:
    with pytest.raises(TimeError, match=said) as caught:
        read(write(file, content))
    assert (caught.value.row, caught.value.column) == (row, "time_s")


def test_uneven_time_is_resampled_or_split_where_the_map_says_so(file: Path) -> None:
    write(file, altered({}, drop=(9, 10)))
    resampled = read(file, load_column_map("resample"))
    assert len(resampled) == 20 and any("resampled" in note for note in resampled.notes)
    np.testing.assert_allclose(resampled["position"], 0.01 * np.arange(20), atol=1e-12)
    assert resampled["command"][10] == resampled["command"][8]  # a drive is held
    first, second = read_records(file, "split")
    assert (len(first), len(second)) == (9, 9)
    assert second.time[0] == 0.0 and second["position"][0] == pytest.approx(0.11)


def test_time_written_with_few_digits_is_even(file: Path) -> None:
    rows = [[round(k / 300, 3), 0.0, 0.0, 0.0] for k in range(3000)]
    record = read(write(file, text(rows)))
    assert abs(record.time[-1] - 2999 / 300) < 0.1 / 300


def test_a_folder_gives_its_records_in_order(tmp_path: Path) -> None:
    write(tmp_path / "b.csv", text())
    write(tmp_path / "a.csv.gz", text())
    (tmp_path / "notes.md").write_text("not a record")
    assert [record.name for record in read_records(tmp_path)] == ["a", "b"]
    assert [r.name for r in read_all([tmp_path / "b.csv", tmp_path])] == ["b", "a", "b"]


def test_a_bad_file_in_a_folder_is_named(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text())
    write(tmp_path / "b.csv", "nonsense")
    with pytest.raises(RecordError, match=r"b\.csv"):
        read_records(tmp_path)


@pytest.mark.parametrize("name", ["missing.csv", "run.xlsx", "empty"])
def test_a_path_that_holds_no_record_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "run.xlsx").write_bytes(b"PK")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match=name):
        read_records(tmp_path / name)


def test_lines_before_a_table_and_ragged_rows_of_a_logger(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("Version:  2\nRate:  1000\nNo, CH0, CH1, Events\n1, 0.5, 2.0, Start\n2, 0.6, 2.5\n3, 0.7, 3.0\n")
    columns = {"time": {"dt": 0.001}, "channels": {"drive": {"column": "CH1", "unit": "V"},
                                                   "position": {"column": "CH0", "unit": "mm"}}}  # fmt: skip
    (record,) = read_records(path, parse_column_map({**columns, "skip": 2, "ragged": True}))
    assert record["drive"] == pytest.approx([2.0, 2.5, 3.0])
    assert record["position"] == pytest.approx([0.5e-3, 0.6e-3, 0.7e-3])
    with pytest.raises(RecordError, match="cells"):
        read_records(path, parse_column_map({**columns, "skip": 2}))
    with pytest.raises(RecordError, match="skip"):
        parse_column_map({**columns, "skip": -1})
