"""One step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ._base import Profile


@dataclass(frozen=True)
class Step(Profile):
    """From ``offset`` [m] by ``amplitude`` [m] at half the ``dwell`` [s], which then follows once more."""

    dwell: float
    jumps: ClassVar[bool] = True

    @property
    def duration(self) -> float:
        return 1.5 * self.dwell

    def at(self, t: float) -> tuple[float, float]:
        return self.offset + (self.amplitude if t >= 0.5 * self.dwell else 0.0), 0.0
