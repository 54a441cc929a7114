"""Reads the messages of a bag: any rosbag2 folder, or a single storage file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from hydraulic_interfaces.contract import NAMESPACE, find_topic, topic
from hydraulic_interfaces.errors import one_line
from hydraulic_sysid.data.bag.metadata import FILE_NAME
from hydraulic_sysid.data.errors import BagError


@dataclass
class Stream:
    """The messages of one topic in the order in which they were logged."""

    type: str
    payloads: list[bytes] = field(default_factory=list)


@dataclass(frozen=True)
class Bag:
    """Messages of one actuator by full topic name, all topics there are with their types, the texts kept with the bag.

    `namespace` is that of the actuator, `others` those of further ones in the bag.
    """

    path: Path
    streams: dict[str, Stream]
    types: dict[str, str]
    custom: dict[str, str]
    namespace: str = NAMESPACE
    others: tuple[str, ...] = ()

    def topic(self, name: str) -> str:
        """Full name of a topic of the contract in the actuator's namespace."""
        return topic(name, self.namespace)

    def stream(self, name: str) -> Stream | None:
        """Messages of a topic of the contract; None where the bag has none."""
        stream = self.streams.get(self.topic(name))
        return stream if stream is not None and stream.payloads else None


def read(path: Path, names: Iterable[str]) -> Bag:
    """The messages of those topics of the contract (``names``) that the bag holds.

    They are those of the actuator in the namespace of the contract, or of the only one.

    :raises BagError: not closed, cut off or damaged (what can be done is said), inconsistent, or of several actuators.
    """
    from rosbags.rosbag2 import Reader

    if path.is_dir() and not (path / FILE_NAME).is_file():
        hint = f"make it whole with: python -m hydraulic_sysid recover {path}"
        if any(path.glob("*.db3")):
            hint = f"name its .db3 file, or make it whole with: ros2 bag reindex -s sqlite3 {path}"
        raise BagError(path, f"the bag was not closed (no {FILE_NAME}); {hint}")
    try:
        with Reader(path) as reader:
            types = {connection.topic: connection.msgtype for connection in reader.connections}
            namespace, *others = _actuators(path, types)
            wanted = {topic(name, namespace) for name in names}
            chosen = [connection for connection in reader.connections if connection.topic in wanted]
            streams = {connection.topic: Stream(connection.msgtype) for connection in chosen}
            expected = sum(connection.msgcount for connection in chosen)
            if chosen:
                for connection, _, payload in reader.messages(chosen):
                    streams[connection.topic].payloads.append(payload)
            custom = getattr(reader.storage.metadata, "custom", None) or {}
    except BagError:
        raise
    except Exception as error:  # of a damaged file the library lets through struct, zstd and other errors
        hint = f"python -m hydraulic_sysid recover {path}"
        text = f"the bag is cut off or damaged ({one_line(error)}); save what is there with: {hint}"
        raise BagError(path, text) from None
    found = sum(len(stream.payloads) for stream in streams.values())
    if found != expected:
        raise BagError(path, f"{found} messages", expected=f"{expected}, as {FILE_NAME} says")
    texts = {str(key): str(value) for key, value in custom.items()}
    return Bag(path, streams, types, texts, namespace, tuple(others))


def _actuators(path: Path, types: dict[str, str]) -> list[str]:
    """Namespaces that have a state of the contract's type, the one to be read first."""
    state = find_topic("state")
    found = sorted(
        name.removesuffix(f"/{state.name}")
        for name, kind in types.items()
        if name.endswith(f"/{state.name}") and kind == state.type
    )
    if NAMESPACE in found or not found:
        return [NAMESPACE, *(name for name in found if name != NAMESPACE)]
    if len(found) > 1:
        raise BagError(path, f"holds the states of several actuators: {', '.join(found)}", expected="a bag of each")
    return found
