"""A record goes through a bag and through CSV and comes back the same; damage is never read as a measurement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sysid.data.records import Record, RecordError, read_records, save, to_bag


def assert_same(one: Sequence[Record], other: Sequence[Record]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert a.dt == b.dt and set(a.channels) == set(b.channels)
        for name in a.channels:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def channels(count: int) -> Mapping[str, np.ndarray]:
    rng = np.random.default_rng(6)
    names = ("command", "drive", "position", "velocity", "force", "pressure_a", "pressure_b", "reference")
    return {name: rng.normal(size=count) for name in names}


@pytest.mark.parametrize("dt", [0.001, 0.0025, 0.1])
def test_bag_and_csv_of_a_record_give_the_same_record(tmp_path: Path, dt: float) -> None:
    record = Record.sampled("run", dt, channels(500))
    bagged = read_records(to_bag(record, tmp_path / "run"))
    for name in ("run.csv", "run.csv.gz"):
        assert_same(bagged, read_records(save(record, tmp_path / name)))
    assert_same((record,), bagged)


def test_a_record_of_few_channels_goes_through_a_bag(tmp_path: Path) -> None:
    record = Record.sampled("run", 0.001, {k: v for k, v in channels(50).items() if k in ("drive", "position")})
    assert_same((record,), read_records(to_bag(record, tmp_path / "run")))


def test_nothing_is_written_over(tmp_path: Path) -> None:
    record = Record.sampled("run", 0.001, channels(50))
    (tmp_path / "run").mkdir()
    (tmp_path / "run.csv").write_text("mine")
    with pytest.raises(RecordError, match="exists"):
        to_bag(record, tmp_path / "run")
    with pytest.raises(RecordError, match="exists"):
        save(record, tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text() == "mine" and not list((tmp_path / "run").iterdir())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "run.csv"]


def test_a_channel_without_a_topic_is_not_left_out_in_silence(tmp_path: Path) -> None:
    record = Record.sampled("run", 0.001, {"signal": np.zeros(5)}, units={"signal": "V"})
    with pytest.raises(RecordError, match="no topic carries signal"):
        to_bag(record, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_no_flipped_byte_is_read_as_a_measurement(tmp_path: Path) -> None:
    """Whatever byte of the file is damaged: an error, or the numbers as they were written."""
    path = to_bag(Record.sampled("run", 0.001, channels(100)), tmp_path / "run")
    before = read_records(path)
    (file,) = path.glob("*.mcap")
    data = file.read_bytes()
    refused = 0
    for at in np.random.default_rng(5).integers(0, len(data), 60).tolist():
        file.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        try:
            after = read_records(path)
        except RecordError:
            refused += 1
        else:
            assert_same(before, after)
    assert refused > 20
