"""How large what an effect brings typically is on a given plant.

The library's defaults are those of a bench of 500 kg that 15 kN move. On a mechanical plant forces are as much smaller
as its full force is, and masses as its moving mass: 450 N of dry friction mean nothing to a servo of 1 N·m.
"""

from __future__ import annotations

from dataclasses import replace

from .effect import Effect, Parameter
from .model import Model

FORCE, MASS = 15e3, 500.0  # N, kg: the bench whose defaults the library has


def typical(model: Model, parameter: Parameter) -> float:
    """The library's default of a parameter [SI], in the size of the model's plant."""
    if model.kind != "mechanical":
        return parameter.default
    if parameter.unit.startswith("N"):
        share = abs(model.value("drive_force") * model.value("drive_limit")) / FORCE
    elif parameter.unit == "kg":
        share = model.value("moving_mass") / MASS
    else:
        return parameter.default
    low, high = parameter.bounds
    return min(max(share * parameter.default, low), high) if 0.0 < share < 1.0 else parameter.default


def sized(model: Model, effect: Effect) -> Effect:
    """The effect with defaults in the size of the model's plant."""
    return replace(effect, parameters=tuple(replace(p, default=typical(model, p)) for p in effect.parameters))
