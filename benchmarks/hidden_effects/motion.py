"""Experiments sized by an actuator's stroke, top speed and resonance: 10 s at 1 kHz, in open or closed loop.

One profile of speed serves both loops. In open loop it is played as a drive, which a weak feedback of the position
keeps from the stops; in closed loop its integral is the reference of a proportional controller.
"""

from __future__ import annotations

import math

import numpy as np

from .geometry import Geometry

RATE = 1000.0
DURATION = 10.0
SAMPLES = int(DURATION * RATE)
NAMES = ("slow", "steps", "sweep", "random")
LOOPS = ("open", "closed")
TRAVEL = 0.35  # of the stroke, to either side of the middle
CENTRING = 3.0  # V per stroke, in open loop
BANDWIDTH = (
    0.05  # of the closed loop over the resonance (in rad/s; a proportional one is unstable at twice the damping)
)
MOST_BANDWIDTH = 40.0  # rad/s
FULL = 10.0  # V
HARD = 0.8  # kick of a geometry beyond which the reference does not outrun the actuator
PERIOD = 5.0  # s, of the slow experiment
ON = 0.75  # share of the moves in open loop that go on in the direction of the last: they reach the ends of the travel
SWEPT = (0.5, 60.0)  # of the resonance, and Hz: end of the sweep


def feed(name: str, geometry: Geometry, loop: str, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """Volts (n,) before the feedback, and the feedback's gain [V/m]."""
    if loop == "open":
        speed = _PROFILES[name](geometry, rng, False)
        gains = [FULL * geometry.top_speed / v for v in geometry.speeds]  # unequal areas: unequal drives
        return np.where(speed > 0.0, gains[0], gains[1]) * speed, CENTRING / geometry.plain["stroke"]
    gain = controller(geometry)
    return gain * geometry.top_speed / RATE * np.cumsum(_PROFILES[name](geometry, rng, True)), gain


def controller(geometry: Geometry) -> float:
    """Gain of the position controller [V/m]."""
    bandwidth = min(BANDWIDTH * 2.0 * math.pi * geometry.resonance, MOST_BANDWIDTH)
    return FULL * bandwidth / (sum(geometry.speeds) / 2.0)


def _slow(g: Geometry, _: np.random.Generator, closed: bool) -> np.ndarray:
    """A triangle: of the drive through null, or of the reference."""
    phase = (np.arange(SAMPLES) / RATE / PERIOD) % 1.0
    size = min(0.09, 4.0 * TRAVEL * g.crossing / PERIOD)
    if closed:
        return _soft(g, size * np.where((phase < 0.25) | (phase >= 0.75), 1.0, -1.0))
    return size * np.where(phase < 0.25, 4 * phase, np.where(phase < 0.75, 2 - 4 * phase, 4 * phase - 4))


def _steps(g: Geometry, rng: np.random.Generator, closed: bool) -> np.ndarray:
    """Moves at constant speed between rests; in closed loop as fast as the actuator can, where it bears that."""
    speed, at, k, way = np.zeros(SAMPLES), 0.0, 0, 1.0
    while k < SAMPLES:
        way = way if rng.random() < (0.5 if closed else ON) else -way
        if closed:
            move = rng.uniform(0.02, 0.9 * TRAVEL) * way
            pace = 3.0 if g.kick < HARD else rng.uniform(0.3, 0.9)
            rest = rng.uniform(0.1, 0.4) + (abs(move) * g.crossing if pace > 1.0 else 0.0)
        else:
            pace = rng.uniform(0.2, 0.9)
            move = pace * max(rng.uniform(0.08, 0.3), 0.06 / g.crossing) * way
            move = min(max(move, -TRAVEL), TRAVEL)
            rest = rng.uniform(0.05, 0.3) * (rng.random() < 0.4)
        if abs(at + move) > TRAVEL:
            move, way = -move, -way
        lasts = max(round(abs(move) * g.crossing / pace * RATE), 1)
        speed[k : k + lasts] = move * g.crossing / (lasts / RATE)
        at, k = at + move, k + lasts + round(rest * RATE)
    return _soft(g, speed)


def _sweep(g: Geometry, _: np.random.Generator, closed: bool) -> np.ndarray:
    """A logarithmic sine sweep of speed, up to half the resonance."""
    t, size = np.arange(SAMPLES) / RATE, 0.3
    first = max(0.1, size / (2.0 * np.pi * 0.8 * TRAVEL * g.crossing))
    last = min(SWEPT[0] * g.resonance, SWEPT[1])
    k = math.log(last / first) / DURATION
    return size * np.minimum(4.0 * first * t, 1.0) * np.cos(2.0 * np.pi * first / k * np.expm1(k * t))


def _random(g: Geometry, rng: np.random.Generator, closed: bool) -> np.ndarray:
    """Odd lines up to a quarter of the resonance with random phases, falling off where the stroke is crossed."""
    lines = np.arange(1.0, min(0.25 * g.resonance, 0.5 * SWEPT[1]) * DURATION, 2.0) / DURATION
    size = 1.0 / np.sqrt(1.0 + (lines / min(max(2.0 / g.crossing, 0.3), 5.0)) ** 2)
    turns = 2.0 * np.pi * lines[:, None] * np.arange(SAMPLES) / RATE + rng.uniform(0.0, 2.0 * np.pi, (len(lines), 1))
    speed = (size[:, None] * np.cos(turns)).sum(0) * np.minimum(np.arange(SAMPLES) / (0.1 * RATE), 1.0)
    travel = np.abs(np.cumsum(speed)).max() / RATE / g.crossing
    return speed * min(0.6 / np.abs(speed).max(), TRAVEL / travel)


def _soft(g: Geometry, speed: np.ndarray) -> np.ndarray:
    """The profile's jumps drawn out over up to most of a period of the resonance, as hard as they strain the oil."""
    width = max(round(0.8 * min(g.kick, 1.0) / g.resonance * RATE), 1)
    return np.convolve(speed, np.ones(width) / width)[: len(speed)]


_PROFILES = {"slow": _slow, "steps": _steps, "sweep": _sweep, "random": _random}
