"""How a channel was recorded: late or early against the drive, and through a low pass.

A logger that samples one channel after the other, a filter in an amplifier or a bus cycle shift a channel against the
drive. Physics does not: what is left of a delay once the valve's own is in the model is up to the recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from hydraulic_sim.arrays import Array


@dataclass(frozen=True)
class Timing:
    """A channel that was recorded ``delay`` [s] late (early if negative), behind a first-order low pass ``lag`` [s].

    ``named`` [s]: the part of the delay that is a fault; the rest is what every recording has.
    """

    delay: float = 0.0
    lag: float = 0.0
    named: float = 0.0

    def applied(self, values: Array, dt: float) -> Array:
        """What is recorded of simulated values (S, n); they are taken to have moved straight on before they begin."""
        if self.lag > 0.0:
            values = _lagged(values, self.lag, dt)
        return _delayed(values, self.delay, dt) if self.delay else values


def _lagged(values: Array, lag: float, dt: float) -> Array:
    """Through 1/(lag·s + 1), exactly for values that are straight between samples."""
    fade = np.exp(-dt / lag)
    gain = lag / dt * (1.0 - fade)
    begin = values[:, 0] - lag * (values[:, 1] - values[:, 0]) / dt
    drive = (1.0 - gain) * values[:, 1:] + (gain - fade) * values[:, :-1]
    later, _ = lfilter([1.0], [1.0, -fade], drive, axis=1, zi=(fade * begin)[:, None])
    return np.concatenate((begin[:, None], later), axis=1)


def _delayed(values: Array, delay: float, dt: float) -> Array:
    """By whole samples, and the rest by a Taylor step of second order."""
    whole = round(delay / dt)
    if whole > 0:
        slope = values[:, 1:2] - values[:, :1]
        values = np.concatenate((values[:, :1] - slope * np.arange(whole, 0, -1), values[:, :-whole]), axis=1)
    elif whole < 0:
        slope = values[:, -1:] - values[:, -2:-1]
        values = np.concatenate((values[:, -whole:], values[:, -1:] + slope * np.arange(1, 1 - whole)), axis=1)
    rest = delay - whole * dt
    if rest:
        rate = np.gradient(values, dt, axis=1)
        values = values - rest * rate + 0.5 * rest**2 * np.gradient(rate, dt, axis=1)
    return values
