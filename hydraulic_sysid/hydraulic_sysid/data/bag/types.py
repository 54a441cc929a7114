"""What a bag must know of a message type: definition, hash, and where its stamp is.

The definitions are those of ROS 2 Jazzy as they ship with `rosbags`, so a bag can be written and recovered on a
machine without ROS, and does not depend on where message packages are installed.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_typestore

_SECOND = 1_000_000_000
# CDR: 4 bytes of encapsulation header, the second of which says the byte order; then the first field.
_PAYLOAD_AT = 4
_LITTLE = (struct.Struct(">iI"), struct.Struct("<iI"))


@dataclass(frozen=True)
class MessageType:
    """A message type: name ("sensor_msgs/msg/JointState"), definition with all it depends on, RIHS01 hash.

    `stamped` messages begin with a std_msgs/Header.
    """

    name: str
    definition: str
    hash: str
    stamped: bool = False
    encoding: str = "ros2msg"


@cache
def typestore() -> Any:
    """The types of ROS 2 Jazzy that ship with `rosbags`."""
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def message_type(name: str) -> MessageType:
    """Description of a type of ROS 2 Jazzy's common interfaces.

    :raises KeyError: there is no such type.
    """
    store = typestore()
    if name not in store.fielddefs:
        raise KeyError(f"message type {name!r} is not one of ROS 2 Jazzy's common interfaces")
    definition, _ = store.generate_msgdef(name, ros_version=2)
    fields = store.get_msgdef(name).fields
    stamped = bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"
    return MessageType(name, definition, store.hash_rihs01(name), stamped)


def header_stamp(data: bytes) -> int:
    """Stamp [ns since the epoch] of a serialised message of a stamped type."""
    seconds, nanoseconds = _LITTLE[data[1] & 1].unpack_from(data, _PAYLOAD_AT)
    return int(seconds) * _SECOND + int(nanoseconds)


def string_data(data: bytes) -> str:
    """Text of a serialised std_msgs/String; what is not UTF-8 in it is replaced."""
    message = typestore().deserialize_cdr(data, "std_msgs/msg/String")
    return str(message.data)


def json_data(data: bytes) -> dict[str, Any]:
    """The JSON object in a serialised std_msgs/String; empty where it holds none: anybody may publish anything."""
    try:
        content = json.loads(string_data(data))
    except Exception:  # whatever a stranger publishes must end neither a recording nor its reading
        return {}
    return content if isinstance(content, dict) else {}
