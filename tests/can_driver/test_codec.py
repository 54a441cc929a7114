"""Quantities to bytes and back: examples by hand, and what must hold for all of them."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hydraulic_can_driver.bus import TYPES, Address, Pdo, Scale, Signal
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.codec import PdoCodec, object_bytes, object_value, raw_range, to_quantity, to_raw
from hydraulic_can_driver.errors import CodecError

INTEGERS = sorted(set(TYPES) - {"f32"})
kinds = st.sampled_from(INTEGERS)


@pytest.mark.parametrize(
    ("word", "volts", "data"),
    [
        (0, 0.0, "0000 0000"),
        (7, 10.0, "0700 0040"),
        (7, -10.0, "0700 00c0"),
        (7, 5.0, "0700 0020"),
        (1, -1e-3, "0100 feff"),
        (9, 0.0, "0900 0000"),
    ],
)
def test_drive_frames(word: int, volts: float, data: str) -> None:
    codec = PdoCodec(load_bus("bench").drive_pdo)
    frame, cut = codec.encode({"control_word": word, "drive": volts})
    assert frame == bytes.fromhex(data) and not cut


def test_frames_of_the_devices() -> None:
    bus = load_bus("bench")
    pdos = {pdo.cob_id: PdoCodec(pdo) for node in bus.nodes.values() for pdo in node.transmit}
    assert pdos[0x490].decode(bytes.fromhex("0f00 0020")) == {"status_word": 0x0F, "spool": 0.25e-3}
    found = pdos[0x1A0].decode(bytes.fromhex("90a00b00 9cff 02"))
    assert found == {"position": pytest.approx(0.0), "velocity": pytest.approx(-5e-3), "switches": 2}
    assert pdos[0x1B0].decode(bytes.fromhex("b036 00")) == {"pressure_a": 14e6, "pressure_a_status": 0}


def test_saturation_is_told_and_nonsense_refused() -> None:
    codec = PdoCodec(load_bus("bench").drive_pdo)
    assert codec.encode({"control_word": 7, "drive": 25.0}) == (bytes.fromhex("0700 ff7f"), ("drive",))
    assert codec.encode({"control_word": 7, "drive": -25.0}) == (bytes.fromhex("0700 0080"), ("drive",))
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(CodecError, match="finite"):
            codec.encode({"control_word": 7, "drive": value})
    with pytest.raises(CodecError, match="carries 'drive'"):
        codec.pack({"control_word": 7})
    for length in set(range(9)) - {4}:
        with pytest.raises(CodecError, match=f"{length} bytes; mapped are 4"):
            codec.unpack(bytes(length))


@given(kinds, st.data(), st.floats(1e-9, 1e6), st.sampled_from([1.0, -1.0]), st.floats(-1e3, 1e3))
def test_every_raw_value_comes_back(kind: str, data: st.DataObject, gain: float, sign: float, offset: float) -> None:
    low, high = map(int, raw_range(kind))
    raw = data.draw(st.integers(low, high))
    scale = Scale(sign * gain, offset, "m")
    address = Address(0x6000, 1, kind)
    assert object_value(object_bytes(raw, address), address) == raw
    back, cut = to_raw(to_quantity(raw, scale), scale, kind)
    # A gain far below the offset's own resolution cannot be told from it.
    blur = math.ceil(2.0 * math.ulp(abs(offset) + gain * abs(raw)) / gain)
    assert abs(back - raw) <= blur and (not cut or raw in (low, high))


@given(kinds, st.floats(-1e7, 1e7), st.floats(1e-6, 1e3))
def test_rounding_is_to_the_nearest_count_and_never_out_of_range(kind: str, quantity: float, gain: float) -> None:
    scale, (low, high) = Scale(gain, 0.0, "m"), raw_range(kind)
    raw, cut = to_raw(quantity, scale, kind)
    assert low <= raw <= high
    if not cut:
        assert abs(to_quantity(raw, scale) - quantity) <= 0.5 * gain * (1.0 + 1e-9) + math.ulp(quantity)


@given(st.lists(kinds, min_size=1, max_size=8), st.data())
def test_frames_come_back(types: list[str], data: st.DataObject) -> None:
    signals = tuple(Signal(f"s{n}", Address(0x6000 + n, 0, kind)) for n, kind in enumerate(types))
    pdo = Pdo(1, 0x181, 1, signals)
    raw = {s.name: data.draw(st.integers(*map(int, raw_range(s.address.type)))) for s in signals}
    codec = PdoCodec(pdo)
    frame = codec.pack(raw)
    assert len(frame) == pdo.length == sum(struct.calcsize(TYPES[kind]) for kind in types)
    assert dict(zip(codec.names, codec.unpack(frame), strict=True)) == raw == codec.decode(frame)


def test_objects_that_do_not_fit() -> None:
    with pytest.raises(CodecError, match="0x6042:0: 128 is no i8; allowed: -128 ... 127"):
        object_bytes(128, Address(0x6042, 0, "i8"))
    with pytest.raises(CodecError, match="2 bytes; u32 has 4"):
        object_value(b"ab", Address(0x1000, 0, "u32"))


def test_mapping_entries() -> None:
    bus = load_bus("bench")
    assert [s.address.mapping for s in bus.drive_pdo.signals] == [0x60400010, 0x63000110]
    assert [s.address.mapping for s in bus.nodes["lvdt"].transmit[0].signals] == [0x60040020, 0x60300110, 0x64000108]
