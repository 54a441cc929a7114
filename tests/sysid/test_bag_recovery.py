"""Recovery of bags that were not closed, as a function and as a verb."""

import fcntl
import json
import os
import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from hydraulic_interfaces.contract import topic
from hydraulic_sysid.data.bag import BagTopic, BagWriter, message_type, offered_qos, recover
from hydraulic_sysid.data.bag.types import typestore
from hydraulic_sysid.data.errors import BagError
from hydraulic_sysid.verbs import recover as verb

START = 1_700_000_000 * 10**9
TEXT = BagTopic("/test/text", message_type("std_msgs/msg/String"), (offered_qos(10, False),))
EXPERIMENT = BagTopic(topic("experiment", "/left"), message_type("std_msgs/msg/String"), (offered_qos(1, True),))
FILE = "killed_0.mcap"


def text(value: str) -> bytes:
    message = typestore().types["std_msgs/msg/String"](value)
    return bytes(typestore().serialize_cdr(message, "std_msgs/msg/String"))


def killed(folder: Path, chunks: int = 5, per_chunk: int = 8) -> Path:
    """A bag whose recorder was killed after `chunks` flushes; message k says "k"."""
    writer = BagWriter(folder, {"description": "kept"})
    writer.write(EXPERIMENT, START, START, text(json.dumps({"event": "started", "plan": {"a": 1}})))
    for k in range(chunks * per_chunk):
        writer.write(TEXT, START + k + 1, START + k, text(f"{k}" * 20), k)
        if k % per_chunk == per_chunk - 1:
            writer.flush()
    writer.abandon()
    return folder


def contents(folder: Path) -> list[tuple[int, int, int, bytes]]:
    with next(folder.glob("*.mcap")).open("rb") as stream:
        rows = [
            (m.log_time, m.publish_time, m.sequence, m.data)
            for _, c, m in make_reader(stream, validate_crcs=True).iter_messages()
            if c.topic == TEXT.name
        ]
    return rows


EXPECTED = [(START + k + 1, START + k, k, text(f"{k}" * 20)) for k in range(40)]


def chunk_offsets(data: bytes) -> list[int]:
    at, found = 8, []
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == Opcode.CHUNK:
            found.append(at)
        at += 9 + length
    return found


