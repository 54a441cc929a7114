"""Reads bus files; everything that cannot be right is refused with file and line before the bus is touched."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from hydraulic_can_driver.bus import (
    NEEDED,
    SENT,
    SIGNALS,
    SWITCHES,
    TYPES,
    Address,
    Bus,
    Cylinder,
    Limits,
    Master,
    Monitoring,
    Node,
    Pdo,
    Reading,
    Scale,
    SdoWrite,
    Signal,
)
from hydraulic_can_driver.codec import raw_range
from hydraulic_can_driver.eds_check import check_against_eds
from hydraulic_can_driver.errors import BusFileError
from hydraulic_interfaces.errors import one_line
from hydraulic_node_utils.yaml_text import load_yaml
from hydraulic_plant_node.travel_limits import EndsOfTravel

FORMAT = "hydraulic-bus-1"
SHIPPED = Path(__file__).parent / "buses"

_IDENTITY = ("vendor", "product", "revision", "serial")
_MAX_SYNCHRONOUS = 240  # transmission types 1 ... 240: with every n-th SYNC (CiA 301, 7.5.2.36)
_MISSING = object()
T = TypeVar("T")


def shipped() -> list[str]:
    """Names of the bus files that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def load_bus(name: str | Path) -> Bus:
    """The bus of a file, or of a shipped one by its name.

    :raises BusFileError: there is no such file, or what it says is not acceptable.
    """
    path = Path(name).expanduser()
    if str(name) in shipped():
        path = SHIPPED / f"{name}.yaml"
    try:
        document = load_yaml(YAML(typ="rt"), path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise BusFileError(f"{path}: cannot be read ({error}); shipped are {', '.join(shipped())}") from None
    except YAMLError as error:
        raise BusFileError(f"{path}: not YAML: {one_line(error)}") from None
    top = _Section(path, document, "the bus")
    found = top.take("format", str)
    if found != FORMAT:
        raise top.fail("format", f"format is {found!r}; expected {FORMAT!r}")
    bus = Bus(
        name=top.take("name", str, path.stem),
        description=top.take("description", str, ""),
        interface=top.take("interface", str),
        channel=str(top.take("channel", object)),
        bitrate=top.take("bitrate", int, 1_000_000, 10_000, 1_000_000),
        rate=top.take("rate", float, 500.0, 1.0, 1000.0),
        master=top.read("master", _master),
        cylinder=top.read("cylinder", _cylinder),
        limits=top.read("limits", _limits),
        monitoring=top.read("monitoring", _monitoring),
        nodes={},
        path=path,
    )
    nodes = top.section("nodes")
    bus = replace(bus, nodes={name: nodes.read(name, partial(_node, name)) for name in nodes.names()})
    if bus.signal("switches") is None:
        top.unless_none("limit_switches", lambda: top.take("limit_switches", object), "no frame carries switches")
    top.done()
    _check(bus, nodes)
    check_against_eds(bus)
    return bus


class _Section:
    """A mapping of the file; knows where it stands, and what of it has been read."""

    def __init__(self, path: Path, node: Any, where: str) -> None:
        self._path, self._node, self._where = path, node, where
        self._read: set[str] = set()
        if not isinstance(node, dict):
            raise BusFileError(f"{path}: {where}: expected a mapping, found {node!r}")

    def fail(self, key: str, what: str) -> BusFileError:
        """The error, at the line of a key."""
        try:
            line = f":{self._node.lc.key(key)[0] + 1}"
        except (AttributeError, KeyError, TypeError):
            lc = getattr(self._node, "lc", None)
            line = f":{lc.line + 1}" if lc is not None and lc.line is not None else ""
        return BusFileError(f"{self._path}{line}: {what}")

    def names(self) -> list[str]:
        """All keys, as text."""
        return [str(key) for key in self._node]

    def take(
        self, key: str, kind: type, default: Any = _MISSING, low: float = -math.inf, high: float = math.inf
    ) -> Any:
        """The value of a key in the type `kind`, within `low` ... `high`."""
        self._read.add(key)
        if key not in self._node:
            if default is _MISSING:
                raise self.fail(key, f"{self._where} has no {key!r}")
            return default
        value = self._node[key]
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if kind is not object and (not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)):
            raise self.fail(key, f"{key} is {value!r}; expected {kind.__name__}")
        if kind in (int, float) and not (math.isfinite(value) and low <= value <= high):
            raise self.fail(key, f"{key} is {value:g}; allowed: {low:g} ... {high:g}")
        return kind(value) if kind in (int, float, str) else value

    def unless_none(self, key: str, take: Callable[[], T], what: str) -> T | None:
        """What `take` reads under a key; None where the file says `none`: the bench then does without ``what``."""
        self._read.add(key)
        if key not in self._node:
            raise self.fail(key, f"{self._where} has no {key!r}: {what}; a bench without it says {key}: none")
        return None if self._node[key] == "none" else take()

    def section(self, key: str, optional: bool = False) -> _Section:
        """The mapping under a key."""
        return _Section(self._path, self.take(key, object, {} if optional else _MISSING), f"{self._where}, {key}")

    def read(self, key: str, build: Callable[[_Section], T]) -> T:
        """What `build` makes of the mapping under a key, all of which it has to read."""
        return self.section(key).built(build)

    def rows(self, key: str, build: Callable[[_Section], T]) -> tuple[T, ...]:
        """The same of each mapping of the list under a key; none if there is no such key."""
        rows = self.take(key, object, [])
        if not isinstance(rows, list):
            raise self.fail(key, f"{key}: expected a list, found {rows!r}")
        places = ((row, f"{self._where}, {key} {number}") for number, row in enumerate(rows, 1))
        return tuple(_Section(self._path, row, where).built(build) for row, where in places)

    def built(self, build: Callable[[_Section], T]) -> T:
        """What `build` makes of this mapping."""
        found = build(self)
        self.done()
        return found

    def done(self) -> None:
        """Refuse what nobody has read."""
        for key in self._node:
            if str(key) not in self._read:
                allowed = ", ".join(sorted(self._read))
                raise self.fail(key, f"{self._where} has no key {str(key)!r}; allowed: {allowed}")


