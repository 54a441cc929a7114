"""Pseudo-random binary sequence."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import choice, integer, number
from hydraulic_sysid.excitation.signals._base import Signal, amplitude


@dataclass(frozen=True)
class Prbs(Signal):
    """±A after a maximum-length sequence of 2^order − 1 bits, each held for `clock`, then over again.

    Crest factor 1. The spectrum falls as (sin(πfτ)/(πfτ))² with the clock τ: by 3 dB at 0.44/τ, its lines lie
    1/((2^order − 1)·τ) apart. With `inverse_repeat` every other bit changes its sign, over two sequences: the second
    half is then the first turned over, only odd lines are left, and even distortion falls between them [1].

    [1] K. Godfrey, *Perturbation Signals for System Identification*, Prentice Hall 1993, ch. 1.
    """

    amplitude: float = amplitude("height of both levels")
    clock: float = number("s", "how long a bit stands", above=0.0, maximum=3600.0)
    order: int = integer("of the shift register", 8, minimum=2, maximum=20)
    inverse_repeat: str = choice("every other bit with the sign changed, over two sequences", ("no", "yes"), "no")
    seed: int = integer("where in the sequence it starts", 0, minimum=0, maximum=2**32 - 1)

    @cached_property
    def bits(self) -> Array:
        """The levels [V] of one period, (2^order − 1,), twice that of an inverse repeat."""
        from scipy.signal import max_len_seq  # only here: it takes longer to load than a node has to start

        sequence, _ = max_len_seq(self.order)
        levels = np.roll(self.amplitude * (2.0 * sequence - 1.0), -(self.seed % sequence.size))
        if self.inverse_repeat == "no":
            return levels
        twice = np.tile(levels, 2)
        twice[1::2] *= -1.0
        return twice

    @property
    def period(self) -> float:
        """Seconds after which it repeats."""
        return self.bits.size * self.clock

    @property
    def length(self) -> float:
        return self.period

    @property
    def highest_frequency(self) -> float:
        return 1.0 / self.clock  # a bit must last for two samples at least

    def sample(self, t: Array) -> Array:
        slack = 1e-9  # a sample that falls on an edge belongs to the new bit, whatever the rounding
        return self.bits[np.floor(np.asarray(t) / self.clock + slack).astype(int) % self.bits.size]
