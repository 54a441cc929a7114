"""How far off a model is, on segments for fitting and for validation, and when a reduction is one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask

from .criteria import CRITERIA
from .holdout import Split


@dataclass(frozen=True)
class Misfit:
    """Sums of squares over noise on segments for fitting and for validation, and how many free values they are of.

    ``prior``: what the parameters' distance from what is known of them beforehand adds. A model that leaves no more but
    bends the data sheet less is the better one.
    """

    fit: float
    validation: float
    n_fit: int
    n_validation: int
    typical: float = math.inf
    """Mean square over noise without the worst segments: no single one turns a verdict."""
    by_segment: Array = field(default_factory=lambda: np.zeros(0), compare=False)
    """Sum of squares of every segment, …"""
    counted: Array = field(default_factory=lambda: np.zeros(0), compare=False)
    """… how many values it is of, …"""
    fitted: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool), compare=False)
    """… and whether it was fitted."""
    prior: float = 0.0

    @property
    def rms_fit(self) -> float:
        """Residual over noise on the segments fitted."""
        return float((self.fit / max(self.n_fit, 1)) ** 0.5)

    @property
    def rms_validation(self) -> float:
        """Residual over noise on what no fit has seen (on the segments fitted where there is nothing else)."""
        return float((self.validation / self.n_validation) ** 0.5) if self.n_validation else self.rms_fit

    @property
    def count(self) -> int:
        """Free values."""
        return self.n_fit + self.n_validation

    @property
    def total(self) -> float:
        """Sum of squares, the prior's part included."""
        return self.squares + self.prior

    @property
    def squares(self) -> float:
        """Sum of squares of what is left of the records."""
        return self.fit + self.validation

    @property
    def variance(self) -> float:
        """Mean square over noise, at least 1."""
        return max(1.0, self.squares / max(self.count, 1))

    @property
    def summed(self) -> Misfit:
        """The sums alone, whatever single segments leave."""
        return replace(self, by_segment=np.zeros(0))

    def times(self, factor: float) -> Misfit:
        """The same over a noise whose mean square is another by this factor."""
        fit, validation = factor * self.fit, factor * self.validation
        return replace(
            self, fit=fit, validation=validation, typical=factor * self.typical, by_segment=factor * self.by_segment
        )

    @property
    def excess(self) -> float:
        """What of the sum of squares noise does not explain."""
        return max(self.squares - self.count, 0.0)

    @property
    def usual(self) -> float:
        """Mean square over noise, whatever the worst segments leave."""
        return min(self.variance, self.typical)

    @property
    def little(self) -> bool:
        """Whether so little is left that nothing need be missing."""
        return self.usual <= CRITERIA.little**2

    @property
    def at_the_noise(self) -> bool:
        """Whether by the noise nothing is left; what that was estimated from may hide more."""
        return self.variance - 1.0 < CRITERIA.nothing_left

    @property
    def least(self) -> float:
        """The smallest reduction of the sum of squares that counts."""
        return max(CRITERIA.significant, CRITERIA.visible * self.count) * self.variance

    @property
    def freedom(self) -> float:
        """What a free parameter is worth of the sum of squares (BIC)."""
        return math.log(max(self.count, 2)) * self.variance


def misfit(split: Split, costs: Sequence[Array], prior: float = 0.0) -> Misfit:
    """Of the sums of squares ``costs[i]`` (S_i,) and of the prior; each initial state takes its degrees of freedom."""
    sums, counts = [0.0, 0.0], [0, 0]
    cost, count = np.concatenate(list(costs)), np.concatenate([s.counted for s in split.segments])
    kept = but_the_worst(cost, count)
    for segments, fit, own in zip(split.segments, split.fit, costs, strict=True):
        for i, part in enumerate((fit, ~fit)):
            sums[i] += float(own[part].sum())
            counts[i] += int(segments.counted[part].sum())
    return Misfit(
        sums[0],
        sums[1],
        counts[0],
        counts[1],
        float(cost[kept].sum() / count[kept].sum()),
        cost,
        count,
        np.concatenate(split.fit),
        prior,
    )


def material(before: Misfit, after: Misfit) -> bool:
    """Whether a reduction is more than chance, more than fitting itself gives, and enough to be seen.

    It must be so without the few segments that gain most and those that lose most, too.
    """
    gain, fit, validation = reduction(before, after), before.fit - after.fit, before.validation - after.validation
    if _comparable(before, after):
        gains = before.by_segment - after.by_segment
        kept = but_the_worst(after.by_segment, after.counted)
        fit, validation = (float(gains[kept][part[kept]].sum()) for part in (after.fitted, ~after.fitted))
    held = not before.n_validation or validation > CRITERIA.confirmed * before.variance
    return gain >= before.least and held and fit > CRITERIA.significant * before.variance


def reduction(before: Misfit, after: Misfit) -> float:
    """By how much a model leaves less, without the few segments that gain most and those that lose most."""
    if not _comparable(before, after):
        return before.total - after.total
    gains = before.by_segment - after.by_segment
    few = _few(gains)
    return float(np.sort(gains)[few : gains.size - few].sum())


def explained(before: Misfit, after: Misfit) -> float:
    """Share of what noise does not explain that has gone, but for the segments that are worst in the end."""
    gain, excess = before.total - after.total, before.excess
    if _comparable(before, after):
        kept = but_the_worst(after.by_segment, after.counted)
        gain = float((before.by_segment - after.by_segment)[kept].sum())
        excess = float((before.by_segment - before.counted)[kept].sum())
    return gain / max(excess, 1e-9 * before.total, gain)


def unexplained_share(before: Misfit, after: Misfit) -> float:
    """Mean square that is surely beyond the noise, over that before (0…1)."""
    first, last = (max(m.usual - 1.0 - CRITERIA.noise_missed, 0.0) for m in (before, after))
    return last / first if first > 0.0 else 0.0


def _comparable(before: Misfit, after: Misfit) -> bool:
    return 0 < before.by_segment.size == after.by_segment.size


def but_the_worst(cost: Array, count: Array) -> Index:
    """All segments (S,) but the few that cost most per value: no single one turns a verdict."""
    return np.argsort(cost / count)[: cost.size - _few(cost)]


def _few(segments: Array) -> int:
    """How many of so many segments are no more than a few."""
    return min(max(1, round(CRITERIA.few * segments.size)), (segments.size - 1) // 2)
