"""Writing a bag: one MCAP file in a rosbag2 folder."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mcap.writer import Writer

from hydraulic_sysid.data.bag import metadata
from hydraulic_sysid.data.bag.metadata import BagTopic
from hydraulic_sysid.data.errors import BagError

SUFFIX = ".mcap"
PROFILE = "ros2"
LIBRARY = "hydraulic_sysid"
RECORDING_METADATA = "hydraulic_sysid"
"""Name of the MCAP metadata record that keeps the custom data from the first moment on."""

# The chunk is ended by `flush`; its size is only a limit for bursts.
_CHUNK_BYTES = 4 * 1024 * 1024
_SEQUENCE_MASK = 0xFFFFFFFF


@dataclass(frozen=True)
class BagSummary:
    """What a closed bag holds: messages per topic, span of their log times [ns], size of the file [bytes]."""

    folder: Path
    messages: dict[str, int] = field(default_factory=dict)
    start_ns: int = 0
    duration_ns: int = 0
    size: int = 0


class BagWriter:
    """Writes a new bag; a file that `close` has not finished can be read by `recovery.recover`.

    The file is locked as long as it is being written. A topic without a message leaves no trace.
    """

    def __init__(self, folder: Path, custom_data: Mapping[str, str] | None = None, file_name: str = "") -> None:
        """Make `folder` and open the file in it, by default <folder>_0.mcap as rosbag2 calls it.

        :raises BagError: the folder exists, or cannot be made.
        """
        self.folder = folder
        self._custom = dict(custom_data or {})
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise BagError(folder, "exists; nothing is overwritten", expected="a folder that is new") from None
        except OSError as error:
            raise BagError(folder, f"cannot be made: {error.strerror}") from error
        self.file = folder / (file_name or f"{folder.name}_0{SUFFIX}")
        self._stream = self.file.open("xb", buffering=0)
        fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._mcap = Writer(self._stream, chunk_size=_CHUNK_BYTES)
        self._mcap.start(profile=PROFILE, library=LIBRARY)
        if self._custom:
            self._mcap.add_metadata(RECORDING_METADATA, self._custom)
        self._mcap.flush()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._topics: dict[str, BagTopic] = {}
        self._counts: dict[str, int] = {}
        self._first = self._last = 0

    def write(self, topic: BagTopic, log_ns: int, publish_ns: int, data: bytes, sequence: int = 0) -> None:
        """Add a serialised message with the times [ns] at which it was received and published."""
        name = topic.name
        channel = self._channels.get(name)
        if channel is None:
            channel = self._register(topic)
        if not self._first:
            self._first = self._last = log_ns
        elif log_ns > self._last:
            self._last = log_ns
        elif log_ns < self._first:
            self._first = log_ns
        self._counts[name] += 1
        self._mcap.add_message(channel, log_ns, data, publish_ns, sequence & _SEQUENCE_MASK)

    def flush(self) -> None:
        """End the chunk and give everything written so far to the system: it outlives this process."""
        self._mcap.flush()

    def sync(self) -> None:
        """Bring what was flushed to the disk: it outlives a loss of power. May take as long as the disk likes."""
        os.fdatasync(self._stream.fileno())

    def close(self, custom_data: Mapping[str, str] | None = None) -> BagSummary:
        """Write the index and metadata.yaml; `custom_data` adds to what was given at the start."""
        self._custom.update(custom_data or {})
        content = metadata.information(
            self.file.name,
            [(topic, self._counts[name]) for name, topic in self._topics.items()],
            self._first,
            self._last - self._first,
            self._custom,
        )
        self._mcap.flush()
        # rosbag2 looks here when it is given the file without its folder.
        self._mcap.add_metadata("rosbag2", {"serialized_metadata": metadata.to_yaml(content)})
        self._mcap.finish()
        self.flush()
        self.sync()
        size = self.file.stat().st_size
        metadata.write(self.folder, content)
        self._stream.close()
        return BagSummary(self.folder, dict(self._counts), self._first, self._last - self._first, size)

    def abandon(self) -> None:
        """Let go of the file as it is."""
        self._stream.close()

    def _register(self, topic: BagTopic) -> int:
        kind = topic.type
        schema = self._schemas.get(kind.name)
        if schema is None:
            schema = self._mcap.register_schema(kind.name, kind.encoding, kind.definition.encode())
            self._schemas[kind.name] = schema
        channel = self._mcap.register_channel(
            topic.name,
            "cdr",
            schema,
            {
                "offered_qos_profiles": metadata.to_yaml([dict(profile) for profile in topic.qos]),
                "topic_type_hash": kind.hash,
            },
        )
        self._channels[topic.name], self._topics[topic.name], self._counts[topic.name] = channel, topic, 0
        return int(channel)
