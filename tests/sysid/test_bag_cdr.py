"""Blocks of serialised messages give the numbers that one message after the other gives, and the other way."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from hydraulic_sysid.data.bag import cdr

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS, PRESSURE, STRING = "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure", "std_msgs/msg/String"


def joint_state(stamp: int, frame: str, names: list[str], **fields: list[float]) -> bytes:
    types = STORE.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9)), frame)
    arrays = {key: np.array(fields.get(key, []), float) for key in ("position", "velocity", "effort")}
    return bytes(STORE.serialize_cdr(types[JOINTS](header, names, **arrays), JOINTS))


doubles = st.floats(allow_nan=True, allow_infinity=True)
words = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_every_number_and_text_is_that_of_the_message(data: st.DataObject) -> None:
    sizes = {key: data.draw(st.integers(0, 3)) for key in ("position", "velocity", "effort")}
    messages = []
    for _ in range(data.draw(st.integers(1, 12))):
        fields = {k: data.draw(st.lists(doubles, min_size=n, max_size=n)) for k, n in sizes.items()}
        stamp = data.draw(st.integers(0, 2**31 * 10**9 - 1))
        names = data.draw(st.lists(words, max_size=3))
        messages.append(joint_state(stamp, data.draw(words), names, **fields))
    decoded = cdr.decode(JOINTS, messages)
    for index, raw in enumerate(messages):
        one = STORE.deserialize_cdr(raw, JOINTS)
        assert decoded.stamps[index] == one.header.stamp.sec * 10**9 + one.header.stamp.nanosec
        assert decoded.texts["header.frame_id"][index] == (one.header.frame_id,)
        assert decoded.texts["name"][index] == tuple(one.name)
        for key in sizes:
            np.testing.assert_array_equal(decoded.numbers[key][index], getattr(one, key))


def test_encoded_messages_decode_to_the_same_and_match_the_library() -> None:
    stamps = 1_700_000_000_123_456_789 + np.arange(50) * 1_000_000
    effort = np.random.default_rng(3).normal(size=(50, 2))
    template = cdr.stamped(
        JOINTS, "plant", name=["a", "b"], position=np.zeros(0), velocity=np.zeros(0), effort=np.zeros(2)
    )
    numbers = {"header.stamp.sec": stamps // 10**9, "header.stamp.nanosec": stamps % 10**9, "effort": effort}
    messages = cdr.encode(JOINTS, template, numbers)
    assert messages[7] == joint_state(int(stamps[7]), "plant", ["a", "b"], effort=list(effort[7]))
    decoded = cdr.decode(JOINTS, messages)
    np.testing.assert_array_equal(decoded.stamps, stamps)
    np.testing.assert_array_equal(decoded.numbers["effort"], effort)


def test_bytes_between_the_fields_do_not_matter() -> None:
    clean = joint_state(5, "x", ["piston"], position=[1.5])
    # The text "x" ends at byte 18; the next length starts at byte 20 and the two bytes between belong to nobody.
    stale = clean[:18] + b"\xaa\xbb" + clean[20:]
    decoded = cdr.decode(JOINTS, [clean, stale])
    np.testing.assert_array_equal(decoded.numbers["position"], [[1.5], [1.5]])


def test_the_other_byte_order_is_read_too() -> None:
    types = STORE.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](3, 4), "plant")
    message = types[PRESSURE](header, 7.25e6, 0.0)
    payloads = [bytes(STORE.serialize_cdr(message, PRESSURE, little_endian=order)) for order in (True, False)]
    decoded = cdr.decode(PRESSURE, payloads)
    np.testing.assert_array_equal(decoded.numbers["fluid_pressure"], [7.25e6, 7.25e6])
    np.testing.assert_array_equal(decoded.stamps, [3_000_000_004] * 2)


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 200), st.binary(min_size=1, max_size=3))
def test_damaged_messages_are_refused_and_never_crash(cut: int, noise: bytes) -> None:
    whole = joint_state(5, "plant", ["piston", "servovalve"], position=[1.0, 2.0], effort=[3.0, 4.0])
    if cut < len(whole):
        with pytest.raises(cdr.CdrError, match="message 1: "):
            cdr.decode(JOINTS, [whole[:cut]])
        with contextlib.suppress(cdr.CdrError):
            cdr.decode(JOINTS, [whole[:cut] + noise + whole[cut + len(noise) :]])


def test_a_message_of_another_shape_is_named() -> None:
    one, two = joint_state(5, "p", ["x"], effort=[1.0]), joint_state(6, "p", ["x"], effort=[1.0, 2.0])
    with pytest.raises(cdr.CdrError, match="message 3: effort has 2 values, the first message has 1"):
        cdr.decode(JOINTS, [one, one, two, one])


def test_a_field_that_is_not_there_cannot_be_encoded() -> None:
    template = cdr.stamped(PRESSURE, "plant", fluid_pressure=0.0, variance=0.0)
    with pytest.raises(cdr.CdrError, match="no field pressure of shape"):
        cdr.encode(PRESSURE, template, {"pressure": np.zeros(3)})
