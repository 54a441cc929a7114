"""What multisines share: tones, random phases, and lines of one amplitude within a band."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.excitation.declared import number
from hydraulic_sysid.excitation.signals._base import Signal


def random_phases(count: int, seed: int) -> Array:
    """`count` phases [rad], even in 0 … 2π; the same for the same `seed` on every machine."""
    return np.random.Generator(np.random.PCG64(seed)).uniform(0.0, 2 * np.pi, count)


def sum_of_tones(t: Array, frequencies: Array, amplitudes: Array, phases: Array) -> Array:
    """Σ A_k·sin(2π·f_k·t + φ_k) at the times `t` [s]; tone by tone, so that memory stays that of `t`."""
    total = np.zeros(np.shape(t))
    for frequency, amplitude, phase in zip(frequencies, amplitudes, phases, strict=True):
        total += amplitude * np.sin(2 * np.pi * frequency * np.asarray(t) + phase)
    return total


@dataclass(frozen=True)
class BandOfLines(Signal):
    """Multiples of 1/`period` within a band, all of one amplitude."""

    rms: float = number("V", "effective value of the sum", above=0.0, maximum=DRIVE_LIMIT_V)
    period: float = number("s", "period; its inverse is the distance of the lines", above=0.0, maximum=3600.0)
    frequency_min: float = number("Hz", "lower end of the band", above=0.0, maximum=1000.0)
    frequency_max: float = number("Hz", "upper end of the band", above=0.0, maximum=1000.0)

    def band(self) -> Index:
        """All harmonics of the period within the band."""
        slack = 1e-9  # a band that ends on a line includes it
        first = math.ceil(self.frequency_min * self.period - slack)
        return np.arange(first, math.floor(self.frequency_max * self.period + slack) + 1)

    def excited(self) -> Index:
        """The harmonics that are played, (K,)."""
        return self.band()

    def lines(self) -> Array:
        """The frequencies [Hz] that are played, (K,)."""
        return np.asarray(self.excited() / self.period, dtype=np.float64)

    def phase_angles(self) -> Array:
        """The phases [rad] of the lines, (K,)."""
        raise NotImplementedError

    @property
    def highest_frequency(self) -> float:
        return self.frequency_max

    def sample(self, t: Array) -> Array:
        lines = self.lines()
        amplitudes = np.full(lines.size, self.rms * math.sqrt(2 / lines.size))
        return sum_of_tones(t, lines, amplitudes, self.phase_angles())
