"""How fast a plant's physics is: what the integrator's step and the sampling interval have to follow."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from .effect import Effect, arguments
from .slots import SLOTS

STEP_TIMES_RATE = 0.6  # how much of the fastest stated rate one step may cover; RK4 is stable up to 2.7
STEP_TIMES_LANDS = 1.2  # and of the rate of the oil through the lands, which damps and is looked at in every step


def fastest(effects: Iterable[Effect], values: Mapping[str, float], kind: str) -> float:
    """The fastest rate [1/s] that the effects state for parameter ``values`` (by key), and that of the oil."""
    return max(by_cause(effects, values, kind).values(), default=0.0)


def by_cause(effects: Iterable[Effect], values: Mapping[str, float], kind: str) -> dict[str, float]:
    """The rate [1/s] that each effect states, by its name, and that of the ``oil`` of a hydraulic plant.

    A fit may try values beyond the bounds: the root of a negative stiffness is a rate of growth.
    """
    found, effects = {"oil": oil(values)} if kind == "hydraulic" else {}, list(effects)
    values = {**values, **bristles(effects, values)}
    for effect in effects:
        if effect.step_rate is not None:
            found[effect.name] = abs(effect.step_rate({**values, **_own(effect, values)}))
    return found


def bristles(effects: Iterable[Effect], values: Mapping[str, float]) -> dict[str, float]:
    """Length [m] and time [s] of the bristles of dry friction, as the effects leave them (`slots.SLOTS`)."""
    known = {name: values[name] for name in SLOTS["bristle"].returns}
    for e in effects:
        if e.slot == "bristle":
            given = {**known, **{p.name: values[f"{e.name}.{p.name}"] for p in e.parameters}}
            known.update(zip(known, e.kernel(*(given[a] for a in arguments(e.kernel))), strict=True))
    return known


def step(rate: float, longest: float, refinement: float = 1.0) -> float:
    """The longest step [s] that follows a rate [1/s]; ``refinement`` times as long as it would be."""
    return min(longest, refinement * STEP_TIMES_RATE / rate) if rate > 0.0 else longest


def shortest_sampling(effects: Iterable[Effect], values: Mapping[str, float]) -> float:
    """The shortest sampling interval [s] at which every effect's memory reaches as far back as it must."""
    return max((float(e.reach(_own(e, values))) / (e.memory - 3) for e in effects if e.reach is not None), default=0.0)


def oil(p: Mapping[str, float]) -> float:
    """The hydraulic natural frequency [rad/s] with the piston at the stop where it is higher."""
    return max(oil_at(p, -0.5 * p["stroke"]), oil_at(p, 0.5 * p["stroke"]))


def oil_at(p: Mapping[str, float], position: float) -> float:
    """The hydraulic natural frequency [rad/s] with the piston at a ``position`` [m] from mid stroke.

    ω² = β·(A_A²/V_A + A_B²/V_B)/M, Merritt (1967), Hydraulic Control Systems, ch. 6.
    """
    a, b, stroke = p["piston_area_a"], p["piston_area_b"], p["stroke"]
    stiffness = a**2 / (p["dead_volume_a"] + a * (0.5 * stroke + position))
    stiffness += b**2 / (p["dead_volume_b"] + b * (0.5 * stroke - position))
    return math.sqrt(abs(p["bulk_modulus"] * stiffness / p["moving_mass"]))


def _own(effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
    return {p.name: values[f"{effect.name}.{p.name}"] for p in effect.parameters}
