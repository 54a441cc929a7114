"""What acts by a clock of its own: at every place of the plant, how much a sine of one frequency would explain.

A neighbouring machine or the regulator of a pump goes on whatever the drive does, which no law over the motion follows;
a structure that gives way rings near it and seems to be what is missing. The course of a sine is put together from
those of `unknown_inputs`, so that its response has the dynamics of its place. Laws that are a little wrong leave what
the drive asks for, of which a sine of any frequency explains little.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations

from .candidates import subsystem
from .criteria import CRITERIA
from .linearisation import Linearisation
from .nonparametric_curves import anywhere_allowed, unexplained
from .unknown_inputs import Courses, longest_segment, over_time

KNOTS = 24  # in the length of a segment
_FINEST = 4.0  # knots in a period, as straight lines between fewer are no sine
_TOGETHER = 20.0  # lengths of a segment over which a phase is held: no machine keeps its speed for ever
_PERIODS = 4.0  # in that time at least: what is slower is a drift
_FINER = 4  # frequencies in the width of a line
OF_THEMSELVES = ("force", "supply")  # what machines shake or pump


@dataclass(frozen=True)
class PeriodicInput:
    """A sine of a ``frequency`` [Hz] at a ``place``; ``share`` (0…1) of what noise does not explain that it would.

    ``amplitude`` [``unit``]: the root mean square of those of all stretches, each of which has a phase of its own.
    """

    place: str
    subsystem: str
    summary: str
    frequency: float
    amplitude: float
    unit: str
    share: float


def periodic_inputs(at: Linearisation, say: Callable[[str], None]) -> list[PeriodicInput]:
    """At every place of the plant the best, the one that explains most first.

    Of those that explain nearly the most it is a force or the supply: those are what is periodic of itself.
    """
    part, _ = at.sample(CRITERIA.enough_to_score)
    say("what may be periodic of itself")
    free = replace(part.normal, information=part.normal.information + np.diag(anywhere_allowed(part.parameters)))
    alone, left = _fitted(0.0, (), free)[0], unexplained(part)
    every = (Courses.of(part, place, KNOTS) for place in over_time(part))
    found = [_best(part, courses, free, alone, left) for courses in every if courses is not None]
    most = max((f.share for f in found), default=0.0)
    return sorted(found, key=lambda f: (_after(f, most), -f.share))


def _after(found: PeriodicInput, most: float) -> int:
    near = found.share > CRITERIA.nearly * most
    return 2 if not near else 0 if found.subsystem in OF_THEMSELVES else 1


def _best(at: Linearisation, courses: Courses, free: NormalEquations, alone: float, left: float) -> PeriodicInput:
    """The best sine at a place; parameters that are ``free`` too explain so much ``alone`` of what is ``left``."""
    stretches, length = list(_stretches(at, courses)), longest_segment(at)
    # Where few segments of a stretch were kept, so that they see a period at least.
    seen = float(np.median([len(s.times) for s in stretches]))
    slowest = max(_PERIODS / _TOGETHER, 1.0 / seen) / length
    step = 1.0 / (_FINER * _TOGETHER * length)
    tried = np.arange(slowest, 1.0 / (_FINEST * courses.width), step)
    coarse = float(max(tried, key=lambda f: _fitted(float(f), stretches, free)[0]))
    finer = np.linspace(coarse - step, coarse + step, 2 * _FINER + 1)
    frequency = float(max(finer, key=lambda f: _fitted(float(f), stretches, free)[0]))
    explained, height = _fitted(frequency, stretches, free)
    place = courses.place
    return PeriodicInput(
        place.effect.name,
        subsystem(place.effect),
        place.effect.summary,
        frequency,
        height * place.height.default,
        place.height.unit,
        min(max((explained - alone) / max(left, 1e-300), 0.0), 1.0),
    )


@dataclass(frozen=True)
class _Stretch:
    """Of segments (S,) of a record that follow each other: hats' ``times`` (S, K) [s], and products of their columns.

    ``own`` (S, K, K) with each other, ``score`` (S, K) with the residual, ``cross`` (S, K, P) with the parameters'.
    """

    times: Array
    own: Array
    score: Array
    cross: Array

    def of_sine(self, frequency: float) -> tuple[Array, Array, Array]:
        """The same of a cosine and a sine: (2, 2), (2,) and (2, P)."""
        angle = 2.0 * np.pi * frequency * self.times
        waves = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
        own = np.einsum("ska,skb->ab", waves, self.own @ waves)
        return own, np.einsum("ska,sk->a", waves, self.score), np.einsum("ska,skp->ap", waves, self.cross)


def _stretches(at: Linearisation, courses: Courses) -> Iterator[_Stretch]:
    together = _TOGETHER * longest_segment(at)
    for segments, beyond, residual, hats in zip(
        at.split.segments, at.beyond, at.residual, courses.columns, strict=True
    ):
        begun = np.asarray(segments.first, dtype=np.float64) * segments.record.dt
        number = np.floor((begun - begun.min()) / together)
        turned, times = np.swapaxes(hats, 1, 2), courses.times(begun)
        own, score, cross = turned @ hats, (turned @ residual[..., None])[..., 0], turned @ beyond
        for n in np.unique(number):
            here = number == n
            yield _Stretch(times[here], own[here], score[here], cross[here])


def _fitted(frequency: float, stretches: Sequence[_Stretch], free: NormalEquations) -> tuple[float, float]:
    """The fall of the sum of squares beyond that by chance, and the amplitude in heights of a hat."""
    own, unknowns = len(free.gradient), 2 * len(stretches)
    information, gradient = np.zeros((own + unknowns, own + unknowns)), np.zeros(own + unknowns)
    information[:own, :own], gradient[:own] = free.information, free.gradient
    for i, stretch in enumerate(stretches):
        at = slice(own + 2 * i, own + 2 * i + 2)
        information[at, at], gradient[at], information[at, :own] = stretch.of_sine(frequency)
        information[:own, at] = information[at, :own].T
    change = -np.linalg.pinv(information, rcond=1e-12, hermitian=True) @ gradient
    amplitude = float(np.sqrt(np.sum(change[own:] ** 2) / max(len(stretches), 1)))
    return float(-gradient @ change) - unknowns, amplitude
