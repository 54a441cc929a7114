"""Declared values: what a plan and a signal are given, with unit, range and meaning beside each name.

A declared class is a frozen dataclass whose fields are made by `number`, `integer`, `numbers`, `choice`, `text` and
`path`. The declarations do the checking, so that a YAML file, a ROS parameter and a call from Python are refused for
the same reasons in the same words. Values are SI; a string may carry its own unit ("500 mV").
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from hydraulic_sysid.excitation.errors import PlanError

D = TypeVar("D", bound="Declared")


@dataclass(frozen=True)
class Declaration:
    """One declared value: ``allowed`` in words, and ``read`` gives it in its proper type or raises ValueError."""

    doc: str
    allowed: str
    read: Callable[[Any], Any]
    unit: str = ""
    is_path: bool = False


def in_unit(value: Any, unit: str) -> float:
    """`value` as a float in `unit`: a number, its text, or text with a unit of its own ("500 mV").

    :raises ValueError: anything else, also a unit of another dimension.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{value!r} is not a number")
    try:
        return float(value)  # also the text of a number
    except ValueError:
        pass
    from hydraulic_sim.units import to_si  # only here: loading it takes longer than everything else in a plan

    return to_si(value, unit)


def _declared(default: Any, *declaration: Any) -> Any:
    return field(default=default, metadata={"declaration": Declaration(*declaration)})


def _checked(value: Any, good: bool) -> Any:
    if not good:
        raise ValueError
    return value


def _ranged(unit: str, low: float, high: float, above: float | None) -> tuple[str, Callable[[Any], float]]:
    """A number from ``low`` (or above ``above``) up to ``high``, in words; and what reads one."""
    lower = f"above {above:g}" if above is not None else "" if low == -math.inf else f"from {low:g}"
    upper = "" if high == math.inf else f"up to {high:g}"

    def read(value: Any) -> float:
        x = in_unit(value, unit)
        return _checked(x, math.isfinite(x) and (x >= low if above is None else x > above) and x <= high)

    return " ".join(filter(None, ("a number", lower, upper, unit))), read


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
    return _declared(default, doc, *_ranged(unit, minimum, maximum, above), unit)


def numbers(
    unit: str, doc: str, default: Any = MISSING, *, minimum: float = -math.inf, maximum: float = math.inf
) -> Any:
    """A field holding a tuple of at least one number in `unit` (SI); a lone number is a tuple of one."""
    allowed, one = _ranged(unit, minimum, maximum, None)

    def read(value: Any) -> tuple[float, ...]:
        items = tuple(value) if isinstance(value, (list, tuple)) else (value,)
        return tuple(one(item) for item in _checked(items, bool(items)))

    return _declared(default, doc, f"one or a list, each {allowed}", read, unit)


def integer(doc: str, default: Any = MISSING, *, minimum: int, maximum: int) -> Any:
    """A field holding a whole number."""
    allowed, one = _ranged("", minimum, maximum, None)

    def read(value: Any) -> int:
        x = one(value)
        return int(_checked(x, x == int(x)))

    return _declared(default, doc, allowed.replace("a number", "a whole number"), read)


def choice(doc: str, options: tuple[str, ...], default: Any = MISSING) -> Any:
    """A field holding one of a few words."""
    return _declared(default, doc, " | ".join(options), lambda value: _checked(value, value in options))


def text(doc: str, default: Any = MISSING) -> Any:
    """A field holding text."""
    return _declared(default, doc, "text", lambda value: _checked(value, isinstance(value, str)))


def path(doc: str, default: Any = MISSING) -> Any:
    """A field holding the path of a file; whether it can be read is the reader's business."""

    def read(value: Any) -> str:
        return str(_checked(value, isinstance(value, (str, Path)) and bool(str(value))))

    return _declared(default, doc, "the path of a file", read, "", True)


def section(doc: str, kind: type, default: Any = MISSING) -> Any:
    """A field holding other declared values, of class `kind`."""
    return _declared(default, doc, f"a {kind.__name__}", lambda value: _checked(value, isinstance(value, kind)))


@dataclass(frozen=True)
class Declared:
    """Base of what is declared so: checks every declared field, reads from and writes to a mapping."""

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
    def from_mapping(cls: type[D], mapping: Mapping[str, Any], folder: Path | None = None) -> D:
        """Build from `mapping`; relative paths count from `folder`.

        :raises PlanError: a key is unknown or missing, or a value is not allowed.
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
            is_path = item.metadata["declaration"].is_path
            if is_path and folder is not None and isinstance(values.get(key), str) and values[key]:
                values[key] = str((folder / values[key]).resolve())
        return cls(**values)

    def as_mapping(self) -> dict[str, Any]:
        """The declared fields as plain YAML and JSON values; `from_mapping` gives the same object back."""
        values = {item.name: getattr(self, item.name) for item in declared_fields(type(self))}
        return {key: list(v) if isinstance(v, tuple) else v for key, v in values.items() if v is not None}


def declared_fields(cls: type[Declared]) -> list[Field[Any]]:
    """The declared fields of a class, in order; `.metadata["declaration"]` is the `Declaration` of each."""
    return [item for item in fields(cls) if "declaration" in item.metadata]
