"""The movements that an experiment may be made of, each a few numbers that say how large and how fast.

What separates physical effects is known movement by movement: slow passages through null for dead band and friction,
standing for leakage, load and offsets, small reversals for play and hysteresis, steps of several sizes and dense
spectra for what is fast, long strokes for what depends on the position (Jelali & Kroll 2003, ch. 4; Merritt 1967).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.signals.odd_random_phase_multisine import OddRandomPhaseMultisine
from hydraulic_sysid.excitation.signals.steps import Steps
from hydraulic_sysid.excitation.signals.triangle import Triangle

_ALIKE = 0.03  # relative difference of numbers below which movements are the same
_BACK = 0.2  # of a movement's time, in which the piston returns to where it began
_BACK_DRIVE = 0.5  # of the drive, with which it does
_SHRINK = (1.0, 0.6, 0.35, 0.2, 0.1)  # sizes of the loops of reversals that lie within each other
_SIZES = (0.25, -0.25, 0.5, -0.5, 1.0, -1.0)


@dataclass(frozen=True)
class Bench:
    """What movements are measured in: drive [V], travel to each side of the centre [m], time of one movement [s]."""

    drive: float
    travel: float
    centre: float
    time: float
    rate: float

    @property
    def active(self) -> float:
        """Seconds of a movement without the way back."""
        return (1.0 - _BACK) * self.time


@dataclass(frozen=True)
class Phase:
    """A part of a movement of ``samples`` samples.

    It drives ``drive`` (N,) [V] as given, or the way to ``target`` [m] with at most ``most`` [V].
    """

    samples: int
    drive: Array | None = None
    target: float = 0.0
    most: float = 0.0


@dataclass(frozen=True)
class Family:
    """A kind of movement: in words, the range of each of its numbers, those to begin with, and how a bench plays it.

    ``size`` is the number that a limit makes smaller, ``reach`` the one that the travel does.
    """

    words: str
    ranges: Mapping[str, tuple[float, float]]
    grid: Mapping[str, tuple[float, ...]]
    size: str
    reach: str
    play: Callable[[Mapping[str, float], Bench], list[Phase]]


@dataclass(frozen=True)
class Movement:
    """A member of a family. Sizes are parts of the drive or of the travel, other numbers as their names say."""

    kind: str
    numbers: Mapping[str, float]

    @property
    def family(self) -> Family:
        """Its kind."""
        return FAMILIES[self.kind]

    def phases(self, bench: Bench) -> list[Phase]:
        """What is done, the way back to the centre at its end included."""
        parts = self.family.play(self.numbers, bench)
        left = round(bench.time * bench.rate) - sum(p.samples for p in parts)
        return [*parts, Phase(left, target=bench.centre, most=_BACK_DRIVE * bench.drive)]

    def scaled(self, factor: float, travel: bool = False) -> Movement:
        """The movement with another size, or another ``travel``, within its range."""
        name = self.family.reach if travel else self.family.size
        low, high = self.family.ranges[name]
        return self.moved({name: min(max(factor * self.numbers[name], low), high)})

    def moved(self, numbers: Mapping[str, float]) -> Movement:
        """The movement with other numbers."""
        return Movement(self.kind, {**self.numbers, **numbers})

    def like(self, other: Movement) -> bool:
        """Whether two movements are nearly the same."""
        if self.kind != other.kind:
            return False
        return all(abs(v - other.numbers[k]) <= _ALIKE * abs(v) for k, v in self.numbers.items())


def every() -> list[Movement]:
    """All movements to begin with."""
    found = []
    for kind, family in FAMILIES.items():
        for values in itertools.product(*family.grid.values()):
            found.append(Movement(kind, dict(zip(family.grid, values, strict=True))))
    return found


def _time(bench: Bench) -> Array:
    return np.arange(round(bench.active * bench.rate)) / bench.rate


def _open(drive: Array) -> list[Phase]:
    return [Phase(drive.size, drive)]


def _levels(levels: tuple[float, ...], hold: float, bench: Bench) -> list[Phase]:
    """Levels over and over, as often as they fit as a whole."""
    times = max(1, int(bench.active / (hold * len(levels))))
    hold = min(hold, bench.active / len(levels))
    signal = Steps(levels=tuple(bench.drive * v for v in levels), hold=hold)
    t = _time(bench)
    return _open(np.where(t < times * signal.length - 1e-9, signal.sample(t), 0.0))


def _triangle(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    cycles = round(n["cycles"])
    return _open(Triangle(n["amplitude"] * bench.drive, cycles / bench.active).sample(_time(bench)))


def _multisine(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    period = _time(bench).size / bench.rate
    high = max(min(n["frequency"], 0.4 * bench.rate), 12.0 / period)
    signal = OddRandomPhaseMultisine(n["rms"] * bench.drive, period, 1.0 / period, high)
    drive = signal.sample(_time(bench))
    return _open(np.clip(drive, -bench.drive, bench.drive))


def _steps(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    a = n["amplitude"]
    return _levels((a, -a, -a, a), n["hold"], bench)


def _pulses(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    a = n["amplitude"]
    return _levels((a, 0.0, -a, 0.0, -a, 0.0, a, 0.0), n["hold"], bench)


def _staircase(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    return _levels(tuple(n["amplitude"] * s for s in _SIZES), n["hold"], bench)


def _reversals(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    t = _time(bench)
    turns = t * n["frequency"]
    per_loop = max(1, round(bench.active * n["frequency"] / len(_SHRINK)))
    size = np.array(_SHRINK)[np.clip((turns + 1e-9).astype(int) // per_loop, 0, len(_SHRINK) - 1)]
    return _open(n["amplitude"] * bench.drive * size * np.sin(2.0 * np.pi * turns))


def _holds(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    way, still = (round(part * bench.active * bench.rate) for part in (0.3, 0.2))
    most = n["drive"] * bench.drive
    parts = []
    for side in (1.0, -1.0):
        target = bench.centre + side * n["position"] * bench.travel
        parts += [Phase(way, target=target, most=most), Phase(still, np.zeros(still))]
    return parts


def _hold(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    way, still = (round(part * bench.active * bench.rate) for part in (0.5, 0.5))
    target, most = bench.centre + n["position"] * bench.travel, n["drive"] * bench.drive
    return [Phase(way, target=target, most=most), Phase(still, np.zeros(still))]


def _strokes(n: Mapping[str, float], bench: Bench) -> list[Phase]:
    most = n["drive"] * bench.drive
    third, whole = (round(part * bench.active * bench.rate) for part in (1 / 3, 2 / 3))
    to = [bench.centre + side * n["position"] * bench.travel for side in (1.0, -1.0)]
    return [Phase(third, target=to[0], most=most), Phase(whole, target=to[1], most=most)]


_AMPLITUDE = (0.003, 1.0)
_POSITION = (0.05, 1.0)
_DRIVE = (0.02, 1.0)

FAMILIES: dict[str, Family] = {
    "triangle": Family(
        "slow triangle through null", {"amplitude": _AMPLITUDE, "cycles": (1.0, 8.0)},
        {"amplitude": (0.02, 0.06, 0.2), "cycles": (1.0, 3.0)}, "amplitude", "amplitude", _triangle,
    ),
    "hold": Family(
        "hold at one position", {"position": (-1.0, 1.0), "drive": _DRIVE},
        {"position": (0.9, -0.9), "drive": (0.7,)}, "drive", "position", _hold,
    ),
    "holds": Family(
        "holds at two positions", {"position": _POSITION, "drive": _DRIVE},
        {"position": (0.3, 0.7), "drive": (0.7,)}, "drive", "position", _holds,
    ),
    "multisine": Family(
        "odd multisine", {"rms": (0.002, 0.5), "frequency": (1.0, 200.0)},
        {"rms": (0.02, 0.06, 0.2), "frequency": (4.0, 20.0, 80.0)}, "rms", "rms", _multisine,
    ),
    "steps": Family(
        "steps", {"amplitude": _AMPLITUDE, "hold": (0.02, 2.0)},
        {"amplitude": (0.05, 0.2, 0.6, 1.0), "hold": (0.1, 0.3, 0.8)}, "amplitude", "amplitude", _steps,
    ),
    "pulses": Family(
        "pulses with rests between", {"amplitude": _AMPLITUDE, "hold": (0.02, 1.0)},
        {"amplitude": (0.05, 0.3, 0.9), "hold": (0.15, 0.45)}, "amplitude", "amplitude", _pulses,
    ),
    "staircase": Family(
        "steps of several sizes", {"amplitude": _AMPLITUDE, "hold": (0.02, 1.0)},
        {"amplitude": (0.1, 0.4, 1.0), "hold": (0.1, 0.3)}, "amplitude", "amplitude", _staircase,
    ),
    "reversals": Family(
        "reversals of several amplitudes", {"amplitude": _AMPLITUDE, "frequency": (0.5, 50.0)},
        {"amplitude": (0.03, 0.1, 0.3), "frequency": (1.25, 5.0)}, "amplitude", "amplitude", _reversals,
    ),
    "strokes": Family(
        "strokes to the ends", {"position": _POSITION, "drive": _DRIVE},
        {"position": (0.4, 1.0), "drive": (0.35, 0.9)}, "drive", "position", _strokes,
    ),
}  # fmt: skip
"""Kind of movement → its family; the list of what a designed experiment may be made of."""
