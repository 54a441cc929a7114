"""Declared settings: what a plan and a signal are told, with unit, range and meaning beside each name.

A settings class is a frozen dataclass whose fields are made by `number`, `integer`, `numbers`, `choice`,
`text` and `path`. The declarations do the checking, so that a YAML file, a ROS parameter and a call from
Python are refused for the same reasons in the same words. Values are SI; a string may carry its own unit
("500 mV").
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from hydraulic_sysid.excitation.errors import PlanError

S = TypeVar("S", bound="Settings")


@dataclass(frozen=True)
class Declaration:
    """One declared value: `read` returns it in its proper type or raises ValueError."""

    doc: str
    unit: str = ""

    @property
    def allowed(self) -> str:
        """The allowed values in words, for error messages and tables."""
        return "text"

    def read(self, value: Any) -> Any:
        """`value` in its proper type; ValueError where it is not allowed."""
        if not isinstance(value, str):
            raise ValueError
        return value


@dataclass(frozen=True)
class Number(Declaration):
    """A finite number within [minimum, maximum], or above `minimum` where that end is open."""

    minimum: float = -math.inf
    maximum: float = math.inf
    open_minimum: bool = False

    @property
    def allowed(self) -> str:
        low = "" if self.minimum == -math.inf else f"{'above' if self.open_minimum else 'from'} {self.minimum:g}"
        high = "" if self.maximum == math.inf else f"up to {self.maximum:g}"
        limits = " ".join(part for part in (low, high) if part)
        return " ".join(part for part in ("a number", limits, self.unit) if part)

    def read(self, value: Any) -> float:
        number = in_unit(value, self.unit)
        too_low = number <= self.minimum if self.open_minimum else number < self.minimum
        if not math.isfinite(number) or too_low or number > self.maximum:
            raise ValueError
        return number


@dataclass(frozen=True)
class Integer(Number):
    """A whole number."""

    @property
    def allowed(self) -> str:
        return super().allowed.replace("a number", "a whole number")

    def read(self, value: Any) -> int:
        number = super().read(value)
        if number != int(number):
            raise ValueError
        return int(number)


@dataclass(frozen=True)
class Numbers(Number):
    """A list of at least one number, each within the range; a lone number is a list of one."""

    @property
    def allowed(self) -> str:
        return "one or a list, each " + super().allowed

    def read(self, value: Any) -> tuple[float, ...]:  # type: ignore[override]
        items = value if isinstance(value, (list, tuple)) else (value,)
        if not items:
            raise ValueError
        return tuple(super(Numbers, self).read(item) for item in items)


@dataclass(frozen=True)
class Choice(Declaration):
    """One of a few words."""

    options: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        return " | ".join(self.options)

    def read(self, value: Any) -> str:
        if value not in self.options:
            raise ValueError
        return value


@dataclass(frozen=True)
class FilePath(Declaration):
    """A path of a file; whether it can be read is the reader's business."""

    @property
    def allowed(self) -> str:
        return "the path of a file"

    def read(self, value: Any) -> str:
        if not isinstance(value, (str, Path)) or not str(value):
            raise ValueError
        return str(value)


@dataclass(frozen=True)
class Section(Declaration):
    """Settings within settings."""

    kind: type = object

    @property
    def allowed(self) -> str:
        return f"a {self.kind.__name__}"

    def read(self, value: Any) -> Any:
        if not isinstance(value, self.kind):
            raise ValueError
        return value


def in_unit(value: Any, unit: str) -> float:
    """`value` as a float in `unit`: a number, its text, or text with a unit of its own ("500 mV").

    Raises ValueError for anything else, also for a unit of another dimension.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{value!r} is not a number")
    try:
        return float(value)  # also the text of a number
    except ValueError:
        pass
    from hydraulic_sim.units import to_si  # only here: loading it takes longer than everything else in a plan

    return to_si(value, unit)


def _declared(declaration: Declaration, default: Any) -> Any:
    return field(default=default, metadata={"declaration": declaration})


def number(
    unit: str,
    doc: str,
    default: Any = MISSING,
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    above: float | None = None,
) -> Any:
    """A field holding a number in `unit` (SI)."""
    low, is_open = (minimum, False) if above is None else (above, True)
    return _declared(Number(doc, unit, low, maximum, is_open), default)


def numbers(
    unit: str, doc: str, default: Any = MISSING, *, minimum: float = -math.inf, maximum: float = math.inf
) -> Any:
    """A field holding a tuple of numbers in `unit` (SI)."""
    return _declared(Numbers(doc, unit, minimum, maximum), default)


def integer(doc: str, default: Any = MISSING, *, minimum: int, maximum: int) -> Any:
    """A field holding a whole number."""
    return _declared(Integer(doc, "", minimum, maximum), default)


def choice(doc: str, options: tuple[str, ...], default: Any = MISSING) -> Any:
    """A field holding one of a few words."""
    return _declared(Choice(doc, "", options), default)


def text(doc: str, default: Any = MISSING) -> Any:
    """A field holding text."""
    return _declared(Declaration(doc), default)


def path(doc: str, default: Any = MISSING) -> Any:
    """A field holding the path of a file."""
    return _declared(FilePath(doc), default)


def section(doc: str, kind: type, default: Any = MISSING) -> Any:
    """A field holding other settings, of class `kind`."""
    return _declared(Section(doc, "", kind), default)


@dataclass(frozen=True)
class Settings:
    """Base of the settings classes: checks every declared field, reads from and writes to a mapping."""

    label: ClassVar[str] = ""  # what error messages call it

    def __post_init__(self) -> None:
        for item in declared_fields(type(self)):
            value = getattr(self, item.name)
            declaration = item.metadata["declaration"]
            if value is None and item.default is None:
                continue
            try:
                object.__setattr__(self, item.name, declaration.read(value))
            except ValueError:
                raise self.error(item.name, value, declaration.allowed) from None
        self.check()

    def check(self) -> None:
        """Conditions between several fields; raise `self.error(…)` where one fails."""

    def error(self, key: str, value: object, allowed: str) -> PlanError:
        """The error that names `key` of this object."""
        return PlanError(self.label, key, value, allowed)

    @classmethod
    def from_mapping(cls: type[S], mapping: Mapping[str, Any], folder: Path | None = None) -> S:
        """Build from `mapping`; relative paths count from `folder`.

        Raises:
            PlanError: a key is unknown or missing, or a value is not allowed.
        """
        declared = {item.name: item for item in declared_fields(cls)}
        for key, value in mapping.items():
            if key not in declared:
                raise PlanError(cls.label, str(key), value, "one of the keys " + ", ".join(declared))
        for key, item in declared.items():
            if key not in mapping and item.default is MISSING:
                raise PlanError(cls.label, key, None, f"{item.metadata['declaration'].allowed} (the key is missing)")
        values = dict(mapping)
        for key, item in declared.items():
            is_path = isinstance(item.metadata["declaration"], FilePath)
            if is_path and folder is not None and isinstance(values.get(key), str) and values[key]:
                values[key] = str((folder / values[key]).resolve())
        return cls(**values)

    def as_mapping(self) -> dict[str, Any]:
        """The declared fields as plain YAML and JSON values; `from_mapping` gives the same object back."""
        values = {item.name: getattr(self, item.name) for item in declared_fields(type(self))}
        return {key: list(v) if isinstance(v, tuple) else v for key, v in values.items() if v is not None}


def declared_fields(cls: type[Settings]) -> list[Field[Any]]:
    """The declared fields of a settings class, in order; `.metadata["declaration"]` tells unit, range and
    doc."""
    return [item for item in fields(cls) if "declaration" in item.metadata]
