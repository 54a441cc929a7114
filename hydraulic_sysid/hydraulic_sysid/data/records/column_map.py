"""Column maps: which column of a CSV or MAT file is which channel, in which unit and with which sign.

A map is a YAML file::

    time: {column: t, unit: s}           # or {dt: 0.02}; irregular: error | resample (to step: 0.005) | split
    channels:
      drive: {column: u, unit: V}        # by its name in the header (MAT: the variable) …
      position: {column: 3, unit: mm, scale: 20.0, offset: -100.0, sign: -1}    # … or its number, from 1
      pressure_b: null                   # absent, as a channel that is not named
      # held: false    resampled by straight lines, though a drive; true: kept until the next sample, though no drive
    extra:
      speed_signal: {column: 4, unit: V} # a channel of its own, for which no SI unit is known
    header: false                        # header, delimiter and decimal are found out where they are left out
    skip: 6                              # lines of a text file before its table
    ragged: true                         # rows may have more or fewer cells than the header (marks of a logger)
    notes: Where the numbers come from.

``records: {left: {…}, right: {…}}`` in place of ``channels`` makes several records of one file. A map with neither
these nor ``extra`` leaves it to the headers to name the channels, and says the rest. Where one column is another
channel in other files of a set, as of a transducer that was moved, ``files`` has it by the files' names::

    files:
      "*_pA_*": {pressure_a: {column: p, unit: MPa}}
      "*_pB_*": {pressure_b: {column: p, unit: MPa}}

Cells that are lists have their numbers as ``positions[2]``, the second. ``file`` takes a column from another file of
the same folder, read at the stamps of the first; such a record is called after the folder::

      position: {column: "positions[2]", unit: rad, file: state_motor.csv}

What a record states of the machine itself, a load that was put on or a gain that was set, is said under ``settings``,
by the key of the model's parameter: a number [SI], or a column. Where that changes, another record begins::

    settings:
      payload.mass: {column: mass, scale: 0.0225}
      position_loop.active: {column: torque_enable}

A rotary axis is described at a radius of 1 m: an angle (rad, deg) counts as the arc in m, its speed (rad/s) in m/s, a
torque (N*m) as the force in N. Where the actuator has a position controller of its own the drive is its command: an
angle counts as so many volts, and so does a position with ``command: position`` beside its unit (else mm is no drive)::

      drive: {column: goal, unit: mm, command: position}
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path, PurePath
from typing import Any

from hydraulic_interfaces.errors import one_line
from hydraulic_sysid.data.errors import ColumnMapError
from hydraulic_sysid.data.records.channels import CHANNELS, TIME, allowed, si_unit

IRREGULAR = ("error", "resample", "split")
_AT_ONE_METRE = {"m": ("rad",), "m/s": ("rad/s",), "N": ("N*m",), "V": ("rad",)}
"""What counts as a channel's unit too: a rotary axis at a radius of 1 m, and a position that is the command."""
_ANGLE = re.compile(r"rad|deg|rev|turn")


@dataclass(frozen=True)
class Column:
    """One column: SI value = to_SI(sign · scale · number + offset, ``unit``).

    ``column`` is the name in the header (the variable in a MAT file), or the number of the column, from 1.
    Of an extra channel the unit is kept: its factor is 1.
    """

    column: str | int
    unit: str
    factor: float
    """From ``unit`` to SI; with ``shift``, which is not 0 for units such as degrees."""
    shift: float = 0.0
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    file: str | None = None
    held: bool | None = None
    """Whether it keeps its value until the next sample, where that is not as of every such channel (`HELD`)."""

    def si(self, numbers: Any) -> Any:
        """Numbers of the file in SI."""
        return self.factor * (self.sign * self.scale * numbers + self.offset) + self.shift


