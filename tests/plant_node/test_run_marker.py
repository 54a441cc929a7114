"""What a run leaves behind for the next one."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from hydraulic_plant_node import run_marker
from hydraulic_plant_node.run_marker import RunMarker


def test_an_orderly_end_leaves_nothing_behind(tmp_path: Path) -> None:
    one = RunMarker("socketcan can0", tmp_path / "deep" / "folder")
    assert one.begin() == ""
    one.end("")
    assert not list((tmp_path / "deep" / "folder").iterdir())
    assert one.begin() == ""


def test_a_run_that_did_not_end_is_known_until_one_did(tmp_path: Path) -> None:
    assert RunMarker("can0", tmp_path).begin() == ""
    assert RunMarker("can1", tmp_path).begin() == "", "another actuator"
    again = RunMarker("can0", tmp_path)
    assert "ended without a word" in again.begin()
    again.end("")
    assert RunMarker("can0", tmp_path).begin() == ""


def test_a_stop_outlives_any_number_of_runs(tmp_path: Path) -> None:
    reason = "emergency stop"
    for _ in range(3):
        one = RunMarker("can0", tmp_path)
        one.begin()
        one.end(reason)
        reason = RunMarker("can0", tmp_path).begin()
        assert reason == "from before this start: emergency stop"


def test_a_disk_that_cannot_be_written_is_a_reason_to_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(run_marker.os, "fsync", refuse)
    one = RunMarker("can0", tmp_path)
    assert one.begin().endswith("can0.in_use: Read-only file system")
    one.end("")
    (tmp_path / "file").write_text("")
    assert "cannot be known" in RunMarker("can0", tmp_path / "file").begin()


def test_the_folder_follows_the_convention(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert run_marker.state_folder() == tmp_path / "hydraulic_bench"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run_marker.state_folder() == tmp_path / ".local" / "state" / "hydraulic_bench"
