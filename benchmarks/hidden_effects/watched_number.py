"""A number that knows what it would be if a constant were another, and notes which decisions would then be others."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np

Label = tuple[str, str]
"""The constant, and what is made of it."""


class WatchedNumber:
    """Stands for a constant: arithmetic goes on with all it might be, a comparison notes in ``noted`` whose is another.

    Where it is turned into a plain number (in an array, a document), that is noted in ``lost``: nothing is known then.
    """

    __array_ufunc__ = None
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: float, others: dict[Label, float], noted: set[Label], lost: set[Label]) -> None:
        self.value, self.others, self.noted, self.lost = value, others, noted, lost

    def _with(self, other: Any, do: Callable[[Any, Any], Any]) -> WatchedNumber:
        theirs = other if isinstance(other, WatchedNumber) else None
        plain = other if theirs is None else theirs.value
        labels = {**self.others, **(theirs.others if theirs is not None else {})}
        found = {
            label: do(self.others.get(label, self.value), plain if theirs is None else theirs.others.get(label, plain))
            for label in labels
        }
        return WatchedNumber(do(self.value, plain), found, self.noted, self.lost)

    def _decided(self, other: Any, do: Callable[[Any, Any], Any]) -> Any:
        done = self._with(other, do)
        self.noted.update(label for label, one in done.others.items() if np.any(one != done.value))
        return done.value

    def _plain(self) -> float:
        self.lost.update(self.others)
        return self.value

    def __float__(self) -> float:
        return float(self._plain())

    def __int__(self) -> int:
        return int(self._plain())

    def __index__(self) -> int:
        return operator.index(self._plain())  # type: ignore[arg-type]

    def __bool__(self) -> bool:
        return bool(self._plain())

    def __format__(self, spec: str) -> str:
        return format(self._plain(), spec)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self._plain(), dtype=dtype)

    def __round__(self) -> WatchedNumber:
        return self._with(0, lambda value, _: round(value))

    def __neg__(self) -> WatchedNumber:
        return self._with(-1, operator.mul)


def _arithmetic(do: Callable[[Any, Any], Any]) -> Any:
    def done(a: WatchedNumber, b: Any) -> Any:
        return do(a._plain(), b) if isinstance(b, np.ndarray) else a._with(b, do)  # noqa: SLF001

    return done


def _turned(do: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda a, b: do(b, a)


def _comparison(do: Callable[[Any, Any], Any]) -> Any:
    return lambda a, b: a._decided(b, do)  # noqa: SLF001


for _name in ("add", "sub", "mul", "truediv", "floordiv", "pow"):
    _do = getattr(operator, _name)
    setattr(WatchedNumber, f"__{_name}__", _arithmetic(_do))
    setattr(WatchedNumber, f"__r{_name}__", _arithmetic(_turned(_do)))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(WatchedNumber, f"__{_name}__", _comparison(getattr(operator, _name)))
