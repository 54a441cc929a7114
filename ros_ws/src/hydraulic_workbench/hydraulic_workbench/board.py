"""The state that every page shows, by topic; what changes goes to all of them."""

from __future__ import annotations

from typing import Any

from hydraulic_workbench.hub import Hub

OFF = {"phase": "off", "text": ""}


class Board:
    """One dictionary of dictionaries; see the events `hello` and `state`."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._state: dict[str, Any] = {
            "plant": {"kind": "none", "name": "", "model": None, "phase": "stopped", "text": "no plant runs"},
            "health": {"level": "stale", "rows": []},
            "experiment": {"phase": "idle", "text": ""},
            "live_model": {**OFF, "model": None, "name": "", "residual": None},
            "controller": {**OFF, "law": None, "active": False, "can_undo": False},
            "reference": {**OFF, "kind": None},
            "current_model": None,
            "guess": None,
        }

    def __getitem__(self, key: str) -> Any:
        return self._state[key]

    @property
    def state(self) -> dict[str, Any]:
        """All of it."""
        return dict(self._state)

    def put(self, key: str, value: Any) -> None:
        """Replace one part; pages hear of it where it differs."""
        if self._state.get(key) != value:
            self._state[key] = value
            self._hub.tell("state", state={key: value})

    def change(self, key: str, **values: Any) -> None:
        """Change some entries of one part."""
        self.put(key, {**(self._state[key] or {}), **values})
