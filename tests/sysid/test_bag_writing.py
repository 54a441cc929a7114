"""Writing bags: what rosbags and mcap read back, and what happens when the disk does not take it."""

import json
import os
import struct
import threading
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from ruamel.yaml import YAML

from hydraulic_interfaces.contract import TOPICS, topic
from hydraulic_sysid.data.bag import (
    BagTopic,
    BagWriter,
    ExperimentLog,
    Recording,
    StopRule,
    message_type,
    offered_qos,
    recover,
)
from hydraulic_sysid.data.bag.continuity import Continuity
from hydraulic_sysid.data.bag.types import header_stamp, typestore
from hydraulic_sysid.data.errors import BagError

SECOND = 10**9
START = 1_700_000_000 * SECOND
PRESSURE_TYPE = message_type("sensor_msgs/msg/FluidPressure")
PRESSURE = BagTopic(topic("pressure_a"), PRESSURE_TYPE, (offered_qos(100, False),))
LIMIT = BagTopic(topic("limit_extended"), message_type("std_msgs/msg/Bool"), (offered_qos(1, True),))
EXPERIMENT = BagTopic(topic("experiment"), message_type("std_msgs/msg/String"), (offered_qos(1, True),))


def pressure(stamp_ns: int, value: float) -> bytes:
    kinds = typestore().types
    stamp = kinds["builtin_interfaces/msg/Time"](*divmod(stamp_ns, SECOND))
    header = kinds["std_msgs/msg/Header"](stamp, "plant")
    message = kinds["sensor_msgs/msg/FluidPressure"](header, value, 0.0)
    return bytes(typestore().serialize_cdr(message, "sensor_msgs/msg/FluidPressure"))


def text(value: str) -> bytes:
    message = typestore().types["std_msgs/msg/String"](value)
    return bytes(typestore().serialize_cdr(message, "std_msgs/msg/String"))


def event(kind: str) -> bytes:
    return text(json.dumps({"event": kind, "plan": {"name": "chirp"}, "reason": "because"}))


def write_some(folder: Path, count: int = 100, chunk: int = 10) -> None:
    writer = BagWriter(folder, {"description": "a: 'test'\nof ü"})
    for k in range(count):
        stamp = START + k * 1_000_000
        writer.write(PRESSURE, stamp + 500, stamp, pressure(stamp, float(k)), k + 1)
        if k % chunk == chunk - 1:
            writer.flush()
    writer.write(LIMIT, START + 1, START + 1, b"\x00\x01\x00\x00\x01")
    writer.close()


def size_of(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.glob("*.mcap"))


def test_rosbags_reads_it(tmp_path: Path) -> None:
    write_some(tmp_path / "bag")
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 101
        assert (reader.start_time, reader.duration) == (START + 1, 99_000_500)
        assert reader.storage.metadata.custom["description"] == "a: 'test'\nof ü"
        found = {c.topic: c for c in reader.connections}
        assert found[PRESSURE.name].msgtype == "sensor_msgs/msg/FluidPressure"
        assert found[LIMIT.name].ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"
        rows = list(reader.messages([found[PRESSURE.name]]))
        values = [typestore().deserialize_cdr(raw, c.msgtype).fluid_pressure for c, _, raw in rows]
    assert values == [float(k) for k in range(100)]


