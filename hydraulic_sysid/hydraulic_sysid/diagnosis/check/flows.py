"""The valve's flow from steady speeds: what the piston swallows over what the land that empties it lets through.

    A·v = K·o·√Δp,   K = valve_flow/√valve_drop

with the measured pressure of the chamber that is emptied (of the one that is filled where only that is measured), or
with the model's own steady speed where no pressure is. The opening is the model's, its dead band and limits included.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.linear import operating_point
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import number, percent, quantity
from hydraulic_sysid.diagnosis.locate.balances import root

from .finding import DOUBTFUL, Finding, by_bounds
from .observed import FEWEST, Windows
from .pressures import wide

_DROP = 0.02  # of the supply: over a smaller drop the transducers' offsets decide
_MOST = 400  # windows in which the model's opening is asked for
_LEVELS = 4  # openings at which the model's steady speed is computed
_APART = 0.15  # that both directions may differ by: asymmetry of a valve, bias and load
_RANGE = 1.5  # largest over smallest opening from which the slope over the opening is known
_LAP = 0.05  # of full opening: overlap and underlap of servo valves stay below
_UNIT = 8.0  # times too much or too little, from which a unit is the likeliest cause


@dataclass(frozen=True)
class Gain:
    """A flow gain over the model's, from ``low`` to ``high``: as slope, and as ratio with an unknown lap."""

    low: float
    high: float

    def nearest(self, value: float = 1.0) -> float:
        """The one that is nearest to a value."""
        return min(max(value, self.low), self.high)


def valve_flow(windows: Windows, plant: Plant) -> list[Finding]:
    """The valve's flow that both directions ask for, and whether they ask for the same."""
    gains = [g for g in (gain(windows.going(d), plant, d) for d in (1, -1)) if g is not None]
    if not gains:
        return []
    found = _size(gains, plant)
    if len(gains) == 2 and not found:
        found = _directions(gains)
    return found


def gain(windows: Windows, plant: Plant, direction: int) -> Gain | None:
    """The gain in one direction; None for too little steady motion."""
    filled, emptied = ("a", "b") if direction > 0 else ("b", "a")
    tank, supply = plant.value("tank_pressure"), plant.value("supply_pressure")
    least, small = _DROP * supply, plant.value("orifice_transition")
    known = np.isfinite(windows.pressure_supply)
    land = plant.value("valve_flow") / math.sqrt(plant.value("valve_drop"))
    for side, drop in (
        (emptied, getattr(windows, f"pressure_{emptied}") - tank),
        (filled, np.where(known, windows.pressure_supply, supply) - getattr(windows, f"pressure_{filled}")),
    ):
        if np.sum(drop > least) >= FEWEST:
            used = np.flatnonzero(drop > least)
            used = used[:: -(-used.size // _MOST)]
            chosen = windows.subset(used)
            swallowed = plant.value(f"piston_area_{side}") * np.abs(chosen.velocity)
            return _gain(np.abs(openings(chosen, plant)), swallowed / (land * root(drop[used], small)))
    if np.isfinite(windows.pressure_a).any() or np.isfinite(windows.pressure_b).any() or len(windows) < FEWEST:
        return None
    return _without_pressures(wide(windows), plant)


def openings(windows: Windows, plant: Plant) -> Array:
    """The model's effective opening (W,) for the drive of each window, its spool settled."""
    found = []
    for x, v, opening in zip(windows.position, windows.velocity, windows.opening, strict=True):
        drive = float(opening) * plant.value("drive_limit")
        state = plant.initial_state(float(x), float(v), drive=drive).states
        found.append(plant.derivative(state, drive)[1]["opening"])
    return np.array(found)


def _gain(opening: Array, needed: Array) -> Gain | None:
    """From the openings that the model has and those that the motion needed, (W,) each."""
    large = opening >= 0.5 * np.quantile(opening, 0.95)
    large &= opening > 0.0
    if large.sum() < FEWEST:
        return None
    # Overlap or underlap that the model does not know of makes the opening another.
    found = [float(np.median(needed[large] / np.maximum(opening[large] + lap, 1e-3))) for lap in (_LAP, -_LAP)]
    low, high = np.quantile(opening, [0.1, 0.9]).tolist()
    if high > _RANGE * low:
        found.append(float(np.polyfit(opening, needed, 1)[0]))
    return Gain(min(found), max(found))


def _without_pressures(windows: Windows, plant: Plant) -> Gain | None:
    """Against the model's own steady speeds."""
    openings = np.quantile(windows.opening, np.linspace(0.05, 0.95, _LEVELS))
    try:
        points = [operating_point(plant.model, drive=float(o) * plant.value("drive_limit")) for o in openings]
    except SimulationError:
        return None
    speeds = np.interp(windows.opening, openings, [p.velocity for p in points])
    return _gain(np.abs(speeds), np.abs(windows.velocity))


def _size(gains: Sequence[Gain], plant: Plant) -> list[Finding]:
    together = math.exp(np.mean([math.log(max(g.nearest(), 1e-12)) for g in gains]))
    stated, model = plant.value("valve_flow"), plant.model
    severity = by_bounds(model, "valve_flow", together * stated)
    if severity is None:
        return []
    measured = together * stated
    text = (
        f"The steady speeds ask for a valve flow of {quantity(measured, 'm^3/s')} at its rated drop, "
        f"{number(together)} times the model's {quantity(stated, 'm^3/s')}{_bounds(model)}."
    )
    remedy = "Correct valve_flow, valve_drop or both areas: the speeds know their ratio only."
    if not 1.0 / _UNIT < together < _UNIT:
        remedy = "Look at the units of position and drive first (mm, per cent of the opening), then at valve_flow."
    return [Finding("valve_flow", "valve_flow", severity, text, remedy, measured, stated, "m^3/s")]


def _directions(gains: Sequence[Gain]) -> list[Finding]:
    out, back = gains
    ratio = max(out.low / back.high, back.low / out.high)
    if ratio <= 1.0 + _APART:
        return []
    faster = "Extending" if out.low > back.high else "Retracting"
    text = f"{faster} is {percent(ratio - 1.0)} faster against the model than the other way."
    remedy = "Look at the areas, a load or the valve: valve_gain_asymmetry, valve_null_bias."
    return [Finding("directions", "piston_area_b", DOUBTFUL, text, remedy, ratio, 1.0)]


def _bounds(model: Model) -> str:
    entry = model.entries.get("valve_flow")
    if entry is None or entry.bounds is None:
        return ""
    return f" (bounds {quantity(entry.bounds[0], 'm^3/s')} to {quantity(entry.bounds[1], 'm^3/s')})"
