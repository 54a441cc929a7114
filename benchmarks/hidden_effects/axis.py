"""An independent motor axis with a ball screw: force in, position out, bristle friction, under its own controller.

Data sheet and controller are those published for the EMPS axis (Janot, Gautier & Brunot, Nonlinear System
Identification Benchmarks 2019): cascaded gains, drive limited to 10 V, 1 kHz. The strokes are smooth ones between
0 and 0.24 m at several speeds. Semi-implicit Euler at 50 µs.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import signal

RATE = 1000.0
SUBSTEPS = 20
KP, KV = 160.18, 243.45  # 1/s, V/(m/s)
FORCE = 35.15  # N/V
STEP = 1e-7  # m, encoder
NOISE = 3e-6  # m; a sensor well below the bristles' 8 um would make a question of how they slip
PLAIN = {"mass": 95.1, "viscous": 203.5, "coulomb": 20.4, "load": -3.2, "bristle": 8e-6}
STROKES = ((0.24, 2.6), (0.0, 2.6), (0.24, 3.6), (0.0, 3.6), (0.12, 2.2), (0.24, 2.2), (0.0, 5.0))  # to m, in s
REST = 0.25  # s between strokes
WANDERS = 0.01  # s, of the force that no law gives


def reference() -> np.ndarray:
    """Position to follow (n,) m: strokes of the fifth order, with rests."""
    parts, at = [np.zeros(int(REST * RATE))], 0.0
    for goal, duration in STROKES:
        r = np.arange(1, int(duration * RATE) + 1) / (duration * RATE)
        parts += [at + (goal - at) * r**3 * (10 - 15 * r + 6 * r * r), np.full(int(REST * RATE), goal)]
        at = goal
    return np.concatenate(parts)


@njit
def _follow(
    goal, noise, disturbance, step, mass, forward, backward, coulomb_forward, coulomb_backward, load, bristle, out
):
    h = 1.0 / (RATE * SUBSTEPS)
    x, v, z, before = 0.0, 0.0, 0.0, 0.0
    stiff = 0.5 * (coulomb_forward + coulomb_backward) / bristle
    smooth = 0.0
    for k in range(len(goal)):
        y = step * np.floor((x + noise[k]) / step + 0.5)
        old = smooth
        smooth = 0.5 * (y + before)
        before = y
        speed = (smooth - old) * RATE if k > 0 else 0.0
        u = min(max(KP * KV * (goal[k] - y) - KV * speed, -10.0), 10.0)
        out[k, 0], out[k, 1] = u, y
        for _ in range(SUBSTEPS):
            level = coulomb_forward if v >= 0.0 else coulomb_backward
            viscous = forward if v >= 0.0 else backward
            rate = stiff * abs(v) / level
            fade = np.exp(-rate * h)
            z = z * fade + (v * (1.0 - fade) / rate if rate > 1e-9 else v * h)
            force = FORCE * u + load + disturbance[k] - stiff * z - 0.5 * np.sqrt(stiff * mass) * (v - rate * z)
            v = (v + h * force / mass) / (1.0 + h * viscous / mass)
            x += h * v


def run(
    rng: np.random.Generator, viscous_difference: float = 0.0, noise: float = NOISE, step: float = STEP,
    disturbance: float = 0.0, **values: float,
) -> dict[str, np.ndarray]:  # fmt: skip
    """One record: columns (n,) time_s, command_V, position_m. ``values`` differ from `PLAIN`; b± = b ± difference.

    ``noise`` of the position [m]; ``disturbance``: a force that wanders at random by so much [N], as cogging does.
    """
    p = PLAIN | values
    goal = reference()
    out = np.empty((len(goal), 2))
    read = noise * rng.standard_normal(len(goal))
    kept = np.exp(-1.0 / (WANDERS * RATE))
    wander = signal.lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], rng.standard_normal(len(goal)))
    _follow(
        goal, read, disturbance * wander, step, p["mass"], p["viscous"] + viscous_difference,
        p["viscous"] - viscous_difference, p["coulomb"], p["coulomb"], p["load"], p["bristle"], out,
    )  # fmt: skip
    digits = round(-np.log10(step))
    time = np.arange(len(goal)) / RATE
    return {"time_s": time, "command_V": out[:, 0].round(5), "position_m": out[:, 1].round(digits)}


MODEL = """format: hydraulic-model-1
name: axis
plant: mechanical
parameters:
  moving_mass: {value: 95 kg, source: data sheet, bounds: [76 kg, 114 kg]}
  drive_force: {value: 35.15 N/V, source: data sheet}
  stroke: {value: 1 m, source: data sheet}
effects:
  viscous_friction: {coefficient: {value: 200 N*s/m, source: data sheet, bounds: [50 N*s/m, 500 N*s/m]}}
  coulomb_friction: {level: {value: 20 N, source: known to be there, bounds: [1 N, 100 N]}}
  constant_load: {load: {value: 0 N, source: known to be there, bounds: [-20 N, 20 N]}}
history: []
"""
