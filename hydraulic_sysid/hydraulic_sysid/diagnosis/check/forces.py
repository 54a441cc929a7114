"""Areas, load and mass, from the force that the pressures show.

In steady motion p_A·A_A − p_B·A_B is friction and load, a small part of what the supply can push. Areas or transducers
in each other's place leave a large force instead. Accelerations beyond that show the mass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import number, percent, quantity

from .finding import CONTRADICTION, DOUBTFUL, Finding, excess
from .observed import FEWEST, Observed, Windows
from .pressures import supply_and_ratio
from .senses import SURE, correlation

_LARGE = 0.1  # of what the supply can push: friction and a load that the model does not know of stay below
_BETTER = 1.0 / 3.0  # of that force is left with other areas, for these to be the reason
_NOTHING = (np.empty(0), np.empty(0))
_MOST = 400  # windows in which the model's own friction and load are asked for


def areas(windows: Windows, plant: Plant) -> list[Finding]:
    """Areas that leave a large force in steady motion, and those that do not."""
    if len(windows) < FEWEST:
        return []
    windows = windows.some(_MOST)
    a, b = plant.value("piston_area_a"), plant.value("piston_area_b")
    own = friction_and_load(windows, plant)
    able = plant.value("supply_pressure") * max(a, b)

    def left(area_a: float, area_b: float) -> float:
        return float(np.sqrt(np.mean((area_a * windows.pressure_a - area_b * windows.pressure_b + own) ** 2)))

    now = left(a, b)
    if now <= _LARGE * able:
        return []
    text = f"In steady motion the pressures leave a force of {quantity(now, 'N')} that the model does not have"
    swapped = {"areas": left(b, a), "pressures": left(-b, -a)}
    which = min(swapped, key=swapped.__getitem__)
    if swapped[which] < _BETTER * now:
        text += f", and {quantity(swapped[which], 'N')} with the {which} in each other's place."
        remedy = "Swap piston_area_a and piston_area_b, or else the columns of pressure_a and pressure_b."
        return [Finding("areas", "piston_area_a", CONTRADICTION, text, remedy, b, a, "m^2")]
    both = supply_and_ratio(windows, plant)
    if both is not None and left(a, a / both[1]) < _BETTER * now:
        text += f", and {quantity(left(a, a / both[1]), 'N')} with an area ratio A/B of {number(both[1])}."
        return [Finding("areas", "piston_area_b", CONTRADICTION, text, "Correct the areas.", a / both[1], b, "m^2")]
    remedy = "Look for a load that the model does not have (constant_load), an area or a transducer that is off."
    return [Finding("load", "constant_load", DOUBTFUL, f"{text}.", remedy, now, None, "N")]


def friction_and_load(windows: Windows, plant: Plant) -> Array:
    """The model's force besides the pressures (W,) [N] in steady motion, between its stops."""
    found, end = [], 0.5 * plant.value("stroke")
    for x, v, p_a, p_b, opening in zip(
        windows.position, windows.velocity, windows.pressure_a, windows.pressure_b, windows.opening, strict=True
    ):
        drive = float(opening) * plant.value("drive_limit")
        state = plant.initial_state(min(max(float(x), -end), end), float(v), float(p_a), float(p_b), drive).states
        state[plant.layout.states["stick"]] = np.sign(v)
        found.append(plant.derivative(state, drive)[1]["force"])
    return np.array(found)


def mass(records: Sequence[Observed]) -> list[Finding]:
    """The moving mass as the record shows it in which force and acceleration correlate best."""
    shown = [(correlation(*left), seen, left) for seen in records if (left := seen.inertia(seen.force)) is not None]
    together, seen, (force, acceleration) = max(shown, key=lambda one: one[0], default=(0.0, records[0], _NOTHING))
    if together < SURE:
        return []
    # Noise of the acceleration makes force over acceleration too small, friction that is not in the regression its
    # inverse: the mass lies between the two.
    least = float(force @ acceleration / (acceleration @ acceleration))
    most, measured, stated = least / together**2, least / together, seen.plant.value("moving_mass")
    if least <= stated <= most or min(excess(seen.plant.model, "moving_mass", m) for m in (least, most)) <= 1.0:
        return []
    text = (
        f"Force over acceleration is {number(measured)} kg in {seen.record.name}, "
        f"{percent(measured / stated - 1.0)} off the model's {number(stated)} kg."
    )
    remedy = "Correct moving_mass (or the areas), or look for a load that swings along."
    return [Finding("mass", "moving_mass", DOUBTFUL, text, remedy, measured, stated, "kg", seen.named)]
