"""Units that look wrong by a factor: millimetres read as metres, bar as pascal, per cent as volts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from hydraulic_sysid.data.display import number, quantity

from .finding import CONTRADICTION, Finding
from .observed import Observed

# What a number may have been, and by how much it is then too large (in SI) when it was read as something else.
POSITION = {"mm read as m": 1e3, "cm read as m": 1e2, "inches read as m": 39.37, "µm read as m": 1e6}
PRESSURE = {
    "bar read as Pa": 1e-5,
    "MPa read as Pa": 1e-6,
    "kPa read as Pa": 1e-3,
    "psi read as Pa": 1.45e-4,
    "MPa read as bar": 0.1,
    "psi read as bar": 14.5,
    "bar read as MPa": 10.0,
    "Pa read as kPa": 1e3,
    "Pa read as bar": 1e5,
}
DRIVE = {"% read as V": 10.0, "mV read as V": 1e3}

_LARGE_TRAVEL = 10.0  # strokes: no end stop lets a piston pass, no zero is that far off
_LARGE_DRIVE = 5.0  # limits: an amplifier clips its input, and a logger before it sees a few times that at most
_PRESSURES = (0.1, 4.0)  # of the supply: half of it stands in both chambers at rest, and no shock is beyond the other
_USUAL = {"position": 0.3, "pressure": 0.7, "drive": 0.7}  # of stroke, supply and limit: what the largest value is near


def wrong_units(records: Sequence[Observed]) -> list[Finding]:
    """Channels whose size, over all records, cannot be."""
    plant, found = records[0].plant, []
    ends = [(float(s.signals["position"].min()), float(s.signals["position"].max())) for s in records]
    travel = max(high for _, high in ends) - min(low for low, _ in ends)
    if travel > _LARGE_TRAVEL * plant.value("stroke"):
        found.append(_finding(records, "position", travel, "stroke", POSITION))
    for channel in ("pressure_a", "pressure_b", "pressure_supply"):
        largest = _largest(records, channel)
        if largest > 0.0 and not _PRESSURES[0] < largest / plant.value("supply_pressure") < _PRESSURES[1]:
            found.append(_finding(records, channel, largest, "supply_pressure", PRESSURE))
    drive = _largest(records, "drive")
    if drive > _LARGE_DRIVE * plant.value("drive_limit"):
        found.append(_finding(records, "drive", drive, "drive_limit", DRIVE))
    return found


def _largest(records: Sequence[Observed], channel: str) -> float:
    return max((float(abs(s.signals[channel]).max()) for s in records if channel in s.signals), default=0.0)


def _finding(
    records: Sequence[Observed], channel: str, measured: float, key: str, units: Mapping[str, float]
) -> Finding:
    stated, kind = records[0].plant.value(key), channel.partition("_")[0]
    unit = records[0].plant.model.parameter(key).unit
    what = "its travel is" if channel == "position" else "it reaches"
    factor = measured / stated
    return Finding(
        "unit",
        channel,
        CONTRADICTION,
        f"{channel}: {what} {quantity(measured, unit)}, {number(factor)} times {key} ({quantity(stated, unit)}).",
        f"Look at the unit of the column: it looks like {likely(factor / _USUAL[kind], units)}.",
        measured,
        stated,
        unit,
        tuple(s.record.name for s in records if channel in s.signals),
    )


def likely(factor: float, units: Mapping[str, float]) -> str:
    """The confusion of units that comes nearest to a factor."""
    return min(units, key=lambda name: abs(math.log(factor / units[name])))
