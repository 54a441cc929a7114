"""What the plant says about itself on `/diagnostics`, as far as a source of commands must know."""

from __future__ import annotations

from collections.abc import Mapping

from hydraulic_interfaces.contract import NAMESPACE, PLANT_NODE, absolute


class PlantReport:
    """The latest of two rows of the plant of a namespace: is it enabled, whom does it obey, what are its complaints."""

    def __init__(self, namespace: str = NAMESPACE) -> None:
        plant = absolute(PLANT_NODE, namespace)
        self._plant_row, self._command_row = f"{plant}: plant", f"{plant}: command"
        self._rows: dict[str, tuple[str, dict[str, str]]] = {}
        self._complaints: dict[str, str] = {}

    def update(self, name: str, ok: bool, message: str, values: Mapping[str, str]) -> bool:
        """Take a row of the diagnostics; False for one of another node, or of another plant, which is passed over."""
        if name not in (self._plant_row, self._command_row):
            return False
        self._rows[name] = (message, dict(values))
        if not ok:
            self._complaints[name] = message
        elif name == self._plant_row:
            self._complaints.pop(name, None)
        return True

    @property
    def disabled(self) -> str:
        """Why the plant moves for nobody, in its own words; empty when it is enabled."""
        message, values = self._rows.get(self._plant_row, ("no diagnostics of the plant yet", {}))
        return "" if values.get("enabled") == "True" else message

    def foreign_source(self, own: str) -> str:
        """The other source that the plant obeys now; empty when there is none."""
        source = self._rows.get(self._command_row, ("", {}))[1].get("source", "")
        return "" if source == own else source

    def disobedience(self, own: str) -> str:
        """Why the plant does not obey the source `own`; empty where it does, or has not said anything yet."""
        if self._plant_row in self._rows and self.disabled:
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
