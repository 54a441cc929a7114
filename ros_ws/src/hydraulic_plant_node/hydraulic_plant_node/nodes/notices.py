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
        self._counters: dict[str, int] = {}

    def tell(self, conditions: Mapping[str, str]) -> None:
        """To be called again and again with all conditions that stand now, texts by key."""
        now = time.monotonic()
        self._seen = {key: at for key, at in self._seen.items() if now - at < _OVER_AFTER_S}
        for key, text in conditions.items():
            if key not in self._seen:
                self._log(text)
            self._seen[key] = now

    def moved(self, counter: str, value: int) -> bool:
        """Whether a counter has another value than at the last call."""
        before, self._counters[counter] = self._counters.get(counter, 0), value
        return value != before
