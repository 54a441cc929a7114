"""Health at a glance: the rows of `/diagnostics`, the latest of each name, and how old they are."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

LEVELS = ("ok", "warn", "error", "stale")
_WORST_FIRST = ("error", "warn", "stale", "ok")
STALE_S = 3.0
FORGOTTEN_S = 30.0


@dataclass(frozen=True)
class Row:
    """One row: whose it is and of what ("/actuator/plant: timing"), level, message, values, and when it came."""

    name: str
    level: int
    message: str
    values: Mapping[str, str]
    heard: float

    def shown(self, now: float) -> str:
        """Its level in a word; stale where it has not been repeated."""
        return "stale" if now - self.heard > STALE_S else LEVELS[min(self.level, 3)]


class HealthBoard:
    """The latest rows by name."""

    def __init__(self) -> None:
        self.rows: dict[str, Row] = {}

    def take(self, rows: Iterable[Row]) -> None:
        """Rows that came; those of nodes that have long gone are dropped."""
        now = time.monotonic()
        self.rows |= {row.name: row for row in rows}
        self.rows = {name: row for name, row in self.rows.items() if now - row.heard < FORGOTTEN_S}

    def forget(self, node: str) -> None:
        """Drop the rows of a node that another one replaces."""
        self.rows = {name: row for name, row in self.rows.items() if not name.startswith(f"{node}: ")}

    def values(self, name: str) -> Mapping[str, str]:
        """Values of a row; empty where there is none, or it is stale."""
        row = self.rows.get(name)
        return row.values if row is not None and time.monotonic() - row.heard < STALE_S else {}

    def document(self, hidden: Iterable[str] = ()) -> dict[str, Any]:
        """Rows for the page, the worst level first, without the ``hidden`` keys of their values."""
        now, secret = time.monotonic(), set(hidden)
        rows = [
            {"name": r.name, "level": r.shown(now), "message": r.message, "age": round(now - r.heard, 1),
             "values": {k: v for k, v in r.values.items() if k not in secret}}
            for r in self.rows.values()
        ]  # fmt: skip
        rows.sort(key=lambda row: (_WORST_FIRST.index(row["level"]), row["name"]))
        level = next((row["level"] for row in rows if row["level"] != "stale"), "stale")
        return {"level": level, "rows": rows}


def number(values: Mapping[str, str], key: str) -> float | None:
    """A value that is a finite number, else None."""
    try:
        found = float(values[key])
    except (KeyError, ValueError):
        return None
    return found if abs(found) < float("inf") else None
