"""What the user is told once while it lasts, however often it happens."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

_OVER_AFTER_S = 2.0


class Notices:
    """Calls `log` with the text of a condition when it begins; a condition that was gone for 2 s begins anew."""

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._seen: dict[str, float] = {}

    def tell(self, conditions: Mapping[str, str]) -> None:
        """To be called again and again with all conditions that stand now, texts by key."""
        now = time.monotonic()
        self._seen = {key: at for key, at in self._seen.items() if now - at < _OVER_AFTER_S}
        for key, text in conditions.items():
            if key not in self._seen:
                self._log(text)
            self._seen[key] = now


class Counters:
    """Counters by name, and by how much each has moved since it was looked at last."""

    def __init__(self) -> None:
        self._seen: dict[str, int] = {}

    def moved(self, counter: str, value: int) -> int:
        """By how much; one that starts anew has not moved by a negative number."""
        before, self._seen[counter] = self._seen.get(counter, 0), value
        return value - before if value >= before else value
