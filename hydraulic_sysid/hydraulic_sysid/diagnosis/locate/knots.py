"""Where the curves of all records have their knots: a curve is one function of its variable, whatever the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array

from .curves import even_knots, signed_knots
from .signals import Signals


@dataclass(frozen=True)
class Knots:
    """Arrays of knots [SI]."""

    velocity: Array
    position: Array
    leak_position: Array
    drive: Array
    load: Array
    leak_load: Array
    pressure: Array
    time: Array

    @classmethod
    def of(cls, signals: Sequence[Signals]) -> Knots:
        """From the signals of all records together."""

        def every(name: str) -> Array:
            return np.concatenate([getattr(s, name) for s in signals])

        position, load = every("position"), every("load_pressure")
        return cls(
            velocity=signed_knots(every("velocity"), 12),
            position=even_knots(position, 24),
            leak_position=even_knots(position, 12),
            drive=np.union1d(signed_knots(every("drive"), 16), even_knots(every("drive"), 48)),
            load=signed_knots(load, 3),
            leak_load=signed_knots(load, 6),
            pressure=even_knots(np.concatenate((every("pressure_a"), every("pressure_b"))), 6),
            time=even_knots(every("time"), 5),
        )
