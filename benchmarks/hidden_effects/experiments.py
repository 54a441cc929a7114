"""The six experiments of a bench: 20 s at 1 kHz, volts before the weak centring feedback is subtracted."""

from __future__ import annotations

import numpy as np

RATE = 1000.0
DURATION = 20.0
CENTRING = 2.0  # V per metre of measured position
NAMES = ("triangle", "multisine", "chirp", "steps", "fast", "long")


def times() -> np.ndarray:
    return np.arange(int(DURATION * RATE)) / RATE


def drive(name: str, rng: np.random.Generator) -> np.ndarray:
    """Volts (20000,) of the experiment ``name``; multisine, steps and fast are drawn anew for each bench."""
    return _SHAPES[name](times(), rng)


def _triangle(t: np.ndarray, _: np.random.Generator) -> np.ndarray:
    phase = (t / 10.0) % 1.0
    return -0.9 * np.where(phase < 0.25, 4 * phase, np.where(phase < 0.75, 2 - 4 * phase, 4 * phase - 4))


def _multisine(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Odd lines of 1/20 Hz up to 8 Hz, falling off beyond 2 Hz, 3 V peak."""
    lines = (2 * np.arange(80) + 1) / DURATION
    size = 1.0 / np.sqrt(1.0 + (lines / 2.0) ** 2)
    u = (size[:, None] * np.cos(2 * np.pi * lines[:, None] * t + rng.uniform(0, 2 * np.pi, 80)[:, None])).sum(0)
    return 3.0 * u / np.abs(u).max()


def _chirp(t: np.ndarray, _: np.random.Generator) -> np.ndarray:
    k = np.log(10.0 / 0.1) / DURATION
    return 2.5 * np.sin(2 * np.pi * 0.1 / k * (np.exp(k * t) - 1.0))


def _steps(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Every half second a level, in pairs that nearly undo each other."""
    first = rng.uniform(-5.0, 5.0, 20)
    levels = np.stack([first, -first * rng.uniform(0.7, 1.3, 20)], axis=1).ravel()
    return levels[(t / 0.5 + 1e-9).astype(int)]


def _fast(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A square wave of 0.45 Hz whose amplitude changes every second: large strokes."""
    size = rng.uniform(3.5, 9.0, 20)[(t + 1e-9).astype(int)]
    return size * np.sign(np.sin(2 * np.pi * 0.45 * t))


def _long(t: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return 4.5 * np.sin(2 * np.pi * 0.09 * t)


_SHAPES = {"triangle": _triangle, "multisine": _multisine, "chirp": _chirp, "steps": _steps, "fast": _fast,
           "long": _long}  # fmt: skip
