"""Work on all processors within this process: simulation and linear algebra hold no lock of the interpreter."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
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

    What a worker asks for itself, it does itself, but for what others take off it that have nothing else to do.
    """
    given = list(items)
    if len(given) < 2:
        return map(function, given)
    workers = _workers(processors.usable())
    if not getattr(_here, "works", False):
        return workers.map(function, given)
    return _shared(function, given, [workers.submit(function, one) for one in given])


def _shared(function: Callable[[A], B], items: Sequence[A], futures: Sequence[Future[B]]) -> Iterator[B]:
    """From the last on, as others take the first. It waits only for what another one works on, so none for ever."""
    own: dict[int, B] = {}
    try:
        for i in reversed(range(len(items))):
            if futures[i].cancel():
                own[i] = function(items[i])
    finally:
        for future in futures:
            future.cancel()
    return (own[i] if i in own else future.result() for i, future in enumerate(futures))


def _begin() -> None:
    _here.works = True


@lru_cache(maxsize=4)
def _workers(number: int) -> ThreadPoolExecutor:
    """The threads that all fits of a process share."""
    return ThreadPoolExecutor(number, initializer=_begin)
