"""Tables that come from outside, before it is known which column is which channel."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from hydraulic_interfaces.errors import HydraulicError, one_line
from hydraulic_sysid.data.display import TITLES
from hydraulic_sysid.data.errors import ColumnMapError
from hydraulic_sysid.data.records import Record, read_records
from hydraulic_sysid.data.records.channels import CHANNELS, TIME, TIME_UNIT
from hydraulic_sysid.data.records.column_map import ColumnMap, column_of_header, parse_column_map
from hydraulic_sysid.data.records.formats import format_of
from hydraulic_sysid.data.results import plain
from hydraulic_workbench.reading.records import curve, labels

ROWS, POINTS = 8, 600
IRREGULAR = {"strict": "error", "resample": "resample", "split": "split"}
UNITS: Mapping[str, tuple[str, ...]] = {
    "m": ("m", "mm", "cm", "um", "in"),
    "m/s": ("m/s", "mm/s", "cm/s", "in/s"),
    "Pa": ("bar", "Pa", "kPa", "MPa", "psi"),
    "V": ("V", "mV"),
    "N": ("N", "kN", "lbf"),
    TIME_UNIT: ("s", "ms", "us", "min"),
}
"""Units that the page offers for an SI unit; a map may have any other that converts to it."""
_USUAL: Mapping[str, str] = {
    TIME: r"t|time|zeit|timestamp|seconds?",
    "drive": r"u|drive|valve|voltage|output",
    "command": r"command|cmd|setpoint_v|u_?cmd",
    "position": r"x|y|s|pos|position|stroke|displacement|lvdt",
    "velocity": r"v|vel|velocity|speed|xdot|dx",
    "spool": r"spool|xv|x_?v|spool_?pos(ition)?",
    "force": r"f|force|load",
    "pressure_a": r"p_?a|p_?1|pressure_?(a|1)",
    "pressure_b": r"p_?b|p_?2|pressure_?(b|2)",
    "pressure_supply": r"p_?s|p_?p|supply|pressure_?(s|supply|p)",
    "reference": r"r|ref|reference|target|setpoint",
}
"""What columns are often called."""


def preview(file: Path, document: Any) -> dict[str, Any]:
    """Header, first rows, a guess of the map; with a map, also what becomes of it: record, curves, or the problem."""
    found: dict[str, Any] = {"kind": "table", "record": None, "traces": None, "problem": "", "yaml": "", **choices()}
    table = format_of(file).table(file, None)
    names: list[str | int] = list(table.names) or list(range(1, getattr(table, "width", 0) + 1))
    guess = guessed(names)
    found |= {"header": [str(name) for name in names], "rows": _rows(table, names), "guess": guess}
    found["needs_map"] = document is None and not _names_itself(table)
    if document is None and found["needs_map"]:
        return found
    try:
        columns = None if document is None else column_map(document)
        record = read_records(file, columns)[0]
    except HydraulicError as error:
        return found | {"problem": one_line(error)}
    if document is not None:
        found["yaml"] = map_text(document)
    return found | {"record": _described(record), "traces": _curves(record)}


def preview_bag(folder: Path) -> dict[str, Any]:
    """What a bag holds, or why it cannot be read."""
    found: dict[str, Any] = {"kind": "bag", "needs_map": False, "header": [], "rows": [], "guess": None, "yaml": "",
                             "record": None, "traces": None, "problem": "", **choices()}  # fmt: skip
    try:
        record = read_records(folder)[0]
    except HydraulicError as error:
        return found | {"problem": one_line(error)}
    return found | {"record": _described(record), "traces": _curves(record)}


def choices() -> dict[str, Any]:
    """Channels and units that a map may name."""
    rows = [
        {"name": name, "title": TITLES.get(name, name), "unit": channel.unit, "meaning": channel.meaning,
         "units": list(UNITS.get(channel.unit, (channel.unit,)))}
        for name, channel in CHANNELS.items()
    ]  # fmt: skip
    return {"channels": rows, "time_units": list(UNITS[TIME_UNIT])}


def column_map(document: Any) -> ColumnMap:
    """The map that a page has put together.

    :raises ColumnMapError: it means nothing.
    """
    return parse_column_map(_as_file(document))


def map_text(document: Any) -> str:
    """The map as the YAML file that will be kept."""
    stream = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.dump(_as_file(document), stream)
    return stream.getvalue()


def _as_file(document: Any) -> dict[str, Any]:
    if not isinstance(document, dict):
        raise ColumnMapError(f"column map: is {document!r}, must be a mapping")
    time = document.get("time")
    time = dict(time) if isinstance(time, dict) else {}
    asked = document.get("sampling", "strict")
    if asked not in IRREGULAR:
        raise ColumnMapError(f"column map: sampling is {asked!r}; allowed are {', '.join(IRREGULAR)}")
    if asked != "strict":
        time["irregular"] = IRREGULAR[asked]
    rest = {key: value for key, value in document.items() if key not in ("time", "sampling")}
    return {"time": time, **rest}


def guessed(names: Sequence[str | int]) -> dict[str, Any]:
    """A map from what the columns are called; units as their names say, else the first that the page offers."""
    channels: dict[str, Any] = {}
    time: dict[str, Any] = {}
    for name in names:
        found = _guess(str(name))
        if found is None:
            continue
        quantity, unit = found
        if quantity == TIME:
            time = time or {"column": name, "unit": unit}
        else:
            channels.setdefault(quantity, {"column": name, "unit": unit})
    return {"time": time or {"dt": 0.001}, "channels": channels, "sampling": "strict"}


def _guess(header: str) -> tuple[str, str] | None:
    try:
        quantity, column = column_of_header(header)
        return quantity, column.unit
    except ColumnMapError:
        pass
    text, _, unit = re.sub(r"[\[\]()]", "|", header.strip().lower()).partition("|")
    text, unit = text.strip(" _"), unit.strip(" |_")
    for quantity, usual in _USUAL.items():
        offered = UNITS[TIME_UNIT if quantity == TIME else CHANNELS[quantity].unit]
        ending = "|".join(re.escape(one.lower()) for one in offered)
        match = re.fullmatch(rf"(?:{usual})(?:_({ending}))?", text)
        if match:
            told = unit or match.groups()[-1] or ""
            return quantity, next((one for one in offered if one.lower() == told), offered[0])
    return None


def _names_itself(table: Any) -> bool:
    try:
        table.own_map()
    except HydraulicError:
        return False
    return True


def _rows(table: Any, names: Sequence[str | int]) -> list[list[Any]]:
    columns = []
    for name in names:
        try:
            columns.append(plain(table.numbers(name)[:ROWS]))
        except HydraulicError:
            columns.append([None] * ROWS)
    return [list(row) for row in zip(*columns, strict=False)]


def _described(record: Record) -> dict[str, Any]:
    return {"duration": record.duration, "sampling_time": record.dt, "samples": len(record),
            "channels": list(record.channels), "notes": record.notes}  # fmt: skip


def _curves(record: Record) -> dict[str, Any]:
    whole = slice(0, len(record))
    return {name: curve(record, name, whole, POINTS) | labels(name, record.unit(name)) for name in record.channels}
