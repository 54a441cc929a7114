"""Serialised messages of a stream to stamps and values."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rclpy")

from hydraulic_interfaces.conversions import CommandEncoder, PressureEncoder, StateEncoder
from hydraulic_interfaces.samples import PlantSample
from hydraulic_workbench.columns import COLUMNS, streams
from hydraulic_workbench.stream_decoder import StreamDecoder

JOINTS, PRESSURE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure"


def columns(topic: str) -> list:
    return [COLUMNS[i] for i in streams()[topic]]


def test_a_state_becomes_its_columns() -> None:
    decode, encode = StreamDecoder(JOINTS, columns("state")), StateEncoder()
    samples = [
        PlantSample(10**18 + i * 10**6, 0.1 * i, 0.2, 300.0, 4.0 + i, math.nan if i else 1e-4) for i in range(40)
    ]
    for _ in range(2):  # the second time the layout is known
        stamps, values = decode([encode(s) for s in samples])
        assert stamps.tolist() == [s.stamp_ns for s in samples]
        wanted = {"position": [s.position for s in samples], "drive": [s.drive for s in samples]}
        for name, row in wanted.items():
            index = [c.key for c in columns("state")].index(name)
            assert values[index].tolist() == pytest.approx(row, rel=1e-6)
        spool = values[[c.key for c in columns("state")].index("spool")]
        assert spool[0] == pytest.approx(1e-4) and np.isnan(spool[1:]).all()


def test_sources_that_take_turns_are_both_read() -> None:
    decode = StreamDecoder(JOINTS, columns("command"))
    one, other = CommandEncoder("excitation"), CommandEncoder("controller_of_somebody")
    stamps, values = decode([one(1, 1.0), other(2, 2.0), one(3, 3.0)])
    assert stamps.tolist() == [1, 2, 3] and values[0].tolist() == [1.0, 2.0, 3.0]


def test_what_is_no_such_message_is_counted_and_left_out() -> None:
    decode, encode = StreamDecoder(PRESSURE, columns("pressure_a")), PressureEncoder()
    stamps, values = decode([b"", b"\x00\x01\x00\x00\xff", encode(5, 2e5)])
    assert stamps.tolist() == [5] and values[0].tolist() == [2e5] and decode.refused == 2
