"""Reads the messages of a bag: any rosbag2 folder, or a single storage file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from hydraulic_sysid.data.bag.metadata import FILE_NAME
from hydraulic_sysid.data.errors import BagError


@dataclass
class Stream:
    """The messages of one topic in the order in which they were logged."""

    type: str
    payloads: list[bytes] = field(default_factory=list)


@dataclass(frozen=True)
class Bag:
    """Messages by full topic name, all topics there are with their types, and the texts kept with the bag."""

    path: Path
    streams: dict[str, Stream]
    types: dict[str, str]
    custom: dict[str, str]


def read(path: Path, topics: Iterable[str]) -> Bag:
    """The messages of those of ``topics`` (full names) that the bag holds.

    :raises BagError: not closed, cut off or damaged (what can be done is said), or inconsistent.
    """
    from rosbags.rosbag2 import Reader

    if path.is_dir() and not (path / FILE_NAME).is_file():
        hint = f"make it whole with: python -m hydraulic_sysid recover {path}"
        raise BagError(path, f"the bag was not closed (no {FILE_NAME}); {hint}")
    wanted = set(topics)
    try:
        with Reader(path) as reader:
            chosen = [connection for connection in reader.connections if connection.topic in wanted]
            types = {connection.topic: connection.msgtype for connection in reader.connections}
            streams = {connection.topic: Stream(connection.msgtype) for connection in chosen}
            expected = sum(connection.msgcount for connection in chosen)
            if chosen:
                for connection, _, payload in reader.messages(chosen):
                    streams[connection.topic].payloads.append(payload)
            custom = getattr(reader.storage.metadata, "custom", None) or {}
    except Exception as error:  # of a damaged file the library lets through struct, zstd and other errors
        text = " ".join(str(error).split())
        hint = f"python -m hydraulic_sysid recover {path}"
        raise BagError(path, f"the bag is cut off or damaged ({text}); save what is there with: {hint}") from None
    found = sum(len(stream.payloads) for stream in streams.values())
    if found != expected:
        raise BagError(path, f"{found} messages", expected=f"{expected}, as {FILE_NAME} says")
    return Bag(path, streams, types, {str(key): str(value) for key, value in custom.items()})
