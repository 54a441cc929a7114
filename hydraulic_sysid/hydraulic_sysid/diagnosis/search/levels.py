"""How far off a model is, on fitted and on held-out pieces, and when a gain is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .pieces import Split

SIGNIFICANT = 25.0  # gain of the sum of squares, of the present variance, on fitted pieces …
CONFIRMED = 10.0  # … and on held-out ones
VISIBLE = 5e-4  # gain over all residuals, of their present variance: a smaller one is a matter of laws, not of effects


class _Costs(Protocol):
    @property
    def costs(self) -> list[NDArray[np.float64]]: ...


@dataclass(frozen=True)
class Level:
    """Sums of squares over noise on fitted and on held-out pieces, and how many free values they are of."""

    fitted: float
    held_out: float
    n_fitted: int
    n_held_out: int

    @property
    def rms_fitted(self) -> float:
        return float((self.fitted / max(self.n_fitted, 1)) ** 0.5)

    @property
    def rms_held_out(self) -> float:
        """Residual over noise on what no fit has seen (on the fitted pieces where nothing is held out)."""
        return float((self.held_out / self.n_held_out) ** 0.5) if self.n_held_out else self.rms_fitted

    @property
    def count(self) -> int:
        return self.n_fitted + self.n_held_out

    @property
    def total(self) -> float:
        return self.fitted + self.held_out

    @property
    def variance(self) -> float:
        """Mean square over noise, at least 1."""
        return max(1.0, self.total / max(self.count, 1))

    @property
    def excess(self) -> float:
        """What of the sum of squares noise does not explain."""
        return max(self.total - self.count, 0.0)

    @property
    def least(self) -> float:
        """The smallest gain of the sum of squares that counts."""
        return max(SIGNIFICANT, VISIBLE * self.count) * self.variance


def level(split: Split, model: _Costs) -> Level:
    """The level of a model's costs; each piece's start takes its degrees of freedom."""
    sums, counts = [0.0, 0.0], [0, 0]
    for pieces, chosen, costs in zip(split.pieces, split.fitted, model.costs, strict=True):
        each = pieces.samples * len(pieces.channels)
        for i, part in enumerate((chosen, ~chosen)):
            sums[i] += float(costs[part].sum())
            counts[i] += int(part.sum()) * each
    return Level(sums[0], sums[1], counts[0], counts[1])


def material(before: Level, after: Level) -> bool:
    """Whether a gain is more than chance, more than fitting itself gives, and enough to be seen."""
    if before.total - after.total < before.least:
        return False
    held = not before.n_held_out or before.held_out - after.held_out > CONFIRMED * before.variance
    return held and before.fitted - after.fitted > SIGNIFICANT * before.variance


def repaired(before: Level, after: Level) -> float:
    """Share of what noise does not explain that has gone."""
    return (before.total - after.total) / max(before.excess, 1e-9 * before.total, before.total - after.total)
