"""What the live view shows: one column per quantity of the contract's streams, on the time of `state`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hydraulic_sysid.data.display import TITLES, shown

STATE = "state"
PISTON, VALVE = 0, 1
"""Places of the two joints in `state`."""


@dataclass(frozen=True)
class Column:
    """One quantity: its key, topic, field of the message and place in it, unit, and the axis that it belongs on."""

    key: str
    topic: str
    field: str
    place: int | None
    unit: str
    group: str
    title: str = ""

    def document(self) -> dict[str, Any]:
        """What the page is told of it."""
        factor, unit = shown(self.unit)
        title = self.title or TITLES.get(self.key, self.key.replace("_", " "))
        display = {"factor": factor, "unit": unit}
        return {"key": self.key, "topic": self.topic, "title": title, "unit": self.unit,
                "display": display, "group": self.group}  # fmt: skip


COLUMNS = (
    Column("position", STATE, "position", PISTON, "m", "position"),
    Column("velocity", STATE, "velocity", PISTON, "m/s", "velocity"),
    Column("force", STATE, "effort", PISTON, "N", "force"),
    Column("drive", STATE, "effort", VALVE, "V", "voltage"),
    Column("spool", STATE, "position", VALVE, "m", "spool"),
    Column("pressure_a", "pressure_a", "fluid_pressure", None, "Pa", "pressure"),
    Column("pressure_b", "pressure_b", "fluid_pressure", None, "Pa", "pressure"),
    Column("pressure_supply", "pressure_supply", "fluid_pressure", None, "Pa", "pressure"),
    Column("command", "command", "effort", 0, "V", "voltage"),
    Column("reference", "reference", "position", PISTON, "m", "position"),
    Column("reference_velocity", "reference", "velocity", PISTON, "m/s", "velocity"),
    Column("predicted_position", "predicted_state", "position", PISTON, "m", "position"),
    Column("predicted_velocity", "predicted_state", "velocity", PISTON, "m/s", "velocity"),
    Column("predicted_force", "predicted_state", "effort", PISTON, "N", "force"),
    Column("residual_position", "residual", "position", PISTON, "m", "residual_position", "residual of position"),
    Column("residual_velocity", "residual", "velocity", PISTON, "m/s", "residual_velocity", "residual of velocity"),
    Column("residual_force", "residual", "effort", PISTON, "N", "residual_force", "residual of force"),
)
"""In the order in which the page gets them."""

PATIENCE_S = 0.2
"""How long a row of the state waits for the other topics of its instant before it is shown without them."""


def streams() -> dict[str, tuple[int, ...]]:
    """Topics of the columns, the state first, with the columns of each."""
    topics = dict.fromkeys(column.topic for column in COLUMNS)
    return {topic: tuple(i for i, c in enumerate(COLUMNS) if c.topic == topic) for topic in topics}
