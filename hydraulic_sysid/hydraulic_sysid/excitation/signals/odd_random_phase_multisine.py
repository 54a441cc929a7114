"""Odd lines of a band with some left out, which show what a nonlinear plant puts there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.excitation.settings import integer, number
from hydraulic_sysid.excitation.signals._base import Signal
from hydraulic_sysid.excitation.signals.multisine import random_phases, sum_of_tones


@dataclass(frozen=True)
class OddRandomPhaseMultisine(Signal):
    """Odd multiples of 1/`period` within a band, one amplitude, random phases; of every `group` neighbours one is
    left out at random.

    A linear plant answers on the lines that are played. An even nonlinearity (gain that depends on the direction)
    answers on even lines, an odd one (friction, dead band, saturation) on odd ones: the *detection lines*, even lines
    and the odd ones left out, show both apart from each other, and from the noise, which differs between periods.

    Realisations that shall be averaged differ in `seed` and share `lines_seed`.

    Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., 2012, sec. 4.3.
    """

    label = "odd_random_phase_multisine"

    rms: float = number("V", "effective value of the sum", above=0.0, maximum=DRIVE_LIMIT_V)
    period: float = number("s", "period; its inverse is the distance of the lines", above=0.0, maximum=3600.0)
    frequency_min: float = number("Hz", "lower end of the band", above=0.0, maximum=1000.0)
    frequency_max: float = number("Hz", "upper end of the band", above=0.0, maximum=1000.0)
    group: int = integer("odd neighbours of which one is left out", 3, minimum=2, maximum=1000)
    seed: int = integer("draws the phases", 0, minimum=0, maximum=2**32 - 1)
    lines_seed: int = integer("draws the lines that are left out", 0, minimum=0, maximum=2**32 - 1)

    def check(self) -> None:
        if not self.excited().size:
            allowed = f"a band that holds {self.group} odd multiples of 1/period = {1 / self.period:g} Hz at least"
            raise self.error("frequency_max", self.frequency_max, allowed)

    def _odd(self) -> Index:
        """The odd harmonics of the band."""
        slack = 1e-9  # a band that ends on a line includes it
        first = math.ceil(self.frequency_min * self.period - slack)
        last = math.floor(self.frequency_max * self.period + slack)
        found = np.arange(first, last + 1)
        return found[found % 2 == 1]

    def left_out(self) -> Index:
        """The odd harmonics that are left out, one of each whole group, (G,)."""
        odd = self._odd()
        groups = odd.size // self.group
        picks = np.random.Generator(np.random.PCG64(self.lines_seed)).integers(0, self.group, groups)
        return odd[np.arange(groups) * self.group + picks]

    def excited(self) -> Index:
        """The harmonics that are played, (K,)."""
        odd = self._odd()
        return np.setdiff1d(odd, self.left_out()) if odd.size >= self.group else odd[:0]

    def lines(self) -> Array:
        """The frequencies [Hz] that are played, (K,)."""
        return np.asarray(self.excited() / self.period, dtype=np.float64)

    @property
    def highest_frequency(self) -> float:
        return self.frequency_max

    def sample(self, t: Array) -> Array:
        lines = self.lines()
        amplitudes = np.full(lines.size, self.rms * math.sqrt(2 / lines.size))
        return sum_of_tones(t, lines, amplitudes, random_phases(lines.size, self.seed))
