"""What of the library may be missing from a model, and where to look for it first.

Everything follows from the effects' own records: the parameters that have a null value are what an effect brings,
the others its shape, which is tried at a few values around the library's default.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from hydraulic_sim import slots
from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.errors import ModelError
from hydraulic_sim.model import Model
from hydraulic_sim.typical import sized

SHAPES = (1.0, 0.3, 3.0, 8.0)  # of the default
SIZES = (1.0, 0.25)  # of the default, measured from the null value
LARGE = (2.0, 4.0, 10.0)  # where those change nothing, …
SMALL = (0.1, 0.02)  # … and where the plant is too small for them
MOST_SHAPES = 7
FREQUENCIES = (1.0, 0.5, 0.25, 0.125, 2.0, 4.0)  # of the default at which a resonance is looked for, …
WIDE = 8.0  # … so many times as much damped: that of a light damping shows at its own frequency alone
ANGLE = "rad"
WITHIN = 0.4  # of the stroke: lengths that are tried are no longer
BLURS = (0.0, 0.06, 0.12, 0.2, 0.3)  # of a resolution: noise before readings are rounded to it
QUARTERS = tuple(0.5 * math.pi * i for i in range(4))  # angles that are tried


@dataclass(frozen=True)
class Probe:
    """Parameter values of a candidate [SI, by key] at which its influence is looked at.

    ``moved`` is the parameter that has left its null value ``null``, or None for the bare shape.
    """

    values: dict[str, float]
    moved: str
    null: float


def candidates(model: Model) -> list[Effect]:
    """Library effects that are off and could act in this model, their defaults in the size of its plant."""
    found = []
    for effect in model.library.values():
        if effect.name in model.effects or effect.always_on or not effect.searched:
            continue
        try:
            model.with_effect(effect.name).check_complete()
        except ModelError:  # another law has the slot, or the plant has no such stage
            continue
        found.append(sized(model, effect))
    return found


def subsystem(effect: Effect) -> str:
    """The balance that shows the effect."""
    return slots.SLOTS[effect.slot].subsystem


@dataclass(frozen=True)
class RecordFeatures:
    """What is known by itself: spectral ``lines`` [Hz] of a residual, the position's ``resolution`` and ``stroke`` [m].

    Frequencies are tried at the lines too; a parameter that is ``observed`` is tried at what was seen, and stays.
    Lengths are tried within the stroke: beyond, a law may not change with them.
    """

    lines: tuple[float, ...] = ()
    resolution: float = 0.0
    stroke: float = math.inf


def observed(effect: Effect) -> bool:
    """Whether the records show the effect's size by themselves."""
    return any(p.observed for p in effect.parameters)


def delays(effect: Effect, values: Callable[[str], float], interval: float) -> bool:
    """Whether an effect with these values [SI, by key] only makes something act later by less than a sampling interval.

    That is a time below it, a resonance beyond half the sampling rate, a full travel that takes no longer.
    """
    takes = {"s": lambda value: value, "Hz": lambda value: 0.5 / value, "1/s": lambda value: 1.0 / value}
    brought = [p for p in effect.parameters if p.null is not None and p.free]
    return bool(brought) and all(
        p.unit in takes and takes[p.unit](values(f"{effect.name}.{p.name}")) < interval for p in brought
    )


