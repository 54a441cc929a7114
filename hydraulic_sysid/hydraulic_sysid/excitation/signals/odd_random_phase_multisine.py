"""Odd lines of a band with some left out, which show what a nonlinear plant puts there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.excitation.declared import integer
from hydraulic_sysid.excitation.signals._lines import BandOfLines, random_phases


@dataclass(frozen=True)
class OddRandomPhaseMultisine(BandOfLines):
    """Odd multiples of 1/`period` within a band, one amplitude, random phases.

    Of every `group` neighbours one is left out at random. A linear plant answers on the lines that are played. An even
    nonlinearity (gain that depends on the direction) answers on even lines, an odd one (friction, dead band,
    saturation) on odd ones: the *detection lines*, even lines and the odd ones left out, show both apart from each
    other, and from the noise, which differs between periods.

    Realisations that shall be averaged differ in `seed` and share `lines_seed`.

    Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., 2012, sec. 4.3.
    """

    group: int = integer("odd neighbours of which one is left out", 3, minimum=2, maximum=1000)
    seed: int = integer("draws the phases", 0, minimum=0, maximum=2**32 - 1)
    lines_seed: int = integer("draws the lines that are left out", 0, minimum=0, maximum=2**32 - 1)

    def check(self) -> None:
        if not self.excited().size:
            allowed = f"a band that holds {self.group} odd multiples of 1/period = {1 / self.period:g} Hz at least"
            raise self.error("frequency_max", self.frequency_max, allowed)

    def _odd(self) -> Index:
        """The odd harmonics of the band."""
        return self.band()[self.band() % 2 == 1]

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

    def phase_angles(self) -> Array:
        return random_phases(self.excited().size, self.seed)
