"""Pressures against supply and tank, and supply and area ratio as the pressures of steady motion show them.

In steady motion the same flow passes both lands, less the ratio of the areas, so that with R = (A_A/A_B)²

    p_S = p_A + R·(p_B − p_T)   extending,        p_S = p_B + (p_A − p_T)/R   retracting

for lands of equal size (Merritt 1967, Hydraulic Control Systems, ch. 5 and 6). Neither the valve's flow nor the drive,
the position or the friction enters; both directions together give R as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import number, percent, quantity

from .finding import CONTRADICTION, DOUBTFUL, Finding, by_share
from .observed import FEWEST, Observed, Windows

VACUUM = -1e5  # Pa against the atmosphere: no pressure lies below
_TIMES_NOISE = 6.0  # standard deviations by which a pressure must stand out
_GAUGE = 0.02  # of the supply: what transducers and gauges are off at most
_OFTEN = 0.01  # share of samples: shocks of a moving mass take a chamber beyond supply and tank for a moment
GAUGE_CLASS = 0.025  # of the supply, from which a steady pressure is doubtful: a gauge of class 1.6, and as much else
_OTHER = 0.2  # of the supply: droop, back pressure and transducers together stay below
_RATIO = 0.05  # of the area ratio, from which it is doubtful: drawings and pairs of equal lands are nearer
_EMPTY = 0.05  # of the supply: what a chamber that nothing flows out of may be above the tank
_OPEN = 0.2  # of full opening, beyond any overlap
_WIDE = 0.5  # of the largest openings of all steady motion: at smaller ones leakage and overlap share the flow


def beyond_supply(seen: Observed) -> list[Finding]:
    """A chamber above supply: impossible while it is filled from there, else a shock or a load."""
    supply, found = seen.plant.value("supply_pressure"), []
    for name, margin, filled in _chambers(seen, filled=True):
        often = float(np.mean(seen.signals[name] - seen.signals.get("pressure_supply", supply) > margin))
        source = np.where(np.isfinite(filled.pressure_supply), filled.pressure_supply, supply)
        against = getattr(filled, name) > source + margin
        severity = CONTRADICTION if against.sum() >= FEWEST else DOUBTFUL
        if often > _OFTEN:
            largest = float(np.quantile(seen.signals[name], 1.0 - 0.5 * _OFTEN))
            text = f"{name} is above the supply ({quantity(supply, 'Pa')}) for {percent(often)} of the time"
            text += ", even while oil flows in from there." if severity == CONTRADICTION else "."
            remedy = "Correct supply_pressure, or the transducer's scale."
            found.append(Finding("above_supply", name, severity, text, remedy, largest, supply, "Pa", seen.named))
    return found


def below_tank(seen: Observed) -> list[Finding]:
    """A chamber below the tank: impossible while it is emptied there, else cavitation of a moment."""
    tank, found = seen.plant.value("tank_pressure"), []
    for name, margin, emptied in _chambers(seen, filled=False):
        often = float(np.mean(seen.signals[name] < tank - margin))
        against = getattr(emptied, name) < tank - margin
        severity = CONTRADICTION if against.sum() >= FEWEST else DOUBTFUL
        if often > _OFTEN:
            least = float(np.quantile(seen.signals[name], 0.5 * _OFTEN))
            text = f"{name} is below the tank ({quantity(tank, 'Pa')}) for {percent(often)} of the time"
            text += ", even while oil flows out to there." if severity == CONTRADICTION else "."
            remedy = "Correct tank_pressure, or the transducer's offset; cavitation lasts a moment only."
            found.append(Finding("below_tank", name, severity, text, remedy, least, tank, "Pa", seen.named))
    return found


def below_vacuum(seen: Observed) -> list[Finding]:
    """A pressure that no liquid or gas has."""
    found = []
    for name in ("pressure_a", "pressure_b", "pressure_supply"):
        if name in seen.signals and np.mean(seen.signals[name] < VACUUM - _margin(seen, name)) > _OFTEN:
            least = float(np.quantile(seen.signals[name], 0.5 * _OFTEN))
            text = f"{name} goes down to {quantity(least, 'Pa')}, below vacuum."
            remedy = "Correct the sign or the offset of the transducer (column map: sign, offset)."
            found.append(Finding("vacuum", name, CONTRADICTION, text, remedy, least, VACUUM, "Pa", seen.named))
    return found


def measured_supply(seen: Observed) -> list[Finding]:
    """A measured supply pressure that is another than the file's."""
    if "pressure_supply" not in seen.signals:
        return []
    return _other_supply(seen.plant, float(np.median(seen.signals["pressure_supply"])), "as measured", seen.named)


