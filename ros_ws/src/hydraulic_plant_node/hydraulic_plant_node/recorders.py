"""How far the recorders are that record: what they say of it is text, and anybody may publish any."""

from __future__ import annotations

from hydraulic_node_utils.json_file import json_object


class Recorders:
    """Follows the status texts of all recorders."""

    def __init__(self) -> None:
        self._reached_ns: dict[str, int] = {}

    def hear(self, text: str) -> None:
        """A recorder has said this; what is no status of one changes nothing."""
        status = json_object(text)
        output, reached_ns = status.get("output"), status.get("reached_ns")
        if not isinstance(output, str):
            return
        # A new mapping, as another thread may be looking at the old one.
        others = {name: at for name, at in self._reached_ns.items() if name != output}
        if status.get("state") == "recording" and type(reached_ns) is int and reached_ns:
            others[output] = reached_ns
        self._reached_ns = others

    def forget(self) -> None:
        """There is none."""
        self._reached_ns = {}

    def recorded_ns(self) -> int | None:
        """Stamp up to which every one has the samples; None where none records."""
        return min(self._reached_ns.values(), default=None)
