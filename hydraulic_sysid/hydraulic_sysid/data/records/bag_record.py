"""From a bag to records: streams joined by their stamps, one record per experiment."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.contract import PISTON, SERVOVALVE
from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.data.bag import cdr, reader
from hydraulic_sysid.data.bag.reader import Bag
from hydraulic_sysid.data.bag.types import json_data
from hydraulic_sysid.data.errors import BagError, TimeError
from hydraulic_sysid.data.records.experiments import Span, spans
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.table import Samples, drive_from_command, evenly_sampled

PRESSURES = ("pressure_a", "pressure_b", "pressure_supply")
HELD = {"command": (SERVOVALVE, "effort"), "reference": (PISTON, "position")}
"""Topics that are not sampled with the state: joint and field that become the channel of that name."""

_TOLD_ELSEWHERE = ("experiment", "experiment_end")
"""Texts kept with the bag that only repeat what its messages say."""


def read_bag(path: Path, irregular: str = "error") -> list[Record]:
    """Records in a bag: one for every experiment that was started in it, or one of everything.

    State and pressures of the same stamp make a sample. `command` and `reference` give their latest value
    before it, or of the same stamp. A channel whose values are all NaN was not measured, and is absent. What the plant
    says of itself becomes ``description["plant"]``: how the amplifier of a real bench is set, for one.

    :raises BagError: unreadable, no `state`, a message is no contract message, or values are missing in
        some samples only.
    :raises TimeError: a stamp repeats or goes back, or samples are missing (``irregular`` = "error").
    """
    names = ("state", *PRESSURES, *HELD, "experiment", "description")
    bag = reader.read(path, names)
    notes = [f"{bag.namespace} is read, of several actuators; {name} is not" for name in bag.others]
    stamps, channels = _sampled(bag, notes)
    early = {name: _hold(bag, name, stamps, channels) for name in HELD}
    channels = _measured(path, stamps, channels)
    ordered = {name: channels[name] for name in ("command", "drive", *channels) if name in channels}
    drive_from_command(ordered, notes)
    plant = _plant(bag)
    if imitated := plant.get("imitated_effects"):
        notes.append(f"plant: its devices are set so that they imitate {', '.join(map(str, imitated))}")
    records = []
    for span in spans(bag, stamps):
        lacking = [_note(name, count - span.first) for name, count in early.items() if count > span.first]
        records += _records(bag, irregular, span, stamps, ordered, [*notes, *lacking], plant)
    return records


def _records(
    bag: Bag,
    irregular: str,
    span: Span,
    stamps: Index,
    channels: Mapping[str, Array],
    notes: list[str],
    plant: dict[str, Any],
) -> list[Record]:
    chosen = slice(span.first, span.last)
    start = int(stamps[span.first])
    samples = Samples(
        bag.path,
        (stamps[chosen] - start).astype(np.float64) * 1e-9,
        {name: values[chosen] for name, values in channels.items()},
        lambda index: index + 1,
        f"stamp of {bag.topic('state')}",
    )
    description: dict[str, Any] = {"start_ns": start}
    if span.experiment:
        description["experiment"] = span.experiment
    if plant:
        description["plant"] = plant
    if bag.custom:
        description["bag"] = {key: _plain(value) for key, value in bag.custom.items() if key not in _TOLD_ELSEWHERE}
    name = bag.path.name if bag.path.is_dir() else bag.path.stem
    title = f"{name}.{span.name}" if span.name else name
    return evenly_sampled(samples, irregular, title, [*notes, *span.notes], description)


def _plant(bag: Bag) -> dict[str, Any]:
    """What the plant has said of itself, last; empty where it has said nothing."""
    stream = bag.stream("description")
    return next(filter(None, map(json_data, reversed(stream.payloads if stream else ()))), {})


def _sampled(bag: Bag, notes: list[str]) -> tuple[Index, dict[str, Array]]:
    """Index that state and all recorded pressures have, and their channels."""
    if bag.stream("state") is None:
        there = ", ".join(sorted(bag.types)) or "no topics"
        raise BagError(bag.path, f"no messages of {bag.topic('state')}; there is {there}")
    messages = _decoded(bag, "state")
    stamps = _increasing(bag, "state", messages)
    piston, valve = (_joint(bag, "state", messages, name) for name in (PISTON, SERVOVALVE))
    columns: dict[str, tuple[Index, Array]] = {
        "drive": (stamps, _values(bag, "state", messages, "effort", valve)),
        "position": (stamps, _values(bag, "state", messages, "position", piston)),
        "velocity": (stamps, _values(bag, "state", messages, "velocity", piston)),
        "spool": (stamps, _values(bag, "state", messages, "position", valve)),
        "force": (stamps, _values(bag, "state", messages, "effort", piston)),
    }
    common = stamps
    for name in PRESSURES:
        if bag.stream(name) is None:
            continue
        pressure = _decoded(bag, name)
        own = _increasing(bag, name, pressure)
        columns[name] = (own, pressure.numbers["fluid_pressure"].astype(np.float64))
        common = np.intersect1d(common, own, assume_unique=True)
    if common.size < 2:
        recorded = ", ".join(name for name in ("state", *PRESSURES) if bag.topic(name) in bag.streams)
        raise BagError(bag.path, f"{common.size} stamps are in all of {recorded}", expected="two or more")
    for name, (own, _) in columns.items():
        extra = own.size - common.size
        if extra and name in ("position", *PRESSURES):
            stream_name = "state" if name == "position" else name
            notes.append(f"{stream_name}: {extra} of {own.size} samples have no partner in another topic")
    return common, {name: values[np.searchsorted(own, common)] for name, (own, values) in columns.items()}


def _hold(bag: Bag, name: str, stamps: Index, channels: dict[str, Array]) -> int:
    """Latest value at or before every stamp of a topic with stamps of its own; how many stamps have none."""
    if bag.stream(name) is None:
        return 0
    messages = _decoded(bag, name)
    joint, path = HELD[name]
    values = _values(bag, name, messages, path, _joint(bag, name, messages, joint))
    # Several sources may interleave; what was sent later wins, also with an equal stamp.
    order = np.argsort(messages.stamps, kind="stable")
    own, values = messages.stamps[order], values[order]
    index = np.searchsorted(own, stamps, side="right") - 1
    early = int((index < 0).sum())
    if early == stamps.size:
        return 0
    channels[name] = values[np.maximum(index, 0)]
    if name == "command":
        channels[name][:early] = 0.0
    return early


def _note(name: str, early: int) -> str:
    what = "0 V there, as the plant applies" if name == "command" else "its first value there"
    return f"{name}: none before the first {early} samples; {what}"


def _measured(path: Path, stamps: Index, channels: Mapping[str, Array]) -> dict[str, Array]:
    measured = {}
    for name, values in channels.items():
        bad = ~np.isfinite(values)
        if not bad.any():
            measured[name] = values
        elif not np.isnan(values).all():
            index = int(np.flatnonzero(bad)[0])
            problem = f"{name} is {values[index]} at stamp {stamps[index]} ns and {int(bad.sum())} samples in all"
            raise BagError(path, problem, row=index + 1, expected="numbers, or NaN in every sample")
    return measured


def _decoded(bag: Bag, name: str) -> cdr.Messages:
    stream = bag.streams[bag.topic(name)]
    try:
        return cdr.decode(stream.type, stream.payloads)
    except cdr.CdrError as error:
        raise BagError(bag.path, f"{bag.topic(name)}: {error}") from None


def _increasing(bag: Bag, name: str, messages: cdr.Messages) -> Index:
    stamps = messages.stamps
    steps = np.diff(stamps)
    if (steps > 0).all():
        return stamps
    index = int(np.flatnonzero(steps <= 0)[0])
    what = "is there twice" if steps[index] == 0 else f"comes after {stamps[index]} ns"
    raise TimeError(
        bag.path,
        f"stamp {stamps[index + 1]} ns {what}",
        row=index + 2,
        column=bag.topic(name),
        expected="increasing stamps from one publisher",
    )


def _joint(bag: Bag, name: str, messages: cdr.Messages, joint: str) -> int:
    """Index of a joint in all messages of a topic."""
    names = set(messages.texts["name"])
    if len(names) != 1 or joint not in next(iter(names)):
        raise BagError(bag.path, f"{bag.topic(name)}: joints are {sorted(names)}", expected=f"{joint!r} in all")
    return next(iter(names)).index(joint)


def _values(bag: Bag, name: str, messages: cdr.Messages, path: str, joint: int) -> Array:
    values = messages.numbers[path]
    if values.shape[1] <= joint:
        raise BagError(bag.path, f"{bag.topic(name)}: {path} has {values.shape[1]} values", expected=f"{joint + 1}")
    return values[:, joint].astype(np.float64)


def _plain(text: str) -> Any:
    """JSON where a text is some, else the text."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text
