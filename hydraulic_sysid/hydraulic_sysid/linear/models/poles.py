"""Poles of a model, sampled or continuous, with what they mean to an engineer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Pole:
    """One pole: where it lies in its plane, and what it means in continuous time (s = ln(z)/T of a sampled model)."""

    value: complex
    """z of a sampled model, s [rad/s] of a continuous one."""
    natural_frequency: float
    """|s|/(2π) in Hz."""
    damping: float
    """−Re(s)/|s|; 1 for a real stable pole, 0 for an undamped one or a pure integrator."""
    stable: bool
    """True strictly inside the unit circle or the left half plane."""
    sampled: bool = True


def sampled_poles(denominator: ArrayLike, dt: float) -> tuple[Pole, ...]:
    """Poles, slowest first, of a denominator in descending powers of z; ``dt`` in seconds."""
    return poles_at(np.roots(np.asarray(denominator, dtype=float)), dt)


def poles_at(values: ArrayLike, dt: float) -> tuple[Pole, ...]:
    """The poles at these places of the z plane, slowest first; ``dt`` in seconds."""
    found = []
    for z in np.asarray(values, dtype=complex):
        s = np.log(complex(z)) / dt if z != 0.0 else complex(-np.inf)
        found.append(Pole(complex(z), *_meaning(s), bool(abs(z) < 1.0), True))
    return _sorted(found)


def continuous_poles(denominator: ArrayLike) -> tuple[Pole, ...]:
    """Poles, slowest first, of a denominator in descending powers of s."""
    roots = np.roots(np.asarray(denominator, dtype=float))
    return _sorted([Pole(complex(s), *_meaning(complex(s)), bool(s.real < 0.0), False) for s in roots])


def _meaning(s: complex) -> tuple[float, float]:
    size = abs(s)
    damping = float(-s.real / size) if 0.0 < size < np.inf else (1.0 if size else 0.0)
    return float(size / (2.0 * np.pi)), damping


def _sorted(poles: list[Pole]) -> tuple[Pole, ...]:
    return tuple(sorted(poles, key=lambda p: (p.natural_frequency, p.value.imag)))
