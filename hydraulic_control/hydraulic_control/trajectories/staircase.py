"""Steps up and down again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ._base import Profile


@dataclass(frozen=True)
class Staircase(Profile):
    """From ``offset`` [m] up to ``amplitude`` [m] in ``levels`` equal steps and down again, ``dwell`` [s] on each."""

    levels: int
    dwell: float
    jumps: ClassVar[bool] = True

    @property
    def duration(self) -> float:
        return (2 * self.levels + 1) * self.dwell

    def at(self, t: float) -> tuple[float, float]:
        number = min(max(int(t / self.dwell), 0), 2 * self.levels)
        level = self.levels - abs(self.levels - number)
        return self.offset + self.amplitude * level / self.levels, 0.0