def test_in_its_place(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    result = recover(bag)
    assert result.summary.folder == bag
    assert result.summary.messages == {TEXT.name: 40, EXPERIMENT.name: 1}
    assert (result.lost_bytes, result.damaged, result.orphans, result.whole) == (0, 0, 0, False)
    assert contents(bag) == EXPECTED
    assert sorted(path.name for path in bag.iterdir()) == [FILE, "metadata.yaml"]
    with Reader(bag) as reader:
        assert reader.message_count == 41
        custom = reader.storage.metadata.custom
        assert custom["description"] == "kept"
        assert json.loads(custom["experiment"])["plan"] == {"a": 1}
        qos = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
    assert qos == {TEXT.name: "VOLATILE", EXPERIMENT.name: "TRANSIENT_LOCAL"}


def test_again_changes_nothing(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    first = recover(bag)
    before = [(path.name, path.read_bytes()) for path in sorted(bag.iterdir())]
    second = recover(bag)
    assert second.whole and second.summary == first.summary and second.types == first.types
    assert [(path.name, path.read_bytes()) for path in sorted(bag.iterdir())] == before


def test_a_missing_metadata_file_is_made_again(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    recover(bag)
    (bag / "metadata.yaml").unlink()
    assert not recover(bag).whole
    assert contents(bag) == EXPECTED and (bag / "metadata.yaml").is_file()


def test_into_a_new_folder(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    before = (bag / FILE).read_bytes()
    result = recover(bag, tmp_path / "saved")
    assert result.summary.folder == tmp_path / "saved"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["killed", "saved"]
    assert [(path.name, path.read_bytes()) for path in bag.iterdir()] == [(FILE, before)]
    assert contents(tmp_path / "saved") == EXPECTED
    with pytest.raises(BagError, match="exists"):
        recover(bag, tmp_path / "saved")


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_cut_off_anywhere(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Whatever is left, all messages of complete chunks are saved, in order, and nothing else."""
    folder = tmp_path_factory.mktemp("cut")
    bag = killed(folder / "killed")
    whole = (bag / FILE).read_bytes()
    cut = data.draw(st.integers(0, len(whole)))
    zeros = data.draw(st.sampled_from([0, 1, 100]))
    (bag / FILE).write_bytes(whole[:cut] + bytes(zeros))
    ends = [at + 9 + struct.unpack_from("<BQ", whole, at)[1] for at in chunk_offsets(whole)]
    # Zeros behind the cut may happen to be what stood there.
    survivors = sum(end <= cut for end in ends) * 8
    try:
        result = recover(bag)
    except BagError:
        assert survivors == 0
        assert (bag / FILE).read_bytes() == whole[:cut] + bytes(zeros)
        return
    rows = contents(bag)
    assert len(rows) >= survivors and rows == EXPECTED[: len(rows)]
    assert result.summary.messages[TEXT.name] == len(rows)


def test_a_damaged_chunk_is_left_out(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    content = bytearray((bag / FILE).read_bytes())
    content[chunk_offsets(content)[2] + 70] ^= 0xFF
    (bag / FILE).write_bytes(content)
    result = recover(bag)
    assert result.damaged == 1
    assert contents(bag) == EXPECTED[:16] + EXPECTED[24:]
    assert result.missing[TEXT.name] == 8


def test_several_publishers_leave_it_open_what_is_missing(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "two")
    for k, number in enumerate([1, 2, 500, 3, 501]):
        writer.write(TEXT, START + k, START + k, text("x"), number)
    writer.flush()
    writer.abandon()
    result = recover(tmp_path / "two")
    assert result.summary.messages == {TEXT.name: 5} and result.missing == {}


def test_messages_whose_topic_is_lost_are_counted(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    writer = BagWriter(tmp_path / "late")
    writer.write(EXPERIMENT, START, START, text("{}"))
    writer.flush()
    for k in range(16):
        writer.write(TEXT, START + k, START + k, text("x"))
        if k == 7:
            writer.flush()
    writer.flush()
    writer.abandon()
    content = bytearray((tmp_path / "late" / "late_0.mcap").read_bytes())
    content[chunk_offsets(content)[1] + 70] ^= 0xFF  # the chunk that describes TEXT
    (bag / FILE).write_bytes(content)
    result = recover(bag)
    assert (result.damaged, result.orphans, result.summary.messages) == (1, 8, {EXPERIMENT.name: 1})


def test_while_it_is_being_recorded(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.write(TEXT, START, START, text("x"))
    writer.flush()
    with pytest.raises(BagError, match="in use"):
        recover(tmp_path / "bag")
    writer.close()
    assert recover(tmp_path / "bag").whole


def test_a_failure_leaves_everything_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = killed(tmp_path / "killed")
    before = (bag / FILE).read_bytes()

    def fail(self: BagWriter, *_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(BagWriter, "close", fail)
    for out in (None, tmp_path / "saved"):
        with pytest.raises(OSError, match="No space"):
            recover(bag, out)
        assert [path.name for path in tmp_path.iterdir()] == ["killed"]
        assert [(path.name, path.read_bytes()) for path in bag.iterdir()] == [(FILE, before)]
    monkeypatch.undo()
    with (bag / FILE).open("rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)  # released
    assert contents(recover(bag).summary.folder) == EXPECTED


def test_what_a_killed_recovery_left_does_not_matter(tmp_path: Path) -> None:
    bag = killed(tmp_path / "killed")
    (bag / ".recovering").mkdir()
    (bag / ".recovering" / FILE).write_bytes(b"half")
    recover(bag)
    assert sorted(os.listdir(bag)) == [FILE, "metadata.yaml"]


def test_what_is_no_bag(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="does not exist"):
        recover(tmp_path / "none")
    with pytest.raises(BagError, match=r"0 \.mcap files"):
        recover(tmp_path)
    (tmp_path / "a.mcap").write_text("not MCAP at all")
    with pytest.raises(BagError, match="does not begin as an MCAP file"):
        recover(tmp_path)
    (tmp_path / "b.mcap").touch()
    with pytest.raises(BagError, match=r"2 \.mcap files"):
        recover(tmp_path)
    with pytest.raises(BagError, match="is no folder"):
        recover(tmp_path / "a.mcap")


def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = killed(tmp_path / "killed")
    with (bag / FILE).open("ab") as stream:
        stream.write(b"\x06\xff\x00\x00")
    assert verb.main([str(bag), "--out", str(tmp_path / "saved"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["messages"] == {TEXT.name: 40, EXPERIMENT.name: 1} and told["lost_bytes"] == 4
    assert verb.main([str(bag)]) == 0
    out = capsys.readouterr().out
    assert "recovered: 41 messages" in out and "4 bytes" in out
    assert any(
        line.split() == [TEXT.name, "40", "saved", "0", "lost", "std_msgs/msg/String"] for line in out.splitlines()
    )
    assert verb.main([str(bag)]) == 0
    assert "nothing was changed" in capsys.readouterr().out
    assert verb.main([str(tmp_path / "none")]) == 2
    assert "does not exist" in capsys.readouterr().err
    assert verb.main([str(bag), "--out", str(tmp_path / "saved")]) == 2
    assert "exists" in capsys.readouterr().err
