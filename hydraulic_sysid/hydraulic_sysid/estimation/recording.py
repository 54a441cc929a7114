"""How a channel was recorded: late or early against the drive, through a low pass, with a gain of its own.

A logger that samples one channel after the other, a filter in an amplifier or a bus cycle shift a channel against the
drive. Physics does not: what is left of a delay once the valve's own is in the model is up to the recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array

from .whitened_residual import recorded


@dataclass(frozen=True)
class Reading:
    """A channel that was recorded ``delay`` [s] late (early if negative), behind a first-order low pass ``lag`` [s].

    ``named`` [s]: the part of the delay that is a fault; the rest is what every recording has. ``gain``: the share by
    which it reads too much.
    """

    delay: float = 0.0
    lag: float = 0.0
    named: float = 0.0
    gain: float = 0.0

    def applied(self, values: Array, dt: float) -> Array:
        """What is recorded of simulated values (S, n); they are taken to have moved straight on before they begin."""
        return (1.0 + self.gain) * np.asarray(recorded(values, self.delay / dt, self.lag / dt))
