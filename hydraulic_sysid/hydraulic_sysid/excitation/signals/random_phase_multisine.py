"""Every line of a band, with random phases."""

from __future__ import annotations

from dataclasses import dataclass

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.crest import low_crest_phases
from hydraulic_sysid.excitation.declared import choice, integer
from hydraulic_sysid.excitation.signals._lines import BandOfLines, random_phases


@dataclass(frozen=True)
class RandomPhaseMultisine(BandOfLines):
    """All multiples of 1/`period` within a band, one amplitude, phases drawn evenly from 0 … 2π with `seed`.

    Its spectrum is flat in the band and zero outside it; over whole periods no line leaks into another. Its
    values are close to normally distributed: the peak is about three to four times the effective value. With
    `crest: low` the phases start from the random ones and are changed until the peak is about 1.5 times the
    effective value: more drive within the same limits. For the best linear approximation keep them random, it
    belongs to a distribution of the drive.

    Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., 2012, ch.
    5.
    """

    seed: int = integer("draws the phases", 0, minimum=0, maximum=2**32 - 1)
    crest: str = choice("random phases, or changed for a low crest factor", ("random", "low"), "random")

    def check(self) -> None:
        if not self.lines().size:
            allowed = f"a band that holds at least one multiple of 1/period = {1 / self.period:g} Hz"
            raise self.error("frequency_max", self.frequency_max, allowed)

    def phase_angles(self) -> Array:
        phases = random_phases(self.excited().size, self.seed)
        return phases if self.crest == "random" else low_crest_phases(self.excited(), phases)
