"""The model's own motion along a record, free of measurement noise, for directions that need derivatives.

Directions made from measured derivatives carry the very noise that the balances carry: velocity, flow and pressure
rates together make up the balance itself, and a family that holds all three seems to explain its noise (errors in
variables; Fuller 1987, Measurement Error Models). The motion that the model makes in short runs from measured states
has nearly none of that noise, and is close enough to say what, for instance, a slow sensor would do to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from hydraulic_sim.arrays import Array
from hydraulic_sim.plant import Plant

PIECE = 0.25  # s
_SPAN = 0.025  # s, of the quadratic through which initial pressures are read


@dataclass(frozen=True)
class Path:
    """``(n,)`` each, at the middle of every sampling interval: m/s, m/s², m/s³, and Pa/s for both chambers."""

    velocity: Array
    acceleration: Array
    jerk: Array
    rate_a: Array
    rate_b: Array


def path_of(plant: Plant, drive: Array, dt: float, x: Array, v: Array, pa: Array, pb: Array, n: int) -> Path:
    """Runs of a quarter of a second from measured states (N,), pressures NaN where they were not measured."""
    length = max(10, int(round(PIECE / dt)))
    last = x.size - 1 - length
    starts = np.unique(np.append(np.arange(0, last + 1, length), last)) if last > 0 else np.array([0])
    length = min(length, x.size - 1)
    width = min(max(5, 2 * int(round(0.5 * _SPAN / dt)) + 1), (x.size - 1) // 2 * 2 - 1)
    smooth = [p if np.isnan(p).any() else savgol_filter(p, width, 2) for p in (pa, pb)]
    seen = np.stack([x, v, *smooth], axis=1)
    states, memories = plant.track(drive, dt, starts, seen)
    known = np.isfinite(seen[starts])
    states[:, :4] = np.where(known, seen[starts], states[:, :4])
    run = plant.predict(drive, dt, starts, length, states, memories)
    names = ("velocity", "acceleration", "jerk", "rate_a", "rate_b")
    parts = {name: np.zeros(x.size - 1) for name in names}
    speed = run["velocity"]
    gained = np.gradient(speed, dt, axis=1)
    made = {
        "velocity": speed,
        "acceleration": gained,
        "jerk": np.gradient(gained, dt, axis=1),
        "rate_a": np.gradient(run["true_pressure_a"], dt, axis=1),
        "rate_b": np.gradient(run["true_pressure_b"], dt, axis=1),
    }
    index = starts[:, None] + np.arange(length)
    for name in names:
        parts[name][index] = 0.5 * (made[name][:, 1:] + made[name][:, :-1])
    return Path(**{name: values[:n] for name, values in parts.items()})
