"""A record holds what it was given, unchangeable, and gives its parts with the right times."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sysid.data.records import ChannelError, Record, RecordError


def record(count: int = 1000, dt: float = 0.001) -> Record:
    index = np.arange(count)
    return Record.sampled("run", dt, {"drive": np.sin(0.01 * index), "position": 1e-3 * index}, Path("run.csv"))


def test_channels_are_found_by_name() -> None:
    one = record()
    assert "drive" in one and "pressure_a" not in one
    assert one["position"][10] == pytest.approx(0.01)
    assert len(one) == 1000 and one.duration == pytest.approx(1.0)


def test_a_missing_channel_names_those_there_are() -> None:
    with pytest.raises(ChannelError, match=r"run has no channel 'pressure_a'; it has drive, position$"):
        record()["pressure_a"]


def test_a_record_cannot_be_changed_and_keeps_nothing_of_its_input() -> None:
    values = np.zeros(10)
    one = Record.sampled("run", 0.1, {"drive": values})
    values[:] = 7.0
    assert not one["drive"].any()
    for array in (one.time, one["drive"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.dt = 2.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"dt": 0.0}, r"dt is 0.0 s, must be positive"),
        ({"dt": 0.002}, r"the time is not 0, dt"),
        ({"time": np.zeros(0), "channels": {}}, r"0 samples; a record needs at least two"),
        ({"channels": {"speed": np.zeros(1000)}}, r"'speed' is no channel; allowed: command, drive, position"),
        ({"channels": {"drive": np.zeros(999)}}, r"channel drive has 999 samples, the time 1000"),
        ({"channels": {"drive": np.zeros((1000, 1))}}, r"drive has shape \(1000, 1\)"),
        ({"channels": {"drive": np.r_[np.zeros(999), np.nan]}}, r"drive is nan at sample 1000; must be finite"),
    ],
)
def test_what_makes_no_record_is_refused(change: dict[str, object], text: str) -> None:
    with pytest.raises(RecordError, match=text):
        dataclasses.replace(record(), **change)  # type: ignore[arg-type]


def test_parts_of_a_split_make_up_the_whole() -> None:
    whole = record()
    first, last = whole.split(0.7)
    assert (len(first), len(last)) == (700, 300)
    np.testing.assert_array_equal(np.r_[first["position"], last["position"]], whole["position"])
    assert first.time[0] == last.time[0] == 0.0 and last.dt == whole.dt
    assert (first.name, last.name) == ("run[0–0.7 s]", "run[0.7–1 s]")


@pytest.mark.parametrize("fraction", [0.0, 1.0, -1.0, 1e-9, float("nan")])
def test_a_split_without_two_parts_is_refused(fraction: float) -> None:
    with pytest.raises(RecordError, match="run: "):
        record().split(fraction)


def test_a_window_holds_its_start_and_not_its_end() -> None:
    part = record().window(0.1, 0.3)
    assert len(part) == 200
    assert part["position"][0] == 0.1 and part.time[0] == 0.0
    assert part.description["window_s"] == [0.1, 0.3]


def test_windows_of_windows_know_where_they_lay_in_the_whole() -> None:
    part = record().window(0.1, 0.5).window(0.1, 0.2)
    assert part["position"][0] == pytest.approx(0.2)
    assert (part.name, part.description["window_s"]) == ("run[0.2–0.3 s]", [0.2, 0.3])


def test_a_window_beyond_the_record_is_cut_and_an_empty_one_refused() -> None:
    assert len(record().window(-5.0, 5.0)) == 1000
    with pytest.raises(RecordError, match=r"no two samples in 2 … 3 s; it has 1000 samples over 1 s"):
        record().window(2.0, 3.0)


def test_the_description_can_be_written_as_json() -> None:
    description = record().split(0.5)[1].description
    assert json.loads(json.dumps(description, allow_nan=False)) == description
