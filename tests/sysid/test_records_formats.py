"""Records go to Parquet, HDF5, MATLAB and back as they were; files of others are read; others read our bags."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import loadmat

from hydraulic_sysid.data.errors import ColumnMapError, FileError
from hydraulic_sysid.data.records import Record, RecordError, read_records, save, to_bag
from hydraulic_sysid.data.records.formats import SUFFIXES
from hydraulic_sysid.verbs import convert

KINDS = [s for s in SUFFIXES if not s.startswith((".tsv", ".txt"))]


def record(count: int = 300, seed: int = 4) -> Record:
    rng = np.random.default_rng(seed)
    names = (
        "command",
        "drive",
        "position",
        "velocity",
        "spool",
        "force",
        "pressure_a",
        "pressure_b",
        "pressure_supply",
    )
    channels = {name: rng.normal(size=count) * 10.0 ** rng.integers(-6, 7) for name in names}
    return Record.sampled(
        "run", 0.0005, channels, description={"start_ns": 5, "plant": {"rig": "östlich"}, "notes": ["n"]}
    )


def assert_same(one: Record, other: Record) -> None:
    assert one.dt == other.dt and set(one.channels) == set(other.channels)
    for name in one.channels:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.mark.parametrize("suffix", KINDS)
def test_numbers_come_back_bit_by_bit(tmp_path: Path, suffix: str) -> None:
    path = save(record(), tmp_path / f"run{suffix}")
    (again,) = read_records(path)
    assert_same(record(), again)
    assert again.name == "run" and again.source == path
    if ".csv" not in suffix:
        assert again.description["plant"] == {"rig": "östlich"} and again.description["start_ns"] == 5
        assert again.notes == ["n"]
    (third,) = read_records(save(again, tmp_path / f"again{suffix}"))
    assert third.description.get("plant") == again.description.get("plant") and third.notes == again.notes


@pytest.mark.parametrize("suffix", KINDS)
def test_what_is_there_is_never_replaced(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_text("mine")
    with pytest.raises(FileError, match="exists already"):
        save(record(), path)
    assert path.read_text() == "mine" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", [s for s in KINDS if "csv" not in s])
@pytest.mark.parametrize("size", [0, 1, 100, 2000])
def test_a_damaged_file_is_refused_in_a_line(tmp_path: Path, suffix: str, size: int) -> None:
    whole = save(record(), tmp_path / f"whole{suffix}").read_bytes()
    path = tmp_path / f"run{suffix}"
    path.write_bytes(whole[:size])
    with pytest.raises(RecordError) as caught:
        read_records(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_matlab_reads_names_and_vectors(tmp_path: Path) -> None:
    content = loadmat(save(record(), tmp_path / "run.mat"))
    assert content["velocity_mps"].shape == (300, 1)
    assert all(name.isidentifier() for name in content)
    assert json.loads(str(content["description"][0]))["plant"] == {"rig": "östlich"}


def test_pandas_would_find_a_plain_table(tmp_path: Path) -> None:
    read = pq.read_table(save(record(), tmp_path / "run.parquet"))
    assert read.column_names[:2] == ["time_s", "command_V"]
    assert {str(f.type) for f in read.schema} == {"double"}


def test_parquet_of_others(tmp_path: Path) -> None:
    t = np.arange(50)
    stamps = pa.array(1_700_000_000_000_000_000 + t * 1_000_000, pa.timestamp("ns"))
    table = pa.table({"time": stamps, "drive_V": t * 1.0, "position_mm": t, "comment": ["x"] * 50})
    pq.write_table(table, tmp_path / "log.parquet")
    (found,) = read_records(tmp_path / "log.parquet")
    assert found.dt == pytest.approx(1e-3) and found["position"][7] == pytest.approx(7e-3)
    gap = pa.table({"time_s": t * 1e-3, "drive_V": pa.array([None, *t[1:]], pa.float64()), "position_m": t * 1.0})
    pq.write_table(gap, tmp_path / "gap.parquet")
    with pytest.raises(FileError, match="row 1, column drive_V: value is nan"):
        read_records(tmp_path / "gap.parquet")


def test_hdf5_of_others(tmp_path: Path) -> None:
    t = np.arange(50) * 1e-3
    with h5py.File(tmp_path / "log.h5", "w") as file:
        group = file.create_group("daq")
        group["time"] = t
        group["time"].attrs["units"] = "s"
        group["position"] = 1e3 * t
        group["position"].attrs["unit"] = "mm"
        group["drive_V"] = t
        group["serial"] = "A 17"
        group["camera"] = np.zeros((3, 4, 5))
    (found,) = read_records(tmp_path / "log.h5")
    np.testing.assert_allclose(found["position"], t)
    with h5py.File(tmp_path / "log.h5", "a") as file:
        file["other/position_mm"] = t
    with pytest.raises(ColumnMapError, match="daq/position_mm and other/position_mm are both position"):
        read_records(tmp_path / "log.h5")
    table = np.zeros(50, dtype=[("time_s", float), ("drive_V", float), ("position_m", float)])
    table["time_s"] = t
    with h5py.File(tmp_path / "table.h5", "w") as file:
        file["run/table"] = table
    assert set(read_records(tmp_path / "table.h5")[0].channels) == {"drive", "position"}


def test_matlab_7_3_is_hdf5(tmp_path: Path) -> None:
    t = np.arange(50) * 1e-3
    with h5py.File(tmp_path / "log.mat", "w", userblock_size=512) as file:
        file["time_s"], file["drive_V"], file["position_mm"] = t[None, :], t[None, :], t[None, :]
        file["#refs#/a"] = t
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    with (tmp_path / "log.mat").open("r+b") as stream:
        stream.write(head)
    (found,) = read_records(tmp_path / "log.mat")
    assert len(found) == 50 and set(found.channels) == {"drive", "position"}


def as_sqlite(bag: Path, target: Path) -> Path:
    """The bag as `ros2 bag convert` would write it with sqlite3."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(bag) as reader, Writer(target, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        at = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=store) for c in reader.connections}
        for connection, stamp, data in reader.messages():
            writer.write(at[connection.id], stamp, data)
    return target


