"""How large what an effect brings typically is on a given plant.

The library's defaults are those of one bench. On another plant forces are as much larger or smaller as its full force
is, dry friction as its seals are round, lengths as its stroke, flows as that of its open valve: 450 N of dry friction
mean nothing to a servo of 1 N·m, and the leakage of a large valve drowns a cylinder of 5 cm³. What swings with the load
does so as much faster or slower as the oil does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from .effect import Effect, Parameter
from .model import Model

SERVO = {"force": 15e3, "friction": 15e3, "mass": 500.0}  # N, N, kg: of a mechanical plant with these defaults, …
BENCH = {
    "force": 110.5e3,  # N, supply over tank times area
    "friction": math.sqrt(8.0645e-3),  # m, root of the area: the circumference of seals grows with it
    "mass": 500.0,  # kg
    "length": 1.524,  # m, stroke
    "pressure": 13.7e6,  # Pa, supply over tank
    "flow": 2.5e-3 * math.sqrt(13.7e6 / 3.5e6),  # m³/s, of the open valve
    "speed": 2.5e-3 * math.sqrt(13.7e6 / 3.5e6) / 8.0645e-3,  # m/s, by it
    "compliance": 6.45e-3 / 1.5168e9,  # m³/Pa, of the oil on one side
    "swing": 8.0645e-3 * math.sqrt(2.0 * 1.5168e9 / (6.45e-3 * 500.0)),  # rad/s, of that mass on the oil at mid stroke
}  # … and of a hydraulic one
UNITS: dict[str, Mapping[str, float]] = {
    "N": {"friction": 1},
    "N/m": {"force": 1, "length": -1},
    "N/m^2": {"force": 1, "length": -2},
    "N*s/m": {"force": 1, "speed": -1},
    "N*s^2/m^2": {"force": 1, "speed": -2},
    "kg": {"mass": 1},
    "m": {"length": 1},
    "1/m^2": {"length": -2},
    "m/s": {"speed": 1},
    "Pa": {"pressure": 1},
    "Pa*s/m^3": {"pressure": 1, "flow": -1},
    "Pa*s^2/m^6": {"pressure": 1, "flow": -2},
    "m^3/(s*Pa)": {"flow": 1, "pressure": -1},
    "m^3/(s*Pa^0.5)": {"flow": 1, "pressure": -0.5},
    "m^3/Pa": {"compliance": 1},
}
"""What a parameter of a unit grows with. Times and shares are those of devices, whatever these move."""
OF_LOADS: dict[str, Mapping[str, float]] = {"Hz": {"swing": 1}}
"""The same of effects that act with a force on the piston."""


def typical(model: Model, parameter: Parameter, slot: str = "") -> float:
    """The library's default of a parameter [SI], in the size of the model's plant.

    One that is counted from another value than 0, as a bristle's length from the stiffest, is left as it is.

    :param slot: of the effect that has the parameter
    """
    if parameter.null:
        return parameter.default
    ratio, (low, high) = _ratio(model, parameter.unit, slot), parameter.bounds
    return min(max(ratio * parameter.default, low), high)


def sized(model: Model, effect: Effect) -> Effect:
    """The effect with defaults in the size of the model's plant."""
    defaults = [typical(model, p, effect.slot) for p in effect.parameters]
    parameters = zip(effect.parameters, defaults, strict=True)
    return replace(effect, parameters=tuple(replace(p, default=default) for p, default in parameters))


def _ratio(model: Model, unit: str, slot: str) -> float:
    """How much larger what has this unit is on the model's plant than on the bench of the defaults."""
    of, usual = _PLANTS[model.kind]
    found, made_of = of(model), UNITS | (OF_LOADS if slot == "force" else {})
    shares = [(found[q] / usual[q], power) for q, power in made_of.get(unit, {}).items() if q in found]
    return math.prod(share**power for share, power in shares if 0.0 < share < math.inf)


def _mechanical(model: Model) -> dict[str, float]:
    force = abs(model.value("drive_force") * model.value("drive_limit"))
    force = min(force, SERVO["force"])
    return {"force": force, "friction": force, "mass": min(model.value("moving_mass"), SERVO["mass"])}


def _hydraulic(model: Model) -> dict[str, float]:
    value = model.value
    pressure = value("supply_pressure") - value("tank_pressure")
    area = 0.5 * (value("piston_area_a") + value("piston_area_b"))
    volume = 0.5 * (value("dead_volume_a") + value("dead_volume_b") + area * value("stroke"))
    flow = value("valve_flow") * math.sqrt(max(pressure, 0.0) / value("valve_drop"))
    return {
        "force": pressure * area,
        "friction": math.sqrt(area),
        "mass": value("moving_mass"),
        "length": value("stroke"),
        "pressure": pressure,
        "flow": flow,
        "speed": flow / area,
        "compliance": volume / value("bulk_modulus"),
        "swing": area * math.sqrt(2.0 * value("bulk_modulus") / (volume * value("moving_mass"))),
    }


_PLANTS: dict[str, tuple[Callable[[Model], dict[str, float]], dict[str, float]]] = {
    "mechanical": (_mechanical, SERVO),
    "hydraulic": (_hydraulic, BENCH),
}