def _master(at: _Section) -> Master:
    found = Master(
        at.take("id", int, 0x7F, 1, 127),
        at.take("heartbeat", float, low=0.001, high=10.0),
        at.take("lost_after", float, low=0.002, high=60.0),
    )
    if found.lost_after < 2.0 * found.heartbeat:
        raise at.fail(
            "lost_after",
            f"lost_after is {found.lost_after:g} s; expected at least two heartbeats of {found.heartbeat:g} s",
        )
    return found


def _cylinder(at: _Section) -> Cylinder:
    return Cylinder(*(at.take(key, float, math.nan, 0.0, 10.0) for key in ("area_a", "area_b")))


def _limits(at: _Section) -> Limits:
    position = at.take("position", list)
    if len(position) != 2 or not all(isinstance(x, int | float) for x in position) or not position[0] < position[1]:
        raise at.fail("position", f"position is {list(position)!r}; expected [lowest, highest], m")
    low, high, full_speed = float(position[0]), float(position[1]), at.take("full_speed", float, low=1e-6, high=100.0)

    def braking(at: _Section) -> EndsOfTravel:
        return EndsOfTravel(
            low,
            high,
            at.take("impact_speed", float, low=1e-4, high=1.0),
            full_speed,
            at.take("deceleration", float, low=1e-3, high=1e3),
            at.take("reaction", float, low=1e-3, high=10.0),
            at.take("slew", float, low=1.0, high=1e6),
        )

    return Limits(
        at.take("drive", float, 10.0, 1e-3, 10.0),
        (low, high),
        at.take("position_margin", float, low=0.0),
        at.take("velocity", float, low=1e-6),
        full_speed,
        at.unless_none("braking", lambda: at.read("braking", braking), "slew and speed before the stops"),
        at.take("frozen_travel", float, low=1e-6, high=1.0),
        at.take("frozen_spool", float, low=0.0, high=1.0),
        at.take("frozen_supply", float, low=0.0),
    )


def _monitoring(at: _Section) -> Monitoring:
    return Monitoring(
        at.take("frames_within", float, low=0.1, high=0.95),
        at.take("missed_cycles", int, low=1, high=1000),
        at.take("sync_gap", float, low=0.002, high=10.0),
        at.take("state_change", float, low=0.01, high=60.0),
        at.take("heartbeats", int, 3, 2, 100),
    )


def _node(name: str, at: _Section) -> Node:
    identity = at.section("identity", optional=True)
    found = Node(
        name=name,
        id=at.take("id", int, low=1, high=127),
        profile=at.take("profile", int, low=301, high=499),
        eds=at.take("eds", str, ""),
        identity={key: identity.take(key, int, low=0, high=0xFFFFFFFF) for key in identity.names()},
        heartbeat=at.unless_none("heartbeat", lambda: at.take("heartbeat", float, low=0.001, high=1.0), "its period, s")
        or 0.0,
        boot=at.rows("boot", _write),
        receive=at.rows("receive", _received),
        transmit=at.rows("transmit", partial(_pdo, [name for name in SIGNALS if name not in SENT])),
        inspect=at.rows("inspect", _reading),
    )
    for key in found.identity:
        if key not in _IDENTITY:
            raise identity.fail(key, f"identity has no key {key!r}; allowed: {', '.join(_IDENTITY)}")
    names = [reading.name for reading in found.inspect]
    for reading in found.inspect:
        if reading.switch and reading.switch not in names:
            raise at.fail("inspect", f"{reading.name}: switch {reading.switch!r} is none of {', '.join(names)}")
    return found


def _address(at: _Section) -> Address:
    kind = at.take("type", str)
    if kind not in TYPES:
        raise at.fail("type", f"type is {kind!r}; allowed: {', '.join(TYPES)}")
    return Address(at.take("object", int, low=0x1000, high=0xFFFF), at.take("sub", int, 0, 0, 255), kind)