def probes(effect: Effect, features: RecordFeatures, sizes: Sequence[float] = SIZES) -> Iterator[list[Probe]]:
    """Groups of probes, one group per shape: each of its members moves one parameter off its null value.

    ``sizes``: how far, of the default; further ones than the first are for the default shape alone.
    """
    if observed(effect):
        yield from _as_seen(effect, features)
        return
    shape = [p for p in effect.parameters if p.null is None and p.unit != ANGLE]
    angles = [p for p in effect.parameters if p.null is None and p.unit == ANGLE]
    moved = [p for p in effect.parameters if p.null is not None and p.free]
    grids = [_grid(p, features) for p in shape]
    first = tuple(g[0] for g in grids)
    tried = [first] + [c for c in itertools.product(*grids) if c != first and _changes(c, first) == 1]
    tried = [*tried[: MOST_SHAPES + len(features.lines)], *_resonances(shape, grids)]
    # An angle says nothing without the right frequency, nor the other way round: all of one with all of the other.
    for values, turned in itertools.product(tried, itertools.product(QUARTERS, repeat=len(angles))):
        given = {f"{effect.name}.{p.name}": v for p, v in zip([*shape, *angles], [*values, *turned], strict=True)}
        for size in sizes if values == first else sizes[:1]:
            yield [_probe(effect, given, p, size) for p in moved]


def _as_seen(effect: Effect, features: RecordFeatures) -> Iterator[list[Probe]]:
    """What is observed, as the records show it; nothing where they do not, or nothing that the effect allows."""
    shown = [p for p in effect.parameters if p.observed]
    moved = next(p for p in shown if p.null is not None)
    seen = {"resolution": (features.resolution,), "blur": tuple(b * features.resolution for b in BLURS)}
    for values in itertools.product(*(seen[f"{p.observed}"] for p in shown)):
        given = {f"{effect.name}.{p.name}": v for p, v in zip(shown, values, strict=True)}
        within = all(p.bounds[0] <= v <= p.bounds[1] for p, v in zip(shown, values, strict=True))
        null, key = moved.null or 0.0, f"{effect.name}.{moved.name}"
        if within and given[key] != null:
            yield [Probe(given, key, null)]


def inverse(null: float, default: float) -> bool:
    """Whether a parameter acts by its inverse: its null value lies far above (a frequency, a rate)."""
    return null > 5.0 * abs(default) > 0.0


def between(null: float, value: float, share: float, default: float) -> float:
    """The value that acts ``share`` times as much as ``value`` [SI], counted from the null value."""
    if inverse(null, default):
        return min(value / share, null) if share > 0.0 else null
    return (1.0 - share) * null + share * value  # exactly the value at 1: it may be a bound


def _resonances(shape: Sequence[Parameter], grids: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """Shapes at whose frequency and damping a resonance is looked for, with all values of what else they have."""
    names = [p.name for p in shape]
    if "damping" not in names or not any(p.unit == "Hz" for p in shape):
        return []
    every = []
    for p, grid in zip(shape, grids, strict=True):
        times = FREQUENCIES if p.unit == "Hz" else (WIDE,) if p.name == "damping" else ()
        low, high = p.bounds
        every.append([min(max(t * p.default, low), high) for t in times] or grid)
    return list(itertools.product(*every))


def _changes(one: tuple[float, ...], other: tuple[float, ...]) -> int:
    return sum(a != b for a, b in zip(one, other, strict=True))


def _grid(p: Parameter, features: RecordFeatures) -> list[float]:
    low, high = p.bounds
    if not p.free:
        return [p.default]
    values = [p.default * f for f in SHAPES]
    if p.unit == "m":
        values = list(dict.fromkeys(min(v, WITHIN * features.stroke) for v in values))
    if p.unit == "Hz":
        values += list(features.lines)
    return [v for v in values if low <= v <= high] or [p.default]


def _probe(effect: Effect, shape: dict[str, float], p: Parameter, size: float) -> Probe:
    assert p.null is not None
    others = {f"{effect.name}.{q.name}": q.null for q in effect.parameters if q.null is not None and q.free}
    low, high = p.bounds
    step = p.default - p.null
    if step == 0.0:  # a second parameter of its kind, at null by default
        step = max(
            (q.default - q.null for q in effect.parameters if q.null is not None and q.unit == p.unit),
            key=abs,
            default=0.0,
        ) or 0.01 * (high - low)
    value = p.default / size if inverse(p.null, p.default) else p.null + size * step
    key = f"{effect.name}.{p.name}"
    return Probe({**shape, **others, key: min(max(value, low), high)}, key, p.null)
