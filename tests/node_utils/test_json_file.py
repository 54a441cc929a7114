"""What a node writes at the end of a run takes nobody's place."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_node_utils.json_file import NewJson


def test_a_new_file_is_written_whole_and_once(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "step.json"
    output = NewJson(str(path), HydraulicError)
    output.write({"a": 1})
    assert json.loads(path.read_text()) == {"a": 1}
    with pytest.raises(HydraulicError, match="exists"):
        output.check()
    with pytest.raises(HydraulicError, match="cannot be written"):
        output.write({"a": 2})
    assert json.loads(path.read_text()) == {"a": 1}
    assert [file.name for file in path.parent.iterdir()] == ["step.json"]


def test_what_is_there_is_refused_at_the_start(tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.txt"
    thesis.write_text("ten years of work")
    with pytest.raises(HydraulicError, match=r"thesis\.txt exists"):
        NewJson(str(thesis), HydraulicError)
    link = tmp_path / "link.json"
    link.symlink_to(tmp_path / "nowhere")
    with pytest.raises(HydraulicError, match="exists"):
        NewJson(str(link), HydraulicError)


def test_what_comes_meanwhile_stays(tmp_path: Path) -> None:
    path = tmp_path / "thesis.txt"
    output = NewJson(str(path), HydraulicError)
    path.write_text("ten years of work")
    with pytest.raises(HydraulicError, match="cannot be written"):
        output.write({})
    assert path.read_text() == "ten years of work"


def test_no_name_is_no_file() -> None:
    NewJson("", HydraulicError).write({})
