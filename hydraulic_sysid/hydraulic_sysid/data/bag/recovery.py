"""Making a bag whole again that was not closed: its recorder was killed, the power failed, the disk was full.

Everything up to the last complete chunk is kept; a chunk whose checksum is wrong is left out.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

from hydraulic_interfaces.contract import find_topic
from hydraulic_sysid.data.bag import metadata
from hydraulic_sysid.data.bag.continuity import Gaps
from hydraulic_sysid.data.bag.experiment import ExperimentLog
from hydraulic_sysid.data.bag.metadata import BagTopic
from hydraulic_sysid.data.bag.types import MessageType
from hydraulic_sysid.data.bag.writer import RECORDING_METADATA, BagSummary, BagWriter
from hydraulic_sysid.data.errors import BagError

_FRAME = struct.Struct("<BQ")  # opcode and length in front of every MCAP record
_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.CHUNK: Chunk.read,
}
_DRAFT = ".recovering"


@dataclass
class Recovery:
    """What was saved, and what could not be.

    `lost_bytes` at the end of the file belong to a record that was cut off; `damaged` counts records (mostly
    chunks) that are there but cannot be read, `orphans` messages of which the topic is not known.
    `missing` counts, by topic, what its publisher sent between the first and the last message that is there; topics
    with several publishers are not in it. `whole` says that the bag was in order and has been left as it was.
    """

    summary: BagSummary
    types: dict[str, str] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)
    lost_bytes: int = 0
    damaged: int = 0
    orphans: int = 0
    whole: bool = False


def recover(bag: Path, out: Path | None = None) -> Recovery:
    """Make a regular bag of `bag`, a folder with one MCAP file: in its place, or in the new folder `out`.

    The result replaces the file, or appears in `out`, only when it is complete and has been read back.

    :raises BagError: no bag, several files, still being recorded, no message to be saved, or `out` exists.
    """
    file = _file_of(bag)
    if out is not None and out.exists():
        raise BagError(out, "exists; nothing is overwritten", expected="a folder that is new")
    with _locked(file) as stream:
        if out is None and (whole := _whole(bag, file)) is not None:
            return whole
        target = bag if out is None else out
        draft = bag / _DRAFT if out is None else out.with_name(f".{out.name}{_DRAFT}")
        shutil.rmtree(draft, ignore_errors=True)
        try:
            result = _rewrite(stream, draft, file.name if out is None else f"{target.name}_0.mcap")
            if not result.summary.messages:
                raise BagError(file, "holds no complete message; there is nothing to save")
            _verify(draft, result.summary)
            if out is None:
                os.replace(draft / file.name, file)
                os.replace(draft / metadata.FILE_NAME, bag / metadata.FILE_NAME)
                metadata.sync_folder(bag)
            else:
                os.rename(draft, out)
                metadata.sync_folder(out.absolute().parent)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    result.summary = BagSummary(target, *list(vars(result.summary).values())[1:])
    return result


def _file_of(bag: Path) -> Path:
    if not bag.is_dir():
        raise BagError(bag, "is no folder" if bag.exists() else "does not exist", expected="a bag's folder")
    files = sorted(bag.glob("*.mcap"))
    if len(files) != 1:
        raise BagError(bag, f"holds {len(files)} .mcap files", expected="one")
    return files[0]


@contextmanager
def _locked(file: Path) -> Iterator[BinaryIO]:
    with file.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BagError(file, "is in use: still being recorded, or being recovered") from None
        yield stream


def _whole(bag: Path, file: Path) -> Recovery | None:
    """The bag as it stands, if its index and metadata.yaml are there and agree."""
    try:
        text = (bag / metadata.FILE_NAME).read_text(encoding="utf-8")
        content = metadata.from_yaml(text)["rosbag2_bagfile_information"]
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        if summary is None or summary.statistics is None:
            return None
        if summary.statistics.message_count != content["message_count"]:
            return None
        rows = content["topics_with_message_count"]
        return Recovery(
            BagSummary(
                bag,
                {row["topic_metadata"]["name"]: row["message_count"] for row in rows},
                content["starting_time"]["nanoseconds_since_epoch"],
                content["duration"]["nanoseconds"],
                file.stat().st_size,
            ),
            {row["topic_metadata"]["name"]: row["topic_metadata"]["type"] for row in rows},
            whole=True,
        )
    except Exception:  # whatever is wrong with it, it is not whole
        return None


def _verify(folder: Path, summary: BagSummary) -> None:
    with _file_of(folder).open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).get_summary()
    count = found.statistics.message_count if found and found.statistics else 0
    if count != sum(summary.messages.values()):
        total = sum(summary.messages.values())
        raise BagError(folder, f"{count} of {total} messages read back; the original is untouched")


def _rewrite(stream: BinaryIO, folder: Path, file_name: str) -> Recovery:
    """Copy all that can be read into a new bag."""
    result = Recovery(BagSummary(folder))
    schemas: dict[int, Schema] = {}
    topics: dict[int, BagTopic] = {}
    custom: dict[str, str] = {}
    gaps: dict[str, Gaps] = {}
    experiment = ExperimentLog()
    events = find_topic("experiment")
    writer = BagWriter(folder, file_name=file_name)
    try:
        for record in _records(stream, result):
            if isinstance(record, Message):
                known = topics.get(record.channel_id)
                if known is None:
                    result.orphans += 1
                    continue
                if known.name.endswith(f"/{events.name}") and known.type.name == events.type:
                    experiment.take(record.data)
                gaps.setdefault(known.name, Gaps()).take(record.sequence)
                writer.write(known, record.log_time, record.publish_time, record.data, record.sequence)
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel) and record.schema_id in schemas:
                topics[record.id] = _topic(record, schemas[record.schema_id])
                result.types[record.topic] = topics[record.id].type.name
            elif isinstance(record, Metadata) and record.name == RECORDING_METADATA:
                custom.update(record.metadata)
        result.missing = {name: gap.missing for name, gap in gaps.items() if gap.missing is not None}
        result.summary = writer.close({**custom, **experiment.custom_data()})
    except BaseException:
        writer.abandon()
        raise
    return result


def _topic(channel: Channel, schema: Schema) -> BagTopic:
    kind = MessageType(
        schema.name,
        schema.data.decode(errors="replace"),
        channel.metadata.get("topic_type_hash", ""),
        encoding=schema.encoding,
    )
    profiles = metadata.from_yaml(channel.metadata.get("offered_qos_profiles", "")) or []
    return BagTopic(channel.topic, kind, tuple(profiles))


def _records(stream: BinaryIO, result: Recovery) -> Iterator[McapRecord]:
    """Records that are complete and in order, those in chunks as well; the rest is counted in `result`."""
    size = os.fstat(stream.fileno()).st_size
    if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise BagError(stream.name, "does not begin as an MCAP file; there is nothing to save")
    while (at := stream.tell()) + _FRAME.size <= size:
        opcode, length = _FRAME.unpack(stream.read(_FRAME.size))
        if opcode == Opcode.DATA_END:
            return
        if opcode == 0 or at + _FRAME.size + length > size:  # 0: space that was given to the file, never written
            break
        body = stream.read(length)
        try:
            yield from _parse(opcode, body)
        except (McapError, ValueError, RuntimeError, struct.error, ZstdError):
            result.damaged += 1
    result.lost_bytes = size - at


def _parse(opcode: int, body: bytes) -> list[McapRecord]:
    data = ReadDataStream(BytesIO(body))
    if opcode == Opcode.MESSAGE:
        return [Message.read(data, len(body))]
    if opcode not in _READERS:
        return []
    record = _READERS[opcode](data)
    return breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