def test_mcap_reads_it(tmp_path: Path) -> None:
    write_some(tmp_path / "bag")
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 101
        assert {(s.name, s.encoding) for s in summary.schemas.values()} == {
            ("sensor_msgs/msg/FluidPressure", "ros2msg"),
            ("std_msgs/msg/Bool", "ros2msg"),
        }
        channel = next(c for c in summary.channels.values() if c.topic == PRESSURE.name)
        assert channel.message_encoding == "cdr"
        assert channel.metadata["topic_type_hash"] == PRESSURE.type.hash
        offered = YAML(typ="safe").load(channel.metadata["offered_qos_profiles"])
        assert offered == [offered_qos(100, False)]
        rows = [m for _, c, m in reader.iter_messages() if c.topic == PRESSURE.name]
        assert [(m.log_time, m.publish_time, m.sequence) for m in rows] == [
            (START + k * 1_000_000 + 500, START + k * 1_000_000, k + 1) for k in range(100)
        ]
        kept = {m.name: m.metadata for m in reader.iter_metadata()}
    # `ros2 bag` reads this record when it is given the file alone.
    inner = YAML(typ="safe").load(kept["rosbag2"]["serialized_metadata"])
    outer = YAML(typ="safe").load((tmp_path / "bag" / "metadata.yaml").read_text())
    assert inner == outer["rosbag2_bagfile_information"]
    assert (inner["version"], inner["storage_identifier"], inner["ros_distro"]) == (9, "mcap", "jazzy")


@pytest.mark.parametrize("name", sorted({row.type for row in TOPICS}))
def test_definitions_are_complete(name: str) -> None:
    kind = message_type(name)
    types = get_types_from_msg(kind.definition, name)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    assert store.hash_rihs01(name) == kind.hash
    assert kind.stamped == ("header" in [field for field, _ in types[name][1]])


def test_a_type_that_is_none() -> None:
    with pytest.raises(KeyError, match="my_msgs/msg/Odd"):
        message_type("my_msgs/msg/Odd")


@pytest.mark.parametrize("order", ["<", ">"])
def test_stamp_of_either_byte_order(order: str) -> None:
    data = bytes([0, order == "<", 0, 0]) + struct.pack(f"{order}iI", 5, 7)
    assert header_stamp(data) == 5 * SECOND + 7


def test_an_existing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="exists"):
        BagWriter(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(BagError, match="exists"):
        BagWriter(tmp_path / "file")
    with pytest.raises(BagError, match="cannot be made"):
        BagWriter(tmp_path / "file" / "bag")


def test_an_empty_bag_is_a_bag(tmp_path: Path) -> None:
    BagWriter(tmp_path / "bag").close()
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 0


def test_a_recording_is_on_the_disk_before_it_is_closed(tmp_path: Path, wait_until: Any) -> None:
    recording = Recording(tmp_path / "bag", {"description": "x"})
    size = size_of(tmp_path / "bag")
    for k in range(50):
        recording.append(PRESSURE, pressure(START + k, float(k)), START + k + 1, sequence=k + 1)
    wait_until(lambda: size_of(tmp_path / "bag") > size, "a flush")
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "bag_0.mcap").write_bytes((tmp_path / "bag" / "bag_0.mcap").read_bytes())
    assert recover(copy).summary.messages == {PRESSURE.name: 50}
    assert recording.close().messages == {PRESSURE.name: 50}


def test_a_disk_that_is_busy_costs_no_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wait_until: Any) -> None:
    busy, done = threading.Event(), threading.Event()

    def slow(handle: int) -> None:
        busy.set()
        done.wait()

    monkeypatch.setattr(os, "fdatasync", slow)
    recording = Recording(tmp_path / "bag")
    recording.append(PRESSURE, pressure(START, 1.0), START)
    assert busy.wait(60.0)
    size = size_of(tmp_path / "bag")
    recording.append(PRESSURE, pressure(START + 1, 1.0), START + 1)
    try:
        wait_until(lambda: size_of(tmp_path / "bag") > size, "a flush while the disk is busy")
    finally:
        done.set()
    assert recording.close().messages == {PRESSURE.name: 2}


def test_publish_time_is_the_stamp_or_when_it_was_sent(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "bag")
    recording.append(PRESSURE, pressure(START, 1.0), START + 20, sent_ns=START + 10)
    recording.append(PRESSURE, pressure(0, 1.0), START + 30, sent_ns=START + 10)
    recording.append(LIMIT, b"\x00\x01\x00\x00\x01", START + 40, sent_ns=START + 15)
    recording.append(LIMIT, b"\x00\x01\x00\x00\x01", START + 50)
    recording.close()
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        times = [m.publish_time for _, _, m in make_reader(stream).iter_messages()]
    assert times == [START, START + 30, START + 15, START + 50]


