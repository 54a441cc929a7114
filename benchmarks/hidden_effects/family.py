"""A family of benches: any geometry, sensors, loop and data sheet, with nothing, one effect, a wrong number or a fault
of the recording hidden, or, when asked for, two or three effects or one that the library lacks. Every member follows
from the draw's seed and its own number, whatever else is drawn."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from . import catalogue, motion, settings
from . import sensors as instruments
from .benches import SEVERITIES, Bench
from .geometry import GEOMETRIES, Geometry
from .scoring import TOGETHER

WHAT = {"none": 0.3, "effect": 0.4, "datum": 0.15, "recording": 0.15,
        "pair": 0.0, "triple": 0.0, "unknown": 0.0}  # fmt: skip
"""What is hidden, and how often; what has 0 is drawn only when asked for."""
KINDS = {what: what for what in WHAT} | {"effect": "single"}
AMBIGUOUS = ("sensor_scale",)  # areas within their tolerance, and masses, say the same
APART = 100_000  # between the benches' seeds of two draws


def draw(count: int, seeds: Iterable[int], what: str | None = None) -> list[Bench]:
    """``count`` benches of each of these seeds; ``what``: of `WHAT`, that all of them hide."""
    return [member(seed, number, what) for seed in seeds for number in range(count)]


def member(seed: int, number: int, what: str | None = None) -> Bench:
    """One bench of the draw ``seed``."""
    rng = np.random.default_rng((seed, number, *([] if what is None else [1 + list(WHAT).index(what)])))
    geometry = GEOMETRIES[str(rng.choice(list(GEOMETRIES)))]
    sensors = str(rng.choice(list(instruments.KINDS)))
    setting = settings.Setting(geometry.name, sensors, str(rng.choice(motion.LOOPS)), str(rng.choice(settings.SHEETS)))
    what = what or str(rng.choice(list(WHAT), p=list(WHAT.values())))
    kind, seed = KINDS[what], seed * APART + number
    if kind == "none":
        return Bench(kind, seed=seed, setting=setting)
    severity = str(rng.choice(SEVERITIES))
    return Bench(kind, _hidden(rng, geometry, kind, severity), severity, seed, setting)


def _hidden(rng: np.random.Generator, geometry: Geometry, kind: str, severity: str) -> tuple[str, ...]:
    """What a bench hides; effects that are hidden together are each of another subsystem."""
    if kind not in TOGETHER:
        return (str(rng.choice(possible(geometry, kind, severity))),)
    chosen: dict[str, str] = {}
    for name in rng.permutation(possible(geometry, "single", severity)).tolist():
        chosen.setdefault(catalogue.LIBRARY[name].subsystems[0], name)
    return tuple(chosen.values())[: TOGETHER[kind]]


def possible(geometry: Geometry, kind: str, severity: str) -> list[str]:
    """What of a kind can be hidden in a geometry, since its records would show it."""
    hidden = {*AMBIGUOUS, *geometry.never, *(geometry.faint if severity == "mild" else ())}
    return [name for name in catalogue.KINDS[kind] if name not in hidden]
