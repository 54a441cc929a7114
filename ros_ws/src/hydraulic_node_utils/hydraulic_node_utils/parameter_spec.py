"""One row of a node's parameter table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from hydraulic_interfaces.errors import HydraulicError


class ParameterError(HydraulicError, ValueError):
    """A value that a parameter cannot have; the message says which are allowed."""


@dataclass(frozen=True)
class ParameterSpec:
    """A parameter; its type is that of `default`.

    `live` parameters can be set while the node is active; the others are read when the node is configured.
    """

    name: str
    default: bool | int | float | str
    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    live: bool = False
    choices: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether it is a whole number."""
        return type(self.default) is int

    def check(self, value: Any) -> Any:
        """`value` in the parameter's type.

        :raises ParameterError: wrong type, not finite, out of range, or none of the choices.
        """
        kind = type(self.default)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise ParameterError(f"{self.name} is {value!r}, must be of type {kind.__name__}")
        if self.choices and value not in self.choices:
            raise ParameterError(f"{self.name} is {value!r}; allowed are {', '.join(self.choices)}")
        if isinstance(value, bool | str):
            return value
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if not (math.isfinite(value) and low <= value <= high):
            unit = f" {self.unit}" if self.unit else ""
            raise ParameterError(f"{self.name} is {value:g}{unit}, must be within {low:g} … {high:g}{unit}")
        return value
