"""What surrounds a hidden effect: which actuator, which sensors, which loop, and how right the data sheet is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import experiments, motion, parameters
from . import sensors as instruments
from .geometry import GEOMETRIES, Geometry

SHEETS = ("right", "off")
OFF = 0.03  # by which every number of a data sheet may be off


@dataclass(frozen=True)
class Setting:
    """``geometry`` of `GEOMETRIES`, ``sensors`` of `sensors.KINDS`, ``loop`` of `motion.LOOPS`, ``sheet`` of `SHEETS`.
    ``sized``: experiments and hidden effects are sized by the geometry; else they are the first bench's own."""

    geometry: str = "bench"
    sensors: str = "white"
    loop: str = "open"
    sheet: str = "right"
    sized: bool = True

    @property
    def name(self) -> str:
        return "-".join((self.geometry, self.sensors, self.loop, self.sheet)) if self.sized else ""

    @property
    def actuator(self) -> Geometry:
        return GEOMETRIES[self.geometry]

    @property
    def experiments(self) -> tuple[str, ...]:
        return motion.NAMES if self.sized else experiments.NAMES

    @property
    def drawn(self) -> tuple[str, ...]:
        """Experiments that are drawn anew: the same bench on another day."""
        return ("steps", "random") if self.sized else ("multisine", "steps", "fast")

    def feed(self, name: str, rng: np.random.Generator) -> tuple[np.ndarray, float]:
        """Volts (n,) of an experiment before the feedback, and the feedback's gain [V/m]."""
        if self.sized:
            return motion.feed(name, self.actuator, self.loop, rng)
        return experiments.drive(name, rng), experiments.CENTRING

    def scale(self, key: str) -> float:
        """What a plant parameter of the first bench is multiplied by here."""
        return self.actuator.scale(key) if self.sized else 1.0

    def laws(self) -> dict[str, float]:
        """Plant parameters that no data sheet holds: those of laws, sensors and logger."""
        if not self.sized:
            return {}
        found = {k: v * self.scale(k) for k, v in parameters.NULL.items() if k not in parameters.PLAIN}
        return found | {"spike_channel": float(self.actuator.pressures)}

    def instruments(self, rng: np.random.Generator) -> instruments.Sensors:
        """The sensors, drawn once for a bench."""
        return instruments.draw(self.sensors, rng, self.actuator.resonance)

    @property
    def decimals(self) -> int:
        """Of a recorded position [m]."""
        return 9 if self.sized else 6


FIRST = Setting(sized=False)