def test_a_full_disk_is_told_and_nothing_is_lost_that_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wait_until: Any
) -> None:
    recording = Recording(tmp_path / "bag")
    size = size_of(tmp_path / "bag")
    recording.append(PRESSURE, pressure(START, 1.0), START)
    wait_until(lambda: size_of(tmp_path / "bag") > size, "a flush")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fdatasync", full)
    recording.append(PRESSURE, pressure(START + 1, 1.0), START + 1)
    with pytest.raises(OSError, match="No space left"):
        recording.close()
    assert recording.error is not None
    monkeypatch.undo()
    assert recover(tmp_path / "bag").summary.messages[PRESSURE.name] >= 1


def test_the_end_of_an_experiment_counts_only_after_its_start() -> None:
    log = ExperimentLog()
    for odd in (event("finished"), text("not JSON"), text("[1]"), text('{"a": 1}'), b"\x00"):
        log.take(odd)
        assert not log.ended and log.custom_data() == {}
    log.take(event("started"))
    assert not log.ended
    log.take(event("aborted"))
    assert log.ended and log.outcome == "aborted"
    assert json.loads(log.custom_data()["experiment"])["plan"] == {"name": "chirp"}
    assert json.loads(log.custom_data()["experiment_end"])["reason"] == "because"
    log.take(event("started"))
    assert not log.ended and "experiment_end" not in log.custom_data()


def test_stop_rule() -> None:
    log = ExperimentLog()
    log.take(event("started"))
    log.take(event("finished"))
    never = StopRule(0.0, on_experiment_end=False)
    assert not never.reason(SECOND, SECOND, log) and not never.reason(10**6 * SECOND, 10**6 * SECOND, log)
    timed = StopRule(2.0, on_experiment_end=False)
    clocks = (0, 100 * SECOND, 101 * SECOND, 102 * SECOND)  # a simulated clock that comes late
    assert [timed.reason(c, 5, log) for c in clocks] == ["", "", "", "max_duration"]
    ending = StopRule(0.0, on_experiment_end=True)
    assert [ending.reason(1, s, log) for s in (SECOND, SECOND + 10**7, 2 * SECOND)] == [
        "",
        "",
        "experiment finished",
    ]


def test_an_experiment_ends_when_the_streams_have_come_as_far() -> None:
    log = ExperimentLog()
    log.take(event("started"))
    log.take(text(json.dumps({"event": "aborted", "stamp_ns": 50})))
    rule = StopRule(0.0, on_experiment_end=True)
    assert not rule.reason(1, SECOND, log, 40)
    assert not rule.reason(1, 3 * SECOND, log, 49)
    assert rule.reason(1, 3 * SECOND, log, 50) == "experiment aborted"
    assert rule.reason(1, 3 * SECOND, log, None) == "experiment aborted"
    assert rule.reason(1, 6 * SECOND, log, 49) == "experiment aborted"  # the plant has gone


def test_a_late_experiment_gets_its_own_time_to_arrive() -> None:
    log = ExperimentLog()
    rule = StopRule(0.0, on_experiment_end=True)
    for start in (1, 101):
        log.take(event("started"))
        assert not rule.reason(1, start * SECOND, log, 40)
        log.take(text(json.dumps({"event": "finished", "stamp_ns": 50})))
        assert not rule.reason(1, (start + 1) * SECOND, log, 40)
    assert rule.reason(1, 106 * SECOND, log, 40) == "experiment finished"


def test_continuity() -> None:
    one = Continuity()
    one.publishers_are(1)
    for number in (7, 8, 11, 12):
        one.take(number)
    assert one.missing == 2
    one.take(1)  # started anew
    one.take(2)
    assert one.missing == 2
    one.publishers_are(2)
    for number in (500, 3, 501):
        one.take(number)
    one.publishers_are(1)
    one.take(900)
    one.take(901)
    assert one.missing == 2
