"""Writing records: as tables, and as a bag that holds what the nodes would have published."""

from __future__ import annotations

import gzip
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hydraulic_interfaces.contract import PISTON, PLANT_FRAME, SERVOVALVE, find_topic, topic
from hydraulic_node_utils.whole_file import write_text
from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.data.errors import BagError, FileError, RecordError
from hydraulic_sysid.data.records.channels import CHANNELS
from hydraulic_sysid.data.records.formats import format_of, suffix_of
from hydraulic_sysid.data.records.record import Record

_DEPTH = 100  # of the history that a player of the bag offers
_STATE = ("position", "velocity", "spool", "force", "drive")
_JOINTS, _PRESSURE = find_topic("state").type, find_topic("pressure_a").type
_JOINT_FIELDS = ("position", "velocity", "effort")
_PRESSURES = ("pressure_a", "pressure_b", "pressure_supply")


def save(record: Record, path: Path | str) -> Path:
    """Write a record as the table that the suffix names (`formats.SUFFIXES`); reading gives the same numbers back.

    :raises FileError: the file exists, or no such suffix.
    """
    path = Path(path)
    data = format_of(path).content(record)
    if suffix_of(path).endswith(".gz"):
        data = gzip.compress(data, mtime=0)
    try:
        write_text(path, data, overwrite=False)
    except FileExistsError:
        raise FileError(path, "exists already; a record is never written over another file") from None
    return path


def to_bag(record: Record, folder: Path | str, start_ns: int | None = None) -> Path:
    """Write a record as a bag with the topics that plant and controller would have published.

    Stamps begin at ``start_ns`` (default: that of the bag it came from, or one second after the epoch). Values
    that were not measured are NaN in `state`.

    :raises BagError: the folder exists.
    :raises RecordError: a channel has no topic.
    """
    from hydraulic_sysid.data.bag import BagTopic, BagWriter, message_type, offered_qos

    folder = Path(folder)
    homeless = [name for name in record.channels if name not in CHANNELS]
    if homeless:
        raise RecordError(f"{record.name}: no topic carries {', '.join(homeless)}; leave out what a bag cannot hold")
    if start_ns is None:
        start_ns = int(record.description.get("start_ns", 10**9))
    stamps = start_ns + np.rint(record.time * 1e9).astype(np.int64)
    streams = [
        (BagTopic(topic(name), message_type(find_topic(name).type), (offered_qos(_DEPTH, False),)), payloads)
        for name, payloads in _streams(record, stamps)
    ]
    if folder.exists():
        raise BagError(folder, "exists already; a record is never written over another")
    custom = {"record": record.name, "description": json.dumps(record.description)}
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.absolute().parent) as drafts:
        writer = BagWriter(Path(drafts, "bag"), custom, f"{folder.name}_0.mcap")
        # Sample by sample, in the order in which a recorder would have heard them.
        for index, stamp in enumerate(stamps.tolist()):
            for bag_topic, payloads in streams:
                writer.write(bag_topic, stamp, stamp, payloads[index], index + 1)
        writer.close()
        writer.folder.rename(folder)
    return folder


def _streams(record: Record, stamps: Index) -> Iterator[tuple[str, list[bytes]]]:
    """Serialised messages by short topic name, one per stamp."""
    from hydraulic_sysid.data.bag import cdr

    nan = np.full(len(record), np.nan)
    time = {"header.stamp.sec": stamps // 10**9, "header.stamp.nanosec": stamps % 10**9}

    def values(name: str) -> Array:
        return record.channels.get(name, nan)

    def joints(names: list[str], frame: str, **fields: Array) -> list[bytes]:
        zeros = {key: np.zeros(fields[key].shape[1] if key in fields else 0) for key in _JOINT_FIELDS}
        template = cdr.stamped(_JOINTS, frame, name=names, **zeros)
        return cdr.encode(_JOINTS, template, {**time, **fields})

    if "command" in record:
        yield "command", joints([SERVOVALVE], "record", effort=values("command")[:, None])
    if "reference" in record:
        yield "reference", joints([PISTON], PLANT_FRAME, position=values("reference")[:, None])
    if any(name in record for name in _STATE):
        columns = {
            "position": np.column_stack([values("position"), values("spool")]),
            "velocity": np.column_stack([values("velocity"), nan]),
            "effort": np.column_stack([values("force"), values("drive")]),
        }
        yield "state", joints([PISTON, SERVOVALVE], PLANT_FRAME, **columns)
    for name in _PRESSURES:
        if name in record:
            template = cdr.stamped(_PRESSURE, PLANT_FRAME, fluid_pressure=0.0, variance=0.0)
            yield name, cdr.encode(_PRESSURE, template, {**time, "fluid_pressure": values(name)})
