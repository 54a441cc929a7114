"""The column maps that ship: each reads a file of the form it is written for, MATLAB files included."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from hydraulic_sysid.data.records import CHANNELS, FileError, RecordError, load_column_map, read_records, shipped_maps

SAMPLES = 40


@pytest.mark.parametrize("name", sorted(shipped_maps()))
def test_a_shipped_map_is_one(name: str) -> None:
    columns = load_column_map(name)
    for part in columns.parts.values():
        assert set(part) <= {*CHANNELS, *columns.units}
    assert not columns.parts or columns.notes, "a map of foreign data says what it assumes"


def plain_csv(path: Path, dt: float, *columns: np.ndarray) -> Path:
    """Numbers with five decimals and no header, as the PLC's program wrote them."""
    np.savetxt(path, np.column_stack([dt * np.arange(SAMPLES), *columns]), "%.5f", ",")
    return path


def test_volts_of_the_hanging_load_become_metres_from_mid_stroke(tmp_path: Path) -> None:
    volts = np.linspace(0.0, 10.0, SAMPLES)
    path = plain_csv(tmp_path / "HangingLoad.csv", 0.02, volts[::-1], volts, 0.1 * volts - 0.5)
    (record,) = read_records(path, "festo_hanging_load")
    assert record.dt == 0.02
    np.testing.assert_allclose(record["position"], np.linspace(-0.1, 0.1, SAMPLES), atol=2e-7)
    np.testing.assert_allclose(record["reference"], np.linspace(0.1, -0.1, SAMPLES), atol=2e-7)
    np.testing.assert_allclose(record["drive"], 0.1 * volts - 0.5, atol=1e-5)
    assert any("assumed" in note for note in record.notes)


def test_the_motor_keeps_the_volts_of_its_speed(tmp_path: Path) -> None:
    u, y = np.linspace(0.0, 7.0, SAMPLES), np.linspace(0.0, 3.3, SAMPLES)
    (record,) = read_records(plain_csv(tmp_path / "MotorRotation.csv", 0.02, u, y), "festo_motor_rotation")
    np.testing.assert_allclose(record["speed_signal"], y, atol=1e-5)
    assert record.unit("speed_signal") == "V" and set(record.channels) == {"drive", "speed_signal"}


def test_the_two_cylinders_are_channels_of_one_record(tmp_path: Path) -> None:
    signals = [np.linspace(0.0, k, SAMPLES) for k in range(1, 5)]
    (record,) = read_records(plain_csv(tmp_path / "x.csv", 0.1, *signals), "festo_multivariable")
    names = ("reference_0", "reference_1", "position_0", "position_1")
    assert tuple(record.channels) == names
    for name, signal in zip(names, signals, strict=True):
        np.testing.assert_allclose(record[name], signal, atol=1e-5)


def test_the_crane_has_neither_units_nor_a_sampling_time(tmp_path: Path) -> None:
    u, p, x = (np.sin(k * np.arange(SAMPLES))[:, None] for k in (0.1, 0.2, 0.3))
    savemat(tmp_path / "actuator.mat", {"u": u, "p": p, "x": x}, format="4")
    (record,) = read_records(tmp_path / "actuator.mat", "sjoberg_actuator")
    assert record.dt == 1.0 and {record.unit(name) for name in record.channels} == {"1"}
    np.testing.assert_array_equal(record["valve"], u.ravel())
    np.testing.assert_array_equal(record["pressure"], p.ravel())
    np.testing.assert_array_equal(record["arm"], x.ravel())


def emps(path: Path, **change: object) -> Path:
    t = 0.001 * np.arange(SAMPLES)
    variables = {"t": t[:, None], "qg": t[:, None], "qm": 0.9 * t[:, None], "vir": np.sin(t)[:, None], "kp": 160.18}
    savemat(path, {**variables, **change})
    return path


def test_the_positioning_system_has_a_force_from_its_drive(tmp_path: Path) -> None:
    (record,) = read_records(emps(tmp_path / "DATA_EMPS.mat"), "emps")
    assert record.dt == 0.001
    np.testing.assert_allclose(record["force"], 35.15065188248547 * record["drive"])
    np.testing.assert_allclose(record["position"], 0.9 * record["reference"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vir": np.full((SAMPLES, 1), np.nan)}, "row 1, column vir.*nan"),
        ({"qm": np.zeros((SAMPLES - 1, 1))}, "samples"),
        ({"qm": 3.0}, "'qm'"),
        ({"qm": np.array(["a", "b"])}, "'qm'"),
        ({"qm": np.ones((SAMPLES, 1)) * 1j}, "'qm'"),
        ({"t": np.zeros((SAMPLES, 1))}, "row 2, column t.*twice"),
    ],
)
def test_a_wrong_variable_is_named(tmp_path: Path, change: dict[str, object], said: str) -> None:
    with pytest.raises(FileError, match=said) as caught:
        read_records(emps(tmp_path / "DATA_EMPS.mat", **change), "emps")
    assert "DATA_EMPS.mat" in str(caught.value)


def test_variables_that_say_channel_and_unit_need_no_map(tmp_path: Path) -> None:
    t = 0.01 * np.arange(SAMPLES)
    savemat(tmp_path / "run.mat", {"time_s": t, "drive_V": t, "position_mm": 10 * t, "note": "rig 3"})
    (record,) = read_records(tmp_path / "run.mat")
    np.testing.assert_allclose(record["position"], 0.01 * t)
    assert record.dt == 0.01 and set(record.channels) == {"drive", "position"}


def test_a_matrix_gives_its_columns(tmp_path: Path) -> None:
    savemat(tmp_path / "run.mat", {"data": np.column_stack([np.arange(SAMPLES), np.arange(SAMPLES) ** 2])})
    (tmp_path / "map.yaml").write_text(
        "time: {column: data.1, unit: s}\nchannels: {position: {column: data.2, unit: mm}}\n"
    )
    (record,) = read_records(tmp_path / "run.mat", tmp_path / "map.yaml")
    np.testing.assert_allclose(record["position"], 1e-3 * np.arange(SAMPLES) ** 2)


@pytest.mark.parametrize("content", [b"", b"not a MAT file at all", b"MATLAB 5.0 MAT-file" + bytes(200)])
def test_what_is_no_matlab_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(RecordError, match=r"x\.mat"):
        read_records(tmp_path / "x.mat")


@pytest.mark.parametrize("part", [0.1, 0.5, 0.9, 0.999])
def test_a_matlab_file_that_is_cut_off_is_refused(tmp_path: Path, part: float) -> None:
    data = emps(tmp_path / "x.mat").read_bytes()
    (tmp_path / "x.mat").write_bytes(data[: int(part * len(data))])
    with pytest.raises(RecordError, match=r"x\.mat"):
        read_records(tmp_path / "x.mat", "emps")