def _scale(at: _Section, unit: str | None = None) -> Scale:
    """Scaling of a quantity; `unit` is the one that it must have."""
    if unit == "" or (unit is None and "unit" not in at.names()):
        return Scale()
    found = at.take("unit", str)
    if unit is not None and found != unit:
        raise at.fail("unit", f"unit is {found!r}; expected {unit!r}")
    counts, value = at.take("counts", float), at.take("value", float)
    if counts == 0.0 or value == 0.0:
        raise at.fail("counts", f"{counts:g} counts are {value:g} {found}; neither may be 0")
    sign = at.take("sign", int, 1)
    if sign not in (1, -1):
        raise at.fail("sign", f"sign is {sign}; allowed: 1, -1")
    return Scale(sign * value / counts, at.take("offset", float, 0.0), found)


def _write(at: _Section) -> SdoWrite:
    address = _address(at)
    kind: type = float if address.type == "f32" else int
    low, high = raw_range(address.type)
    return SdoWrite(address, at.take("value", kind, low=low, high=high), at.take("comment", str, ""))


def _reading(at: _Section) -> Reading:
    return Reading(
        at.take("name", str),
        _address(at),
        _scale(at),
        at.take("neutral", float, None),
        at.take("effect", str, ""),
        at.take("switch", str, ""),
    )


def _received(at: _Section) -> Pdo:
    what = "after how many s the valve misses a drive"
    timeout = at.unless_none("timeout", lambda: at.take("timeout", float, low=0.002, high=60.0), what)
    return replace(_pdo(SENT, at), timeout=timeout or 0.0)


def _pdo(allowed: Sequence[str], at: _Section) -> Pdo:
    found = Pdo(
        number=at.take("number", int, low=1, high=512),
        cob_id=at.take("cob_id", int, low=0x181, high=0x57F),
        transmission=at.take("transmission", int, 1, 1, 255),
        signals=at.rows("map", partial(_signal, allowed)),
    )
    if not 1 <= found.length <= 8:
        raise at.fail("map", f"map has {found.length} bytes; a frame carries 1 ... 8")
    return found


def _signal(allowed: Sequence[str], at: _Section) -> Signal:
    name = at.take("signal", str)
    if name not in allowed:
        raise at.fail("signal", f"signal is {name!r}; allowed here: {', '.join(allowed)}")
    address = _address(at)
    bits = at.section("bits", optional=True)
    named = {key: bits.take(key, int, low=0, high=address.bits - 1) for key in bits.names()}
    found = Signal(name, address, _scale(at, SIGNALS[name]), named)
    if name == "switches" and sorted(named) != sorted(SWITCHES):
        raise at.fail("bits", f"bits are {sorted(named)}; expected {sorted(SWITCHES)}")
    if not SIGNALS[name] and address.type[0] != "u":
        raise at.fail("type", f"{name} is of type {address.type}; expected one without sign")
    return found


def _check(bus: Bus, nodes: _Section) -> None:
    """What only the whole bus shows."""
    fail: Callable[[str, str], BusFileError] = nodes.fail
    ids: dict[int, str] = {bus.master.id: "master"}
    cob_ids: dict[int, str] = {}
    seen: set[str] = set()
    for name, node in bus.nodes.items():
        if node.id in ids:
            raise fail(name, f"{name} has id 0x{node.id:02X}, which is that of {ids[node.id]}")
        ids[node.id] = name
        for pdo in (*node.receive, *node.transmit):
            if pdo.cob_id in cob_ids:
                raise fail(name, f"{name}: COB-ID 0x{pdo.cob_id:X} is used by {cob_ids[pdo.cob_id]} too")
            if pdo in node.transmit and pdo.transmission != 1:
                raise fail(name, f"{name}: transmission {pdo.transmission}; a sample needs a frame with every SYNC: 1")
            if pdo in node.receive and _MAX_SYNCHRONOUS < pdo.transmission < 254:
                raise fail(name, f"{name}: transmission {pdo.transmission}; allowed: 1 ... 240, 254, 255")
            cob_ids[pdo.cob_id] = name
            for signal in pdo.signals:
                if signal.name in seen:
                    raise fail(name, f"{name}: signal {signal.name} is mapped twice")
                seen.add(signal.name)
    receivers = [node for node in bus.nodes.values() if node.receive]
    if len(receivers) != 1 or len(receivers[0].receive) != 1:
        raise BusFileError(f"{bus.path}: exactly one node must have exactly one `receive`: the valve")
    if missing := [name for name in (*SENT, *NEEDED) if name not in seen]:
        raise BusFileError(f"{bus.path}: no frame carries {', '.join(missing)}")
    if not any(signal.name == "status_word" for pdo in bus.valve.transmit for signal in pdo.signals):
        raise BusFileError(f"{bus.path}: the status word must come from the node that takes the control word")