def supply_and_ratio(windows: Windows, plant: Plant) -> tuple[float, float] | None:
    """Supply pressure [Pa] and area ratio A_A/A_B that steady motion shows; None where it is not in both directions."""
    tank = plant.value("tank_pressure")
    groups = [wide(windows.going(direction)) for direction in (1, -1)]
    if any(len(w) < FEWEST for w in groups):
        return None
    out, back = groups
    a1, b1 = float(np.median(out.pressure_a)), float(np.median(out.pressure_b - tank))
    a2, b2 = float(np.median(back.pressure_b)), float(np.median(back.pressure_a - tank))
    if not (b1 > 0.0 and b2 > 0.0):
        return None
    squared = (a2 - a1 + math.sqrt((a1 - a2) ** 2 + 4.0 * b1 * b2)) / (2.0 * b1)
    return a1 + squared * b1, math.sqrt(squared)


def steady_supply(windows: Windows, plant: Plant) -> list[Finding]:
    """The supply that the pressures of steady motion ask for."""
    both = supply_and_ratio(windows, plant)
    return _other_supply(plant, both[0], "as the chambers' pressures in steady motion say") if both else []


def blocked_supply(windows: Windows, plant: Plant) -> list[Finding]:
    """At a stop with the valve open one chamber stands at supply pressure."""
    still = windows.resting
    still = still.subset(np.abs(still.opening) > _OPEN)
    filled = np.where(still.opening > 0.0, still.pressure_a, still.pressure_b)
    emptied = np.where(still.opening > 0.0, still.pressure_b, still.pressure_a)
    # The other one is then empty; else the piston moves, and its sensor does not show it.
    filled = filled[emptied < plant.value("tank_pressure") + _EMPTY * plant.value("supply_pressure")]
    if len(filled) < FEWEST:
        return []
    return _other_supply(plant, float(np.median(filled)), "as the chamber that is open to it says at rest")


def steady_ratio(windows: Windows, plant: Plant) -> list[Finding]:
    """The area ratio that the pressures of steady motion ask for."""
    both = supply_and_ratio(windows, plant)
    if both is None:
        return []
    stated = plant.value("piston_area_a") / plant.value("piston_area_b")
    off = both[1] / stated - 1.0
    if abs(off) <= _RATIO:
        return []
    return [
        Finding(
            "area_ratio", "piston_area_b", DOUBTFUL,
            f"In steady motion the pressures ask for an area ratio A/B of {number(both[1])}, {percent(off)} off the "
            f"model's {number(stated)}.",
            "Correct piston_area_a or piston_area_b; lands of unequal size look alike.", both[1], stated, "1",
        )
    ]  # fmt: skip


def wide(windows: Windows) -> Windows:
    """Those with the larger openings, at which the lands decide alone."""
    if not len(windows):
        return windows
    size = np.abs(windows.opening)
    return windows.subset(size >= _WIDE * np.quantile(size, 0.95))


def _other_supply(plant: Plant, measured: float, how: str, records: tuple[str, ...] = ()) -> list[Finding]:
    stated = plant.value("supply_pressure")
    severity = by_share(measured / stated - 1.0, GAUGE_CLASS, _OTHER)
    if severity is None:
        return []
    text = f"The supply pressure is {quantity(measured, 'Pa')} {how}; the model has {quantity(stated, 'Pa')}."
    remedy = "Correct supply_pressure, or let it be measured; an accumulator or a weak pump makes it droop."
    return [Finding("supply", "supply_pressure", severity, text, remedy, measured, stated, "Pa", records)]


def _chambers(seen: Observed, filled: bool) -> Iterator[tuple[str, float, Windows]]:
    """Measured pressures, their margins [Pa] and steady motion in which that chamber is ``filled``, else emptied."""
    for name, extending in (("pressure_a", 1), ("pressure_b", -1)):
        if name in seen.signals:
            yield name, _margin(seen, name), seen.windows.flowing.going(extending if filled else -extending)


def _margin(seen: Observed, name: str) -> float:
    """What transducer, gauge and noise may be off [Pa]."""
    return _GAUGE * seen.plant.value("supply_pressure") + _TIMES_NOISE * seen.noise[name]