@dataclass(frozen=True)
class ColumnMap:
    """How a table becomes records; each of ``parts`` becomes one, named after its key; none: the headers say.

    ``units`` are those of the channels that are not in `CHANNELS`. Either ``time`` is a column or ``dt`` is the
    period in seconds. ``irregular`` says what to do with stamps that are not even: refuse them, resample
    (interpolate on the even grid) or split into several records. ``header``: None looks for itself; ``delimiter``
    and ``decimal`` too. ``files``: what files of such a name have besides, by pattern; see `for_file`. Of a text file
    ``skip`` lines are left out, and rows of a ``ragged`` one differ in length.
    """

    parts: Mapping[str, Mapping[str, Column]]
    time: Column | None = None
    dt: float | None = None
    irregular: str = "error"
    units: Mapping[str, str] = field(default_factory=dict)
    header: bool | None = None
    delimiter: str | None = None
    decimal: str | None = None
    name: str = ""
    notes: Sequence[str] = field(default_factory=tuple)
    files: Mapping[str, Mapping[str, Column]] = field(default_factory=dict)
    settings: Mapping[str, float | Column] = field(default_factory=dict)
    step: float | None = None
    """Period [s] to resample to, where it is not the median of the stamps'."""
    skip: int = 0
    ragged: bool = False

    @property
    def several_files(self) -> bool:
        """Whether a record's columns stand in more than one file."""
        return any(column.file for part in self.parts.values() for column in part.values())

    def for_file(self, name: str) -> ColumnMap:
        """The map of a file of this name: with what ``files`` says of it.

        :raises ColumnMapError: not exactly one of the patterns matches.
        """
        if not self.files:
            return self
        found = [pattern for pattern in self.files if fnmatchcase(name, pattern)]
        if len(found) != 1:
            problem = f"matches {' and '.join(map(repr, found)) or 'none'} of the patterns"
            allowed_names = ", ".join(map(repr, self.files))
            raise ColumnMapError(f"{self.name}: files: {name!r} {problem} {allowed_names}; exactly one must")
        parts = {part: {**columns, **self.files[found[0]]} for part, columns in self.parts.items()}
        return replace(self, parts=parts, files={})


def shipped_maps() -> dict[str, Path]:
    """Column maps that come with the package, by name."""
    folder = Path(str(resources.files("hydraulic_sysid.data"))) / "columns"
    return {file.stem: file for file in sorted(folder.glob("*.yaml"))}


