"""Bags become records: joined by stamp, cut to experiments, and every fault in them named."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from hydraulic_sysid.data.records import BagError, RecordError, TimeError, read_records

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS, PRESSURE, STRING = "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure", "std_msgs/msg/String"
START = 1_700_000_000_000_000_000
MS = 1_000_000
NAN = float("nan")

Message = tuple[str, int, Any]


def header(stamp: int, frame: str = "plant") -> Any:
    time = STORE.types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
    return STORE.types["std_msgs/msg/Header"](time, frame)


def joints(stamp: int, names: Sequence[str], frame: str = "plant", **fields: Sequence[float]) -> Any:
    arrays = {key: np.array(fields.get(key, ()), float) for key in ("position", "velocity", "effort")}
    return STORE.types[JOINTS](header(stamp, frame), list(names), **arrays)


def state(index: int, **other: float) -> Message:
    value = {"x": 1e-3 * index, "v": 0.5, "force": 10.0 * index, "drive": 0.01 * index, "spool": NAN, **other}
    fields = {
        "position": (value["x"], value["spool"]),
        "velocity": (value["v"], NAN),
        "effort": (value["force"], value["drive"]),
    }
    return ("state", START + index * MS, joints(START + index * MS, ("piston", "servovalve"), **fields))


def pressure(name: str, index: int, value: float | None = None) -> Message:
    stamp = START + index * MS
    value = 1e6 + index if value is None else value
    return (f"pressure_{name}", stamp, STORE.types[PRESSURE](header(stamp), value, 0.0))


def command(stamp: int, drive: float, frame: str = "excitation") -> Message:
    return ("command", stamp, joints(stamp, ("servovalve",), frame, effort=(drive,)))


def event(kind: str, stamp: int, **more: Any) -> Message:
    text = json.dumps({"event": kind, "stamp_ns": stamp, "plan": {"name": "chirp"}, **more})
    return ("experiment", stamp, STORE.types[STRING](text))


def bag(
    folder: Path,
    messages: Sequence[Message],
    plugin: StoragePlugin = StoragePlugin.MCAP,
    namespaces: Sequence[str] = ("/actuator",),
) -> Path:
    """Written by a library of its own, so that what reads it is not tested by what wrote it."""
    types = {"experiment": STRING, "description": STRING, "pressure": PRESSURE}
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        known = {}
        for name, stamp, message in sorted(messages, key=lambda m: m[1]):
            kind = types.get(name.partition("_")[0], JOINTS)
            for full in (f"{namespace}/{name}" for namespace in namespaces):
                if full not in known:
                    known[full] = writer.add_connection(full, kind, typestore=STORE)
                writer.write(known[full], stamp + 100_000, STORE.serialize_cdr(message, kind))
    return folder


def streams(count: int = 100) -> Iterator[Message]:
    for index in range(count):
        yield state(index)
        yield pressure("a", index)
        yield pressure("b", index, 2e6 - index)
        yield pressure("supply", index, NAN)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_samples_of_one_stamp_are_joined(tmp_path: Path, plugin: StoragePlugin) -> None:
    (record,) = read_records(bag(tmp_path / "run", list(streams()), plugin))
    index = np.arange(100)
    assert (record.name, record.dt, len(record)) == ("run", 0.001, 100)
    np.testing.assert_array_equal(record["position"], 1e-3 * index)
    np.testing.assert_array_equal(record["force"], 10.0 * index)
    np.testing.assert_array_equal(record["drive"], 0.01 * index)
    np.testing.assert_array_equal(record["pressure_a"], 1e6 + index)
    np.testing.assert_array_equal(record["pressure_b"], 2e6 - index)
    assert record.description["start_ns"] == START


@pytest.mark.parametrize("namespace", ["/left", "/hall_2/left", ""])
def test_an_actuator_in_a_namespace_of_its_own_is_read(tmp_path: Path, namespace: str) -> None:
    messages = [*streams(), event("started", START + 10 * MS), event("finished", START + 60 * MS)]
    (record,) = read_records(bag(tmp_path / "run", messages, namespaces=[namespace]))
    assert len(record) == 50 and "pressure_b" in record
    with pytest.raises(TimeError, match=f"column {namespace}/state: stamp"):
        read_records(bag(tmp_path / "twice", [*streams(), state(99)], namespaces=[namespace]))


def test_of_two_actuators_one_has_to_be_named_by_the_contract(tmp_path: Path) -> None:
    (record,) = read_records(bag(tmp_path / "run", list(streams()), namespaces=["/actuator", "/left"]))
    assert any("/left is not" in note for note in record.notes)
    with pytest.raises(BagError, match="several actuators: /left, /right; expected a bag of each"):
        read_records(bag(tmp_path / "both", list(streams()), namespaces=["/left", "/right"]))


def test_what_was_not_measured_is_absent(tmp_path: Path) -> None:
    (record,) = read_records(bag(tmp_path / "run", list(streams())))
    assert set(record.channels) == {"drive", "position", "velocity", "force", "pressure_a", "pressure_b"}


def test_the_join_goes_by_stamp_and_not_by_order(tmp_path: Path) -> None:
    late = [(name, stamp, message) for name, stamp, message in streams() if name != "pressure_a"]
    late += [("pressure_a", START + 10**9, pressure("a", index)[2]) for index in range(100)]
    (record,) = read_records(bag(tmp_path / "run", late))
    np.testing.assert_array_equal(record["pressure_a"], 1e6 + np.arange(100))


def test_ends_without_partner_are_left_out_and_noted(tmp_path: Path) -> None:
    messages = [m for m in streams() if not (m[0] == "pressure_b" and m[1] < START + 3 * MS)]
    (record,) = read_records(bag(tmp_path / "run", messages))
    assert len(record) == 97 and record["position"][0] == 0.003
    assert "state: 3 of 100 samples have no partner in another topic" in record.notes


def test_the_command_holds_until_the_next_one(tmp_path: Path) -> None:
    commands = [command(START + 2 * MS, 1.0), command(START + 4 * MS - 1, 2.0), command(START + 4 * MS, 3.0)]
    (record,) = read_records(bag(tmp_path / "run", [*streams(8), *commands]))
    np.testing.assert_array_equal(record["command"], [0, 0, 1, 1, 3, 3, 3, 3])
    assert any("none before the first 2 samples; 0 V" in note for note in record.notes)
    np.testing.assert_array_equal(record["drive"], 0.01 * np.arange(8))


def test_commands_of_several_sources_are_ordered_by_stamp(tmp_path: Path) -> None:
    commands = [command(START + k * MS, float(k), "a rather long name" if k % 2 else "b") for k in range(8)]
    (record,) = read_records(bag(tmp_path / "run", [*streams(8), *commands]))
    np.testing.assert_array_equal(record["command"], np.arange(8))


def test_a_reference_is_a_channel(tmp_path: Path) -> None:
    follow = ("reference", START, joints(START, ("piston",), position=(0.25,), velocity=(0.0,)))
    (record,) = read_records(bag(tmp_path / "run", [*streams(8), follow]))
    np.testing.assert_array_equal(record["reference"], np.full(8, 0.25))


def test_an_experiment_cuts_the_record(tmp_path: Path) -> None:
    events = [event("started", START + 10 * MS), event("finished", START + 60 * MS)]
    (record,) = read_records(bag(tmp_path / "run", [*streams(), *events]))
    assert (record.name, len(record), record["position"][0]) == ("run", 50, 0.01)
    assert record.description["experiment"]["event"] == "finished"
    assert record.description["experiment"]["plan"] == {"name": "chirp"}


def test_what_happened_before_the_experiment_is_not_noted(tmp_path: Path) -> None:
    events = [event("started", START + 10 * MS), event("finished", START + 60 * MS, played=49)]
    first = command(START + 10 * MS, 1.0)
    (record,) = read_records(bag(tmp_path / "run", [*streams(), *events, first]))
    assert record.notes == [] and record["command"].min() == 1.0
    assert record.description["experiment"]["played"] == 49
    (record,) = read_records(bag(tmp_path / "late", [*streams(), *events, command(START + 12 * MS, 1.0)]))
    assert record.notes == ["command: none before the first 2 samples; 0 V there, as the plant applies"]


def test_every_experiment_is_a_record_and_one_that_was_aborted_says_so(tmp_path: Path) -> None:
    events = [
        event("started", START + 10 * MS),
        event("aborted", START + 30 * MS, reason="end stop"),
        event("started", START + 50 * MS),
    ]
    first, second = read_records(bag(tmp_path / "run", [*streams(), *events]))
    assert (first.name, len(first), second.name, len(second)) == ("run.1", 20, "run.2", 50)
    assert "experiment: aborted (end stop)" in first.notes
    assert "experiment: the bag does not hold its end" in second.notes


def test_an_experiment_that_ended_at_once_is_left_out(tmp_path: Path) -> None:
    at_once = [event("started", START + 10 * MS), event("aborted", START + 10 * MS, reason="not enabled")]
    later = [event("started", START + 50 * MS), event("finished", START + 80 * MS)]
    (record,) = read_records(bag(tmp_path / "run", [*streams(), *at_once, *later]))
    assert (record.name, len(record)) == ("run", 30)
    assert "experiment: 1 more in the bag ended at once" in record.notes
    with pytest.raises(BagError, match="every experiment in it ended before its second sample"):
        read_records(bag(tmp_path / "none", [*streams(), *at_once]))


def test_the_end_belongs_to_the_experiment_that_it_names(tmp_path: Path) -> None:
    events = [
        event("started", START + 10 * MS, started_ns=7),
        event("aborted", START + 20 * MS, started_ns=3),
        event("finished", START + 60 * MS, started_ns=7),
    ]
    (record,) = read_records(bag(tmp_path / "run", [*streams(), *events]))
    assert len(record) == 50 and record.description["experiment"]["event"] == "finished"


def test_other_messages_on_the_experiment_topic_change_nothing(tmp_path: Path) -> None:
    chatter = [("experiment", START + 5, STORE.types[STRING](text)) for text in ("", "hello", "[1]", '{"event": 1}')]
    events = [event("finished", START - 5 * MS), event("started", START - 10 * MS), *chatter]
    (record,) = read_records(bag(tmp_path / "run", [*streams(), *events]))
    assert len(record) == 100 and "experiment" not in record.description


def without(index: int, name: str) -> list[Message]:
    return [m for m in streams() if not (m[0] == name and m[1] == START + index * MS)]


@pytest.mark.parametrize("name", ["state", "pressure_a"])
def test_a_lost_sample_is_named_and_can_be_bridged(tmp_path: Path, name: str) -> None:
    path = bag(tmp_path / "run", without(50, name))
    with pytest.raises(TimeError, match=r"row 51, column stamp of /actuator/state: 1 sample missing: 0.002 s"):
        read_records(path)
    first, second = read_records(path, "split")
    assert (first.name, len(first), second.name, len(second)) == ("run.1", 50, "run.2", 49)
    (whole,) = read_records(path, "resample")
    np.testing.assert_allclose(whole["position"], 1e-3 * np.arange(100), atol=1e-12)


STATES = [state(index) for index in range(100)]
OTHER_JOINTS = [("state", START + k, joints(START + k, ("rod",), position=(1.0,))) for k in range(3)]
NO_EFFORT = [
    ("state", START + k, joints(START + k, ("piston", "servovalve"), position=(1.0, 2.0), velocity=(1.0, 2.0)))
    for k in range(3)
]


@pytest.mark.parametrize(
    ("messages", "text"),
    [
        ([*STATES, state(100), state(100)], r"row 102, column /actuator/state: stamp \d+ ns is there twice"),
        ([pressure("a", 0)], r"no messages of /actuator/state; there is /actuator/pressure_a"),
        ([*STATES, state(100, x=NAN)], r"row 101: position is nan at stamp \d+ ns and 1 samples in all; expected"),
        ([state(0), pressure("a", 5)], r"0 stamps are in all of state, pressure_a; expected two or more"),
        ([state(0), pressure("a", 0)], r"1 stamps are in all"),
        (OTHER_JOINTS, r"/actuator/state: joints are \[\('rod',\)\]; expected 'piston' in all"),
        (NO_EFFORT, r"/actuator/state: effort has 0 values; expected 2"),
    ],
)
def test_what_is_wrong_in_a_bag_is_named(tmp_path: Path, messages: list[Message], text: str) -> None:
    with pytest.raises(RecordError, match=text) as caught:
        read_records(bag(tmp_path / "run", messages))
    assert str(tmp_path / "run") in str(caught.value)


def test_jitter_of_the_stamps_does_not_show_in_the_record(tmp_path: Path) -> None:
    noise = np.random.default_rng(4).integers(-90_000, 90_000, 200)
    messages = []
    for index in range(200):
        name, stamp, message = state(index)
        message.header.stamp.nanosec = int((stamp + noise[index]) % 10**9)
        message.header.stamp.sec = int((stamp + noise[index]) // 10**9)
        messages.append((name, stamp, message))
    (record,) = read_records(bag(tmp_path / "run", messages))
    assert record.dt == 0.001 and np.diff(record.time) == pytest.approx(0.001)
    assert 5e-5 < record.description["stamp_deviation_s"]["max"] < 1e-4
    assert any("stamps are off the even grid" in note for note in record.notes)


def test_a_bag_that_was_not_closed_says_what_to_do(tmp_path: Path) -> None:
    path = bag(tmp_path / "run", list(streams()))
    (path / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=r"was not closed \(no metadata.yaml\).*python -m hydraulic_sysid recover"):
        read_records(path)


@pytest.mark.parametrize("keep", [0, 8, 100, -200, -1])
def test_a_bag_that_was_cut_off_says_what_to_do(tmp_path: Path, keep: int) -> None:
    path = bag(tmp_path / "run", list(streams()))
    (file,) = path.glob("*.mcap")
    data = file.read_bytes()
    file.write_bytes(data[:keep])
    with pytest.raises(BagError, match=r"cut off or damaged .* python -m hydraulic_sysid recover"):
        read_records(path)


def test_what_the_plant_says_of_itself_goes_into_the_record(tmp_path: Path) -> None:
    told = {"hardware": "can: bench", "imitated_effects": ["valve_deadband"], "devices": {"valve": {"settings": []}}}
    texts = [json.dumps({"hardware": "older"}), json.dumps(told), "no JSON", "[1]"]
    messages = [("description", START + n, STORE.types[STRING](text)) for n, text in enumerate(texts)]
    (record,) = read_records(bag(tmp_path / "bag", [*streams(), *messages]))
    assert record.description["plant"] == told
    assert any("imitate valve_deadband" in note for note in record.description["notes"])


def test_a_plant_that_says_nothing(tmp_path: Path) -> None:
    (record,) = read_records(bag(tmp_path / "bag", list(streams())))
    assert "plant" not in record.description
