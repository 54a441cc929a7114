"""Things of one kind that the page lists: each under an identifier that holds for this run, by the order they came."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from hydraulic_workbench.errors import UnknownError


class Item(Protocol):
    """Something on a shelf: a file or folder, and what the page shows of it."""

    id: str
    file: Path

    def document(self) -> dict[str, Any]:
        """For the page."""


T = TypeVar("T", bound=Item)


class Shelf(Generic[T]):
    """Items by identifier; a file is there once. ``changed`` is called after every change."""

    def __init__(self, prefix: str, what: str, changed: Callable[[], None]) -> None:
        self._prefix, self._what, self._changed = prefix, what, changed
        self._items: dict[str, T] = {}

    def __iter__(self) -> Iterator[T]:
        return iter(list(self._items.values()))

    def __getitem__(self, identifier: Any) -> T:
        """:raises UnknownError: nothing has that identifier."""
        try:
            return self._items[str(identifier)]
        except KeyError:
            raise UnknownError(f"there is no {self._what} {identifier!r}", self._what) from None

    def of_file(self, file: Path) -> T | None:
        """The item of a file; None where it is not on the shelf."""
        return next((item for item in self._items.values() if item.file == file), None)

    def add(self, file: Path, make: Callable[[str], T]) -> T:
        """The item of a file, made with a new identifier where it is not there yet."""
        known = self.of_file(file)
        if known is not None:
            return known
        identifier = self._new(file)
        item = self._items[identifier] = make(identifier)
        self._changed()
        return item

    def remove(self, identifier: str) -> None:
        """Take an item off the shelf; its file stays."""
        del self._items[self[identifier].id]
        self._changed()

    def tell(self) -> None:
        """An item has changed."""
        self._changed()

    def documents(self) -> list[dict[str, Any]]:
        """All items for the page, the newest last."""
        return [item.document() for item in self]

    def _new(self, file: Path) -> str:
        name = file.name.partition(".")[0] if file.suffix else file.name
        if name == "model":  # of a run's folder, which says more
            name = file.parent.name
        base = f"{self._prefix}-{re.sub(r'[^A-Za-z0-9_-]+', '-', name).strip('-') or 'item'}"
        known = (base, *(f"{base}-{number}" for number in range(2, len(self._items) + 3)))
        return next(identifier for identifier in known if identifier not in self._items)
