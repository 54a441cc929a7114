"""Sum of chosen tones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import choice, integer, numbers
from hydraulic_sysid.excitation.signals._base import Signal
from hydraulic_sysid.excitation.signals._lines import random_phases, sum_of_tones


@dataclass(frozen=True)
class Multisine(Signal):
    """u(t) = Σ A_k·sin(2π·f_k·t + φ_k) over the tones that are named.

    With three tones at 0.1, 0.5 and 2 times the bandwidth, one amplitude and zero phases it is the multisine
    of Nisar & Munawar. Schroeder phases, φ_k = −π·k·(k−1)/K, lower the peak of neighbouring lines of one
    amplitude [1]; random phases are drawn evenly from 0 … 2π with `seed`.

    [1] M. R. Schroeder, IEEE Trans. Information Theory 16(1), 1970, pp. 85–89.
    """

    frequencies: tuple[float, ...] = numbers("Hz", "the tones", minimum=1e-4, maximum=1000.0)
    amplitudes: tuple[float, ...] = numbers(
        "V", "peak of each tone; one value serves all", minimum=0.0, maximum=DRIVE_LIMIT_V
    )
    phases: str = choice("phases of the tones", ("zero", "schroeder", "random"), "zero")
    seed: int = integer("draws the random phases", 0, minimum=0, maximum=2**32 - 1)

    def check(self) -> None:
        if len(self.amplitudes) not in (1, len(self.frequencies)):
            allowed = f"one value, or as many as there are frequencies ({len(self.frequencies)})"
            raise self.error("amplitudes", list(self.amplitudes), allowed)
        if len(set(self.frequencies)) < len(self.frequencies):
            raise self.error("frequencies", list(self.frequencies), "each frequency once")

    @property
    def highest_frequency(self) -> float:
        return max(self.frequencies)

    def phase_angles(self) -> Array:
        """The phases φ_k [rad], (K,)."""
        count = len(self.frequencies)
        if self.phases == "random":
            return random_phases(count, self.seed)
        k = np.arange(1, count + 1)
        return -np.pi * k * (k - 1) / count if self.phases == "schroeder" else np.zeros(count)

    def sample(self, t: Array) -> Array:
        amplitudes = np.broadcast_to(self.amplitudes, len(self.frequencies))
        return sum_of_tones(t, np.array(self.frequencies), amplitudes, self.phase_angles())
