"""A column map that means nothing, or does not fit its file, is named with key and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from hydraulic_sysid.data.records import ColumnMapError, RecordError, load_column_map, parse_column_map, read_records

BASE: dict[str, object] = {"time": {"dt": 0.1}, "channels": {"drive": {"column": 1, "unit": "V"}}}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"chanels": {}}, "unknown key 'chanels'"),
        ({"channels": {"presure_a": {"column": 1, "unit": "Pa"}}}, "'presure_a' is no channel.*pressure_a"),
        ({"channels": {"drive": {"unit": "V"}}}, "'column' is missing"),
        ({"channels": {"drive": {"column": 0, "unit": "V"}}}, "number from 1"),
        ({"channels": {"drive": {"column": True, "unit": "V"}}}, "number from 1"),
        ({"channels": {"drive": {"column": 1}}}, "'unit'"),
        ({"channels": {"drive": {"column": 1, "unit": "mm"}}}, "'mm' does not convert to V"),
        ({"channels": {"drive": {"column": 1, "unit": "V", "sign": 2}}}, "sign is 2"),
        ({"channels": {"drive": {"column": 1, "unit": "V", "scale": 0}}}, "scale is 0"),
        ({"channels": {"drive": {"column": 1, "unit": "V", "scale": float("nan")}}}, "finite"),
        ({"channels": {"drive": {"column": 1, "unit": "V", "gain": 1}}}, "unknown key 'gain'"),
        ({"channels": {"drive": 3}}, "drive: is 3"),
        ({"channels": {"drive": None}}, "maps no channel"),
        ({"channels": []}, "mapping"),
        ({"extra": {"drive": {"column": 1, "unit": "V"}}}, "'drive'"),
        ({"extra": {"speed": {"column": 1}}}, "unit"),
        ({"records": {}}, "both"),
        ({"time": {}}, "'column' or 'dt'"),
        ({"time": {"dt": 0}}, "positive"),
        ({"time": {"dt": 0.1, "column": 1}}, "'column' or 'dt'"),
        ({"time": {"column": 1, "unit": "m"}}, "'m' does not convert to s"),
        ({"time": {"column": 1, "unit": "s", "irregular": "guess"}}, "error.*resample.*split"),
        ({"files": {"*_pA_*": {"presure_a": {"column": 2, "unit": "Pa"}}}}, "'presure_a' is no channel"),
        ({"files": {"*_pA_*": {"drive": {"column": 2, "unit": "V"}}}}, "drive is mapped for all files already"),
        ({"files": {"*_pA_*": {}}}, "maps no channel"),
        ({"files": {3: {}}}, "3 is no pattern of file names"),
        ({"files": []}, "mapping"),
        ({"delimiter": "ab"}, "delimiter"),
        ({"notes": None}, "notes is None, must be a text or a list of texts"),
        ({"notes": [1]}, "must be a text or a list of texts"),
    ],
)
def test_a_wrong_column_map_is_named(change: dict[str, object], said: str) -> None:
    with pytest.raises(ColumnMapError, match=said):
        parse_column_map({**BASE, **change}, "map.yaml")


def test_a_column_map_that_does_not_fit_the_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("u,y\n1,2\n3,4\n")
    for column, said in ((3, "no column 3.*1 … 2"), ("v", "no column 'v'.*u, y")):
        columns = parse_column_map({**BASE, "channels": {"drive": {"column": column, "unit": "V"}}})
        with pytest.raises(RecordError, match=said):
            read_records(file, columns)


def test_column_map_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("time: [")
    (tmp_path / "list.yaml").write_text("- 1\n")
    for name, said in (("bad.yaml", "not YAML"), ("list.yaml", "mapping"), ("none.yaml", "festo_hanging_load")):
        with pytest.raises(ColumnMapError, match=said):
            load_column_map(tmp_path / name)


MOVED = BASE | {
    "files": {f"*_p{x}_*": {f"pressure_{x.lower()}": {"column": 2, "unit": "MPa", "scale": 0.1}} for x in "AB"}
}


def test_a_transducer_that_was_moved_is_another_channel_in_other_files(tmp_path: Path) -> None:
    for name in ("run_pA_1.csv", "run_pB_1.csv"):
        (tmp_path / name).write_text("\n".join(f"{0.1 * i},{20 + i}" for i in range(20)) + "\n")
    first, second = read_records(tmp_path, parse_column_map(MOVED))
    assert [sorted(r.channels) for r in (first, second)] == [["drive", "pressure_a"], ["drive", "pressure_b"]]
    assert second["pressure_b"][0] == pytest.approx(2e6)


@pytest.mark.parametrize(
    ("name", "said"), [("run_pC_1.csv", "matches none"), ("run_pA_pB_1.csv", "'\\*_pA_\\*' and '\\*_pB_\\*'")]
)
def test_a_file_of_which_a_map_says_nothing_or_two_things_is_refused(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / name).write_text("1,2\n3,4\n")
    with pytest.raises(ColumnMapError, match=f"files: '{name}' .*{said}.*exactly one must"):
        read_records(tmp_path / name, parse_column_map(MOVED, "map"))
