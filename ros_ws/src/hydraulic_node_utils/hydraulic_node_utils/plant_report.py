"""What the plant says about itself on `/diagnostics`, as far as a source of commands must know."""

from __future__ import annotations

from collections.abc import Mapping

from hydraulic_interfaces.contract import PLANT_NODE, absolute

PLANT_ROW = f"{absolute(PLANT_NODE)}: plant"
COMMAND_ROW = f"{absolute(PLANT_NODE)}: command"


class PlantReport:
    """The latest of the plant's two rows: is it enabled, whom does it obey, what does it complain about."""

    def __init__(self) -> None:
        self._rows: dict[str, tuple[str, dict[str, str]]] = {}
        self._complaints: dict[str, str] = {}

    def update(self, name: str, ok: bool, message: str, values: Mapping[str, str]) -> None:
        """Take a row of the diagnostics; rows of other nodes are passed over."""
        if name not in (PLANT_ROW, COMMAND_ROW):
            return
        self._rows[name] = (message, dict(values))
        if not ok:
            self._complaints[name] = message
        elif name == PLANT_ROW:
            self._complaints.pop(name, None)

    @property
    def disabled(self) -> str:
        """Why the plant moves for nobody, in its own words; empty when it is enabled."""
        message, values = self._rows.get(PLANT_ROW, ("no diagnostics of the plant yet", {}))
        return "" if values.get("enabled") == "True" else message

    def foreign_source(self, own: str) -> str:
        """The other source that the plant obeys now; empty when there is none."""
        source = self._rows.get(COMMAND_ROW, ("", {}))[1].get("source", "")
        return "" if source == own else source

    def disobedience(self, own: str) -> str:
        """Why the plant does not obey the source `own`; empty where it does, or has not said anything yet."""
        if PLANT_ROW in self._rows and self.disabled:
            return self.disabled
        source = self.foreign_source(own)
        return f"it obeys {source!r}" if source else ""

    @property
    def trouble(self) -> str:
        """What the plant complains about; empty when nothing.

        About commands it complains once (so many were late), hence the last such complaint since `forget` counts.
        """
        return "; ".join(self._complaints.values())

    def forget(self) -> None:
        """A run begins: earlier complaints are none of its business."""
        self._complaints.clear()
