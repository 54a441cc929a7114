"""One step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ._base import Limits


@dataclass(frozen=True)
class Step:
    """From ``offset`` [m] by ``amplitude`` [m] at half the ``dwell`` [s], which then follows once more."""

    offset: float
    amplitude: float
    dwell: float
    jumps: ClassVar[bool] = True

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], limits: Limits) -> Step:
        """See `make`."""
        return cls(settings["offset"], settings["amplitude"], settings["dwell"])

    @property
    def duration(self) -> float:
        """Seconds until it rests for good."""
        return 1.5 * self.dwell

    def at(self, t: float) -> tuple[float, float]:
        """Position [m] and velocity [m/s]."""
        return self.offset + (self.amplitude if t >= 0.5 * self.dwell else 0.0), 0.0
