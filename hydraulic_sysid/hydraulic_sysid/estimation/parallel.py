"""Work on all processors within this process: simulation and linear algebra hold no lock of the interpreter."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

from hydraulic_node_utils import processors

A = TypeVar("A")
B = TypeVar("B")

_here = threading.local()

if TYPE_CHECKING:
    lazy = cached_property
else:

    class lazy:  # noqa: N801
        """A `functools.cached_property` without a lock: before Python 3.12 that has one, which all objects share."""

        def __init__(self, function: Callable[[Any], Any]) -> None:
            self._function, self.__doc__ = function, function.__doc__

        def __set_name__(self, owner: type, name: str) -> None:
            self._name = name

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            if instance is None:
                return self
            found = instance.__dict__[self._name] = self._function(instance)
            return found


def results(function: Callable[[A], B], items: Iterable[A]) -> Iterator[B]:
    """What the function gives for each item, in their order, all processors at work.

    What a worker asks for itself, it does alone: the others are busy.
    """
    given = list(items)
    if getattr(_here, "works", False) or len(given) < 2:
        return map(function, given)
    return _workers(processors.usable()).map(function, given)


def _begin() -> None:
    _here.works = True


@lru_cache(maxsize=4)
def _workers(number: int) -> ThreadPoolExecutor:
    """The threads that all fits of a process share."""
    return ThreadPoolExecutor(number, initializer=_begin)
