"""Whatever stands in a CSV file or a column map: a record, or an error that names the file."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hydraulic_sysid.data.records import CHANNELS, ColumnMapError, RecordError, parse_column_map, read_records


def write(path: Path, content: str | bytes) -> Path:
    data = content.encode() if isinstance(content, str) else content
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


finite = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    dt=st.sampled_from([1e-4, 1e-3, 1 / 300, 0.02, 0.1, 1.0, 7.0]),
    start=st.sampled_from([0.0, -3.0, 1234.5]),
    values=st.lists(st.tuples(finite, finite), min_size=2, max_size=50),
    suffix=st.sampled_from([".csv", ".csv.gz"]),
)
def test_every_finite_number_comes_back_exactly(
    tmp_path: Path, dt: float, start: float, values: list[tuple[float, float]], suffix: str
) -> None:
    rows = [f"{start + k * dt!r},{a!r},{b!r}" for k, (a, b) in enumerate(values)]
    (record,) = read_records(write(tmp_path / f"x{suffix}", "\n".join(["time_s,drive_V,position_m", *rows])))
    assert abs(record.time[-1] - dt * (len(values) - 1)) <= 1e-5 * dt
    np.testing.assert_array_equal(record["drive"], [a for a, _ in values])
    np.testing.assert_array_equal(record["position"], [b for _, b in values])


HEADER = "time_s,command_V,position_m,pressure_a_Pa"
ROWS = [f"{0.001 * k:.9g},{0.5 * k},{0.01 * k:.9g},{7e6 + k:.9g}" for k in range(20)]
VALID = "\n".join([HEADER, *ROWS, ""]).encode()
MAP = parse_column_map({"time": {"dt": 0.1}, "channels": {"drive": {"column": 1, "unit": "V"}}})


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cuts=st.lists(
        st.tuples(st.integers(0, len(VALID)), st.integers(0, 12), st.binary(max_size=6)), min_size=1, max_size=4
    )
)
def test_a_damaged_file_is_a_record_or_a_named_error(tmp_path: Path, cuts: list[tuple[int, int, bytes]]) -> None:
    data = VALID
    for at, length, new in cuts:
        data = data[:at] + new + data[at + length :]
    path = write(tmp_path / "fuzz.csv", data)
    try:
        records = read_records(path)
    except RecordError as error:
        assert "fuzz.csv" in str(error)
    else:
        for record in records:
            assert set(record.channels) <= set(CHANNELS) and len(record) >= 2
            assert all(np.isfinite(values).all() for values in record.channels.values())


@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.text(alphabet=st.sampled_from('0123456789.,;\t\n\r "#-+einfa_V\x0b\x1c\u2028'), max_size=80))
def test_any_text_is_a_record_or_a_named_error(tmp_path: Path, content: str) -> None:
    path = write(tmp_path / "fuzz.csv", content)
    for columns in (None, MAP):
        try:
            read_records(path, columns)
        except RecordError as error:
            assert "fuzz.csv" in str(error)


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_any_column_map_is_one_or_a_named_error(data: st.DataObject) -> None:
    scalars = st.one_of(
        st.none(), st.booleans(), st.integers(-2, 5), st.floats(), st.sampled_from(["V", "s", "m", "", "1"])
    )
    keys = st.sampled_from(
        [
            "time",
            "channels",
            "extra",
            "records",
            "header",
            "delimiter",
            "drive",
            "column",
            "unit",
            "dt",
            "scale",
            "notes",
        ]
    )
    document = data.draw(
        st.recursive(
            scalars, lambda inner: st.one_of(st.lists(inner, max_size=2), st.dictionaries(keys, inner, max_size=4))
        )
    )
    try:
        parse_column_map(document, "map.yaml")
    except ColumnMapError as error:
        assert str(error).startswith("map.yaml")
