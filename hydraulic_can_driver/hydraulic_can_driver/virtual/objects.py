"""Values in a device's object dictionary: what the device itself puts there, and what has been written to it.

`canopen` looks an object up and decodes it at every access; process data need that some ten thousand times per second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import canopen
from canopen.objectdictionary import INTEGER_TYPES, SIGNED_TYPES, ODVariable

VALUE_TOO_HIGH, VALUE_TOO_LOW = 0x06090031, 0x06090032
"""SDO abort codes."""


class NumberType(NamedTuple):
    """Range of a number, and its bytes."""

    low: float
    high: float
    encode: Callable[[Any], bytes]


class Objects:
    """The dictionary with the values of one power-on; ``stored`` gives the bytes of what has been written."""

    def __init__(self, dictionary: canopen.ObjectDictionary) -> None:
        self.dictionary = dictionary
        self._own: dict[tuple[int, int], float] = {}
        self._numbers: dict[tuple[int, int], Any] = {}
        self._types: dict[tuple[int, int], NumberType] = {}

    def clear(self) -> None:
        """Forget all values."""
        self._own.clear()
        self._numbers.clear()

    def number(self, index: int, sub: int, stored: Callable[[int, int], bytes]) -> Any:
        """Decoded value."""
        value = self._numbers.get((index, sub))
        if value is None:
            value = self._numbers[index, sub] = self.variable(index, sub).decode_raw(stored(index, sub))
        return value

    def put(self, index: int, sub: int, value: float) -> None:
        """The device's own value, cut to the range of the type."""
        limits = self.type(index, sub)
        self._own[index, sub] = self._numbers[index, sub] = min(max(value, limits.low), limits.high)

    def own(self, index: int, sub: int) -> float | None:
        """The device's own value; None where there is none."""
        return self._own.get((index, sub))

    def written(self, index: int, sub: int) -> None:
        """Another value has been written over it."""
        self._own.pop((index, sub), None)
        self._numbers.pop((index, sub), None)

    def variable(self, index: int, sub: int) -> ODVariable:
        """Description of an object; KeyError where there is none."""
        found = self.dictionary[index]
        return found if isinstance(found, ODVariable) else found[sub]

    def find(self, index: int, sub: int) -> ODVariable | None:
        """Description of an object, if there is one."""
        try:
            return self.variable(index, sub)
        except KeyError:
            return None

    def mappable(self, index: int, sub: int) -> int:
        """Bits of an object that may be mapped into process data; 0 if it may not."""
        found = self.find(index, sub)
        return len(found) if found is not None and found.pdo_mappable else 0

    def type(self, index: int, sub: int) -> NumberType:
        """Type of an object that holds a number."""
        found = self._types.get((index, sub))
        if found is None:
            od = self.variable(index, sub)
            low, high = -math.inf, math.inf
            if od.data_type in INTEGER_TYPES:
                low = -(1 << len(od) - 1) if od.data_type in SIGNED_TYPES else 0
                high = low + (1 << len(od)) - 1
            found = self._types[index, sub] = NumberType(low, high, od.encode_raw)
        return found

    def value_to_write(self, index: int, sub: int, data: bytes) -> int | None:
        """The integer that a master wants to write; None where `canopen` itself will answer.

        :raises canopen.SdoAbortedError: the value is beyond its limits.
        """
        od = self.find(index, sub)
        if od is None or od.data_type not in INTEGER_TYPES or 8 * len(data) != len(od) or not od.writable:
            return None
        value: Any = od.decode_raw(data)
        if od.max is not None and value > od.max:
            raise canopen.SdoAbortedError(VALUE_TOO_HIGH)
        if od.min is not None and value < od.min:
            raise canopen.SdoAbortedError(VALUE_TOO_LOW)
        return int(value)
