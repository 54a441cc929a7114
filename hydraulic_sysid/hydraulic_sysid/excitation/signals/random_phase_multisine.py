"""Every line of a band, with random phases."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.crest import low_crest_phases
from hydraulic_sysid.excitation.settings import choice, integer, number
from hydraulic_sysid.excitation.signals._base import Signal
from hydraulic_sysid.excitation.signals.multisine import random_phases, sum_of_tones


@dataclass(frozen=True)
class RandomPhaseMultisine(Signal):
    """All multiples of 1/`period` within a band, one amplitude, phases drawn evenly from 0 … 2π with `seed`.

    Its spectrum is flat in the band and zero outside it; over whole periods no line leaks into another. Its
    values are close to normally distributed: the peak is about three to four times the effective value. With
    `crest: low` the phases start from the random ones and are changed until the peak is about 1.5 times the
    effective value: more drive within the same limits. For the best linear approximation keep them random, it
    belongs to a distribution of the drive.

    Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., 2012, ch.
    5.
    """

    label = "random_phase_multisine"

    rms: float = number("V", "effective value of the sum", above=0.0, maximum=DRIVE_LIMIT_V)
    period: float = number("s", "period; its inverse is the distance of the lines", above=0.0, maximum=3600.0)
    frequency_min: float = number("Hz", "lower end of the band", above=0.0, maximum=1000.0)
    frequency_max: float = number("Hz", "upper end of the band", above=0.0, maximum=1000.0)
    seed: int = integer("draws the phases", 0, minimum=0, maximum=2**32 - 1)
    crest: str = choice("random phases, or changed for a low crest factor", ("random", "low"), "random")

    def check(self) -> None:
        if not self.lines().size:
            allowed = f"a band that holds at least one multiple of 1/period = {1 / self.period:g} Hz"
            raise self.error("frequency_max", self.frequency_max, allowed)

    def lines(self) -> Array:
        """The frequencies [Hz] of the lines, (K,)."""
        slack = 1e-9  # a band that ends on a line includes it
        first = math.ceil(self.frequency_min * self.period - slack)
        last = math.floor(self.frequency_max * self.period + slack)
        return np.arange(first, last + 1) / self.period

    @property
    def highest_frequency(self) -> float:
        return self.frequency_max

    def sample(self, t: Array) -> Array:
        lines = self.lines()
        amplitudes = np.full(lines.size, self.rms * math.sqrt(2 / lines.size))
        return sum_of_tones(t, lines, amplitudes, self.phase_angles())

    def phase_angles(self) -> Array:
        """The phases [rad] of the lines, (K,)."""
        lines = self.lines()
        phases = random_phases(lines.size, self.seed)
        return phases if self.crest == "random" else low_crest_phases(np.rint(lines * self.period), phases)
