"""Basis functions over one variable, their knots, and operators with a memory, from which regressors are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.signal import lfilter

from hydraulic_sim.arrays import Array

from .plant_signals import Signals

_REACH = 0.995  # quantile of the size at which the outermost knot of a signed variable lies


def hat_functions(values: Array, knots: Array) -> Array:
    """Linear B-splines ``(K, n)``: one at their knot, zero at its neighbours; constant beyond the ends."""
    if knots.size < 2:
        return np.ones((1, values.size))
    inside = np.clip(values, knots[0], knots[-1])
    left = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, knots.size - 2)
    weight = (inside - knots[left]) / (knots[left + 1] - knots[left])
    basis, column = np.zeros((knots.size, values.size)), np.arange(values.size)
    basis[left, column] = 1.0 - weight
    basis[left + 1, column] = weight
    return basis


def signed_knots(values: Array, number: int) -> Array:
    """Knots on both sides of zero (``number`` each), quadratically denser towards it: there friction and lands bend."""
    reach = float(np.quantile(np.abs(values), _REACH))
    parts = reach * np.linspace(0.0, 1.0, number + 1) ** 2
    return np.unique(np.concatenate((-parts, parts)))


def even_knots(values: Array, number: int) -> Array:
    """Evenly spaced knots over the range, the outermost 0.2 % left out."""
    low, high = np.quantile(values, (0.002, 0.998))
    return np.unique(np.linspace(low, high, number))


@dataclass(frozen=True)
class Knots:
    """Where the curves of all records have their knots [SI]: a curve is one function, whatever the record."""

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


def lagged(values: Array, dt: float, time: float, begin: float | None = None) -> Array:
    """First-order lag of a time constant [s] from ``begin`` on; without it settled on the first value."""
    pole = np.exp(-dt / time)
    return lfilter([1.0 - pole], [1.0, -pole], values, zi=[(values[0] if begin is None else begin) * pole])[0]


@njit("f8[::1](f8[::1], f8)", cache=True, nogil=True)
def play(values: Array, half_width: float) -> Array:
    """Output of a play (backlash) operator."""
    out = np.empty_like(values)
    held = values[0]
    for i in range(len(values)):
        held = min(max(held, values[i] - half_width), values[i] + half_width)
        out[i] = held
    return out


@njit("f8[::1](f8[::1], f8)", cache=True, nogil=True)
def rate_limited(values: Array, step: float) -> Array:
    """The signal changing by at most ``step`` per sample."""
    out = np.empty_like(values)
    held = values[0]
    for i in range(len(values)):
        held += min(max(values[i] - held, -step), step)
        out[i] = held
    return out