def load_column_map(source: str | Path) -> ColumnMap:
    """The map in a YAML file, or the shipped one of that name.

    :raises ColumnMapError: no such file or name, not YAML, or contents that mean nothing.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    from hydraulic_node_utils.yaml_text import load_yaml

    path = Path(source)
    if not path.is_file():
        shipped = shipped_maps()
        if str(source) not in shipped:
            names = ", ".join(shipped)
            raise ColumnMapError(f"{source}: no such column map; give a YAML file, or one of {names}")
        path = shipped[str(source)]
    try:
        document = load_yaml(YAML(typ="safe"), path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError) as error:
        raise ColumnMapError(f"{path}: not YAML: {one_line(error)}") from None
    return parse_column_map(document, str(path))


def parse_column_map(document: Any, where: str = "column map") -> ColumnMap:
    """The map in a document as YAML gives it; ``where`` names it in errors.

    :raises ColumnMapError: contents that mean nothing; the text names the key and what is allowed.
    """
    keys = ("time", "channels", "extra", "records", "files", "settings", "header", "delimiter", "decimal",
            "skip", "ragged", "notes")  # fmt: skip
    top = _mapping(document, where, keys)
    if "channels" in top and "records" in top:
        raise ColumnMapError(f"{where}: has both 'channels' and 'records' (several groups of channels); one is allowed")
    groups = {"": top.get("channels", {})}
    if "records" in top:
        groups = dict(_mapping(top["records"], f"{where}: records"))
        if not groups:
            raise ColumnMapError(f"{where}: records is empty")
    extra = _extra(top.get("extra", {}), f"{where}: extra")
    parts = {
        str(name): {**_channels(group, f"{where}: records.{name}" if name else f"{where}: channels"), **extra}
        for name, group in groups.items()
    }
    files = _files(top.get("files", {}), parts, f"{where}: files")
    if "channels" not in top and "records" not in top and not extra and not files:
        parts = {}
    for name, part in parts.items():
        if not part and not files:
            raise ColumnMapError(f"{where}: {f'records.{name}' if name else 'channels'} maps no channel")
    time = _mapping(top.get("time", {}), f"{where}: time", ("column", "unit", "scale", "dt", "irregular", "step"))
    if ("dt" in time) == ("column" in time) and (parts or "dt" in time):
        raise ColumnMapError(f"{where}: time needs either 'column' or 'dt' (the period in seconds)")
    irregular = _choice(time.get("irregular", "error"), f"{where}: time.irregular", IRREGULAR)
    step = None if "step" not in time else _number(time["step"], f"{where}: time.step")
    if step is not None and (irregular != "resample" or step <= 0.0):
        raise ColumnMapError(f"{where}: time.step is {step:g} s with irregular: {irregular}; it must be positive, and "
                             "goes with irregular: resample")  # fmt: skip
    dt, column = None, None
    if "dt" in time:
        dt = _number(time["dt"], f"{where}: time.dt")
        if dt <= 0.0:
            raise ColumnMapError(f"{where}: time.dt is {dt:g} s, must be positive")
    elif "column" in time:
        entry = {key: time[key] for key in ("column", "unit", "scale") if key in time}
        column = _column(entry, "time", f"{where}: time")
    notes = top.get("notes", [])
    notes = [notes] if isinstance(notes, str) else notes
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise ColumnMapError(f"{where}: notes is {notes!r}, must be a text or a list of texts")
    return ColumnMap(
        parts,
        column,
        dt,
        irregular,
        {name: column.unit for name, column in extra.items()},
        _choice(top.get("header"), f"{where}: header", (True, False, None)),
        _choice(top.get("delimiter"), f"{where}: delimiter", (",", ";", "\t", " ", None)),
        _choice(top.get("decimal"), f"{where}: decimal", (".", ",", None)),
        where,
        tuple(notes),
        files,
        _settings(top.get("settings", {}), f"{where}: settings"),
        step,
        skip=_count(top.get("skip", 0), f"{where}: skip"),
        ragged=_choice(top.get("ragged", False), f"{where}: ragged", (True, False)),
    )


def named_columns(found: Mapping[str, Column], base: ColumnMap | None) -> ColumnMap:
    """The map of columns that are called after their quantity; ``base`` says the rest, and perhaps the time."""
    base = base or ColumnMap({})
    channels = {name: column for name, column in found.items() if name != TIME}
    own_time = base.time is not None or base.dt is not None
    return replace(base, parts={"": channels}, time=base.time if own_time else found.get(TIME))


def column_of_header(header: str) -> tuple[str, Column]:
    """Quantity ("time" or a channel) and column of a header such as "position_mm" or "pressure_a_bar".

    :raises ColumnMapError: no such channel, no unit, or a unit that does not fit.
    """
    text = header.strip()
    where = f"column {text!r}"
    # The longest name first: "pressure_a_bar" is not a channel "pressure" in the unit "a_bar".
    for quantity in sorted(("time", *CHANNELS), key=len, reverse=True):
        if text == quantity or text.startswith(f"{quantity}_"):
            unit = text[len(quantity) + 1 :]
            if not unit:
                raise ColumnMapError(f"{where}: no unit; write {quantity}_{si_unit(quantity)}, for example")
            return quantity, Column(text, unit, *_si_factors(unit, quantity, where))
    raise ColumnMapError(
        f"{where} is no channel; expected <channel>_<unit> with time, {allowed()}; "
        "a column map can name or leave out any column"
    )


def _channels(document: Any, where: str) -> dict[str, Column]:
    entries = _mapping(document, where)
    for name in entries:
        if name not in CHANNELS:
            problem = f"{where}: {name!r} is no channel; allowed: {allowed()}; any other name under 'extra'"
            raise ColumnMapError(problem)
    # "pressure_b: null" says in so many words that a channel was not measured.
    return {n: _column(entry, n, f"{where}.{n}") for n, entry in entries.items() if entry is not None}


def _files(document: Any, parts: Mapping[str, Mapping[str, Column]], where: str) -> dict[str, Mapping[str, Column]]:
    found: dict[str, Mapping[str, Column]] = {}
    for pattern, group in _mapping(document, where).items():
        if not isinstance(pattern, str) or not pattern:
            raise ColumnMapError(f"{where}: {pattern!r} is no pattern of file names, such as '*_pA_*'")
        own = _channels(group, f"{where}.{pattern}")
        twice = [name for name in own if any(name in part for part in parts.values())]
        if twice:
            raise ColumnMapError(f"{where}.{pattern}: {', '.join(twice)} is mapped for all files already")
        if not own:
            raise ColumnMapError(f"{where}.{pattern} maps no channel")
        found[pattern] = own
    return found


def _extra(document: Any, where: str) -> dict[str, Column]:
    entries = _mapping(document, where)
    for name in entries:
        if name in (TIME, *CHANNELS) or not isinstance(name, str) or not name.isidentifier():
            allowed_names = "a name in letters, digits and _ that is no channel's"
            raise ColumnMapError(f"{where}: {name!r}; allowed: {allowed_names}")
    return {name: _column(entry, None, f"{where}.{name}") for name, entry in entries.items()}


def _settings(document: Any, where: str) -> dict[str, float | Column]:
    found: dict[str, float | Column] = {}
    for key, entry in _mapping(document, where).items():
        if not isinstance(key, str) or not all(part.isidentifier() for part in key.split(".")):
            raise ColumnMapError(f"{where}: {key!r} is no parameter's key, such as moving_mass or payload.mass")
        if isinstance(entry, Mapping):
            _mapping(entry, f"{where}.{key}", ("column", "sign", "scale", "offset"))
            found[key] = _column({**entry, "unit": "1"}, None, f"{where}.{key}")
        else:
            found[key] = _number(entry, f"{where}.{key}")
    return found


def _column(document: Any, quantity: str | None, where: str) -> Column:
    entry = _mapping(document, where, ("column", "unit", "sign", "scale", "offset", "held", "file", "command"))
    if "column" not in entry:
        raise ColumnMapError(f"{where}: 'column' is missing (a name in the header, or a number from 1)")
    column = entry["column"]
    if isinstance(column, bool) or not isinstance(column, (str, int)) or (isinstance(column, int) and column < 1):
        raise ColumnMapError(f"{where}: column is {column!r}, must be a name in the header or a number from 1")
    sign = _choice(entry.get("sign", 1), f"{where}.sign", (1, -1))
    scale = _number(entry.get("scale", 1.0), f"{where}.scale")
    if scale == 0.0:
        raise ColumnMapError(f"{where}.scale is 0, must not be")
    if not isinstance(entry.get("unit"), str) or not entry["unit"].strip():
        wanted = f"it must convert to {si_unit(quantity)}" if quantity else "it is kept as it is; '1' is allowed"
        raise ColumnMapError(f"{where}: 'unit' is {entry.get('unit')!r}, a text is needed; {wanted}")
    unit = entry["unit"]
    offset = _number(entry.get("offset", 0.0), f"{where}.offset")
    commanded = _choice(entry.get("command"), f"{where}.command", ("position", None)) is not None
    if commanded and (quantity is None or si_unit(quantity) != "V"):
        raise ColumnMapError(f"{where}.command: position is said of a drive or a command alone")
    position = "position" if commanded and not _ANGLE.search(unit) else quantity
    factors = (1.0, 0.0) if position is None else _si_factors(unit, position, where)
    held = _choice(entry.get("held"), f"{where}.held", (True, False, None))
    file = entry.get("file")
    if file is not None and (not isinstance(file, str) or not file or PurePath(file).name != file):
        raise ColumnMapError(f"{where}.file is {file!r}, must be the name of a file in the same folder")
    return Column(column, unit, *factors, sign, scale, offset, file, held)


def _si_factors(unit: str, quantity: str, where: str) -> tuple[float, float]:
    """``(factor, offset)`` with SI = factor·value + offset; raises `ColumnMapError` for another dimension."""
    wanted = si_unit(quantity)
    if unit == wanted:
        return 1.0, 0.0
    plain = unit.replace("_per_", "/").replace("_", " ")
    # Loaded only where a unit is to be converted: pint takes a good part of a second.
    from hydraulic_sim.errors import ModelError
    from hydraulic_sim.units import conversion

    if not unit.strip():
        raise ColumnMapError(f"{where}: no unit; expected one that converts to {wanted}")
    for meant in (wanted, *_AT_ONE_METRE.get(wanted, ())):
        if meant.startswith("rad") and _ANGLE.search(plain) is None:  # a plain number is no angle
            continue
        try:
            return conversion(plain, meant)
        except ModelError:
            continue
    raise ColumnMapError(f"{where}: unit {unit!r} does not convert to {wanted}")


def _mapping(document: Any, where: str, keys: Sequence[str] | None = None) -> Mapping[str, Any]:
    if not isinstance(document, Mapping):
        raise ColumnMapError(f"{where}: is {document!r}, must be a mapping of keys")
    for key in document:
        if keys is not None and key not in keys:
            raise ColumnMapError(f"{where}: unknown key {key!r}; allowed: {', '.join(keys)}")
    return document


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ColumnMapError(f"{where} is {value!r}, must be a finite number")
    return float(value)


def _count(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ColumnMapError(f"{where} is {value!r}, must be a number of lines, 0 or more")
    return value


def _choice(value: Any, where: str, choices: Sequence[Any]) -> Any:
    if not any(value == choice and type(value) is type(choice) for choice in choices):
        names = ", ".join(repr(choice) for choice in choices)
        raise ColumnMapError(f"{where} is {value!r}; allowed: {names}")
    return value
