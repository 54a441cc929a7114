"""metadata.yaml of a rosbag2 folder, version 9 as ROS 2 Jazzy writes it.

Source: rosbag2 (branch jazzy), rosbag2_storage/include/rosbag2_storage/yaml.hpp.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from hydraulic_node_utils.whole_file import write_text
from hydraulic_node_utils.yaml_text import load_yaml
from hydraulic_sysid.data.bag.types import MessageType

FILE_NAME = "metadata.yaml"
VERSION = 9
ROS_DISTRO = "jazzy"
# RMW_DURATION_INFINITE, 2^63 − 1 ns: no deadline, no lifespan.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: full name, type, and the QoS that its publisher offers."""

    name: str
    type: MessageType
    qos: tuple[Mapping[str, Any], ...] = ()


def offered_qos(depth: int, latched: bool) -> dict[str, Any]:
    """QoS profile of a reliable publisher that keeps the last `depth`, in the words of rosbag2."""
    return {
        "history": "keep_last",
        "depth": depth,
        "reliability": "reliable",
        "durability": "transient_local" if latched else "volatile",
        "deadline": dict(_INFINITE),
        "lifespan": dict(_INFINITE),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_INFINITE),
        "avoid_ros_namespace_conventions": False,
    }


def information(
    file: str, topics: Sequence[tuple[BagTopic, int]], start_ns: int, duration_ns: int, custom_data: Mapping[str, str]
) -> dict[str, Any]:
    """Content of metadata.yaml below its root key, for a bag of one file and `topics` with message counts."""
    span = {
        "duration": {"nanoseconds": duration_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": sum(number for _, number in topics),
    }
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **span,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type.name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [dict(profile) for profile in topic.qos],
                    "type_description_hash": topic.type.hash,
                },
                "message_count": number,
            }
            for topic, number in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **span}],
        "custom_data": dict(custom_data),
        "ros_distro": ROS_DISTRO,
    }


def to_yaml(content: Any) -> str:
    """YAML text, block style, without line folding."""
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.width = 2**31
    yaml.representer.ignore_aliases = lambda data: True
    text = StringIO()
    yaml.dump(content, text)
    return text.getvalue()


def from_yaml(text: str) -> Any:
    """Content of a YAML text."""
    return load_yaml(YAML(typ="safe", pure=True), text)


def write(folder: Path, content: Mapping[str, Any]) -> None:
    """Write metadata.yaml into `folder`: it is there whole or not at all."""
    write_text(folder / FILE_NAME, to_yaml({"rosbag2_bagfile_information": dict(content)}))
    sync_folder(folder)


def sync_folder(folder: Path) -> None:
    """Bring the entries of a folder (names, not contents) to the disk."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
