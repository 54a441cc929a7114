"""One row of a node's parameter table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


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

    def check(self, value: Any) -> Any:
        """`value` in the parameter's type.

        :raises ValueError: wrong type, not finite, or out of range; the text says what is allowed.
        """
        kind = type(self.default)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise ValueError(f"{self.name} is {value!r}, must be of type {kind.__name__}")
        if isinstance(value, bool | str):
            return value
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if not (math.isfinite(value) and low <= value <= high):
            unit = f" {self.unit}" if self.unit else ""
            raise ValueError(f"{self.name} is {value:g}{unit}, must be within {low:g} … {high:g}{unit}")
        return value