def test_sqlite_bags_are_read(tmp_path: Path) -> None:
    bag = as_sqlite(to_bag(record(), tmp_path / "bag"), tmp_path / "run")
    (found,) = read_records(bag)
    assert_same(record(), found)
    (file,) = bag.glob("*.db3")
    (alone,) = read_records(file)
    assert_same(record(), alone)
    assert alone.name == file.stem
    (bag / "metadata.yaml").unlink()
    with pytest.raises(FileError, match=r"not closed.*\.db3.*ros2 bag reindex"):
        read_records(bag)
    file.write_bytes(file.read_bytes()[:3000])
    with pytest.raises(RecordError, match="damaged"):
        read_records(file)


def test_foxglove_decodes_our_bags_by_their_own_definitions(tmp_path: Path) -> None:
    """mcap-ros2-support knows no type of ROS: it reads what the file says of itself."""
    to_bag(record(), tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.mcap")
    positions, pressures = [], []
    with file.open("rb") as stream:
        for _, channel, message, decoded in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            if channel.topic.endswith("/state"):
                assert list(decoded.name) == ["piston", "servovalve"]
                positions.append(decoded.position[0])
            elif channel.topic.endswith("/pressure_a"):
                assert message.log_time == decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
                pressures.append(decoded.fluid_pressure)
    np.testing.assert_array_equal(positions, record()["position"])
    np.testing.assert_array_equal(pressures, record()["pressure_a"])


@pytest.mark.parametrize("kind", ["parquet", "h5", "mat", "csv.gz", "bag"])
def test_convert(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a", "b"):
        save(record(seed=ord(name)), tmp_path / f"{name}.csv")
    out = tmp_path / "out"
    arguments = ["--record", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--to", kind, "--out", str(out)]
    assert convert.main(arguments) == 0
    assert "300 samples, every 0.0005 s: command, drive" in capsys.readouterr().out
    found = read_records(out)
    assert [r.name for r in found] == ["a", "b"]
    assert_same(found[1], record(seed=ord("b")))
    assert convert.main(arguments) == 2
    assert "exists" in capsys.readouterr().err


def test_convert_writes_nothing_where_names_collide(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        save(record(), tmp_path / folder / "run.csv")
    arguments = ["--record", str(tmp_path / "x"), str(tmp_path / "y"), "--to", "h5", "--out", str(tmp_path / "out")]
    assert convert.main(arguments) == 2
    assert "several records would become" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_others_call_description_is_no_error(tmp_path: Path) -> None:
    t = np.arange(50) * 1e-3
    for text in ("second rig", '{"notes": 5}', "[1]", "{"):
        with h5py.File(tmp_path / "log.h5", "w") as file:
            file["time_s"], file["drive_V"] = t, t
            file.attrs["description"] = text
        assert read_records(tmp_path / "log.h5")[0].notes == []
