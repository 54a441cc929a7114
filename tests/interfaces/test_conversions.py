from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from hydraulic_interfaces import conversions as cv  # noqa: E402
from hydraulic_interfaces.contract import SERVICES, TOPICS, service, topic  # noqa: E402
from hydraulic_interfaces.samples import Command, PlantSample, Reference  # noqa: E402

stamps = st.integers(0, (2**31 - 1) * 10**9 + 999_999_999)
numbers = st.floats(allow_nan=True, allow_infinity=True)
samples = st.builds(
    PlantSample,
    stamps,
    numbers,
    numbers,
    numbers,
    numbers,
    numbers,
    numbers,
    numbers,
    numbers,
    st.booleans(),
    st.booleans(),
)


def same(a: Any, b: Any) -> bool:
    """Equality in which NaN equals NaN; of dataclasses, field by field."""
    names = a.__dataclass_fields__
    pairs = [(getattr(a, name), getattr(b, name)) for name in names]
    return all(x == y or (isinstance(x, float) and math.isnan(x) and math.isnan(y)) for x, y in pairs)


@settings(deadline=None)
@given(samples)
def test_a_sample_survives_the_messages(sample: PlantSample) -> None:
    state, a, b, supply = cv.sample_to_messages(sample)
    back = cv.sample_from_messages(state, a, b, supply, sample.limit_retracted, sample.limit_extended)
    assert same(sample, back)


@settings(deadline=None)
@given(samples)
def test_encoders_write_what_serialisation_writes(sample: PlantSample) -> None:
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import FluidPressure, JointState

    state = cv.state_to_message(sample)
    fast = cv.StateEncoder()(sample)
    assert len(fast) <= len(serialize_message(state))
    back = cv.sample_from_messages(deserialize_message(fast, JointState))
    assert same(cv.sample_from_messages(state), back)
    pressure = deserialize_message(cv.PressureEncoder()(sample.stamp_ns, sample.pressure_a), FluidPressure)
    wanted = cv.pressure_to_message(sample.stamp_ns, sample.pressure_a)
    assert pressure.header == wanted.header
    assert repr(pressure.fluid_pressure) == repr(wanted.fluid_pressure)
    assert pressure.variance == wanted.variance == 0.0


@settings(deadline=None)
@given(stamps, st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=40), numbers)
def test_a_command_survives_message_and_encoder(stamp: int, source: str, drive: float) -> None:
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    command = Command(stamp, source, drive)
    assert same(command, cv.command_from_message(cv.command_to_message(command)))
    fast = deserialize_message(cv.CommandEncoder(source)(stamp, drive), JointState)
    assert same(command, cv.command_from_message(fast))


@settings(deadline=None)
@given(stamps, numbers, numbers)
def test_a_reference_survives_the_message(stamp: int, position: float, velocity: float) -> None:
    reference = Reference(stamp, position, velocity)
    assert same(reference, cv.reference_from_message(cv.reference_to_message(reference)))


def test_clock_encoder() -> None:
    from rclpy.serialization import deserialize_message
    from rosgraph_msgs.msg import Clock

    assert cv.from_time(deserialize_message(cv.ClockEncoder()(1_234_567_890_123), Clock).clock) == 1_234_567_890_123


def test_encoders_write_no_byte_too_many() -> None:
    """A reader that checks the length of a message must accept them."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    joints, pressure = "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure"
    for source in ("", "a", "ab", "abc", "source", "a longer name"):
        message = store.deserialize_cdr(cv.CommandEncoder(source)(5, 1.5), joints)
        assert (message.header.frame_id, list(message.effort)) == (source, [1.5])
    sample = PlantSample(5, 1.0, 2.0, 3.0, 4.0, 5.0)
    assert list(store.deserialize_cdr(cv.StateEncoder()(sample), joints).effort) == [3.0, 4.0]
    assert store.deserialize_cdr(cv.PressureEncoder()(5, 7e6), pressure).fluid_pressure == 7e6


def test_encoded_references_are_the_messages() -> None:
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    from hydraulic_interfaces.samples import Reference

    encode = cv.ReferenceEncoder()
    for reference in (Reference(5, 0.25, -1.5), Reference(1_700_000_000_123_456_789, -0.1, 0.0)):
        data = encode(reference.stamp_ns, reference.position, reference.velocity)
        assert cv.reference_from_message(deserialize_message(data, JointState)) == reference


def test_an_encoder_can_be_used_again() -> None:
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    encode = cv.CommandEncoder("a")
    first, second = encode(1, 1.0), encode(2, 2.0)
    assert cv.command_from_message(deserialize_message(first, JointState)).drive == 1.0
    assert cv.command_from_message(deserialize_message(second, JointState)).drive == 2.0


@pytest.mark.parametrize(
    ("names", "effort", "complaint"),
    [
        ([], [1.0], "name"),
        (["piston"], [1.0], "name"),
        (["servovalve", "x"], [1.0, 2.0], "name"),
        (["servovalve"], [], "0 values"),
    ],
)
def test_what_is_not_a_command(names: list[str], effort: list[float], complaint: str) -> None:
    from sensor_msgs.msg import JointState

    with pytest.raises(cv.MessageError, match=complaint):
        cv.command_from_message(JointState(name=names, effort=effort))


def test_pressures_of_another_instant_are_refused() -> None:
    state, a, _, _ = cv.sample_to_messages(PlantSample(1, 0.0))
    late = cv.pressure_to_message(2, 0.0)
    with pytest.raises(cv.MessageError, match="pressure_b: stamp 2 ns is not the state's 1 ns"):
        cv.sample_from_messages(state, a, late)


def test_the_tables_name_existing_types() -> None:
    for row in TOPICS:
        assert cv.interface_class(row.type)
        assert topic(row.name) == (row.name if row.name.startswith("/") else f"/actuator/{row.name}")
    for row in SERVICES:
        assert cv.interface_class(row.type)
        assert service(row.name) == f"/actuator/{row.name}"
    with pytest.raises(KeyError, match="not in the contract"):
        topic("nonsense")
