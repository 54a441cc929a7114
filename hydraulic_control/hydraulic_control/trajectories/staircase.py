"""Steps up and down again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ._base import Limits


@dataclass(frozen=True)
class Staircase:
    """From ``offset`` [m] up to ``amplitude`` [m] in ``levels`` equal steps and down again, ``dwell`` [s] on each."""

    offset: float
    amplitude: float
    levels: int
    dwell: float
    jumps: ClassVar[bool] = True

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], limits: Limits) -> Staircase:
        """See `make`."""
        return cls(settings["offset"], settings["amplitude"], settings["levels"], settings["dwell"])

    @property
    def duration(self) -> float:
        """Seconds until it rests for good."""
        return (2 * self.levels + 1) * self.dwell

    def at(self, t: float) -> tuple[float, float]:
        """Position [m] and velocity [m/s]."""
        number = min(max(int(t / self.dwell), 0), 2 * self.levels)
        level = self.levels - abs(self.levels - number)
        return self.offset + self.amplitude * level / self.levels, 0.0
