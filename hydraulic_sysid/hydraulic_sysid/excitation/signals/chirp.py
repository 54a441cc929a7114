"""Swept sine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import choice, number
from hydraulic_sysid.excitation.signals._base import Signal, amplitude


@dataclass(frozen=True)
class Chirp(Signal):
    """u(t) = A·sin(φ0 + 2π∫f dt), f from `frequency_start` to `frequency_end` within `sweep_time`, then again.

    Linear: f = f0 + (f1 − f0)·t/T; exponential: f = f0·(f1/f0)^(t/T), the same time in every octave. A phase
    of 90° makes it the cosine form of Nisar & Munawar (their linear sweep, 0.1 … 2 times the bandwidth); on
    an integrating plant that moves the piston to both sides of its start, where the sine form moves it to
    one.

    Source: P. Flandrin, "Chirps everywhere", CNRS Lyon, 2002; A. Farina, AES 108th Convention, 2000, for the
    exponential law.
    """

    amplitude: float = amplitude("peak of the sweep")
    frequency_start: float = number("Hz", "frequency at the start of the sweep", above=0.0, maximum=1000.0)
    frequency_end: float = number("Hz", "frequency at the end of the sweep", above=0.0, maximum=1000.0)
    sweep_time: float = number("s", "duration of one sweep", above=0.0, maximum=3600.0)
    law: str = choice("how the frequency rises", ("exponential", "linear"), "exponential")
    phase: float = number("rad", "phase at the start of the sweep", 0.0, minimum=-2 * math.pi, maximum=2 * math.pi)

    @property
    def length(self) -> float:
        return self.sweep_time

    @property
    def highest_frequency(self) -> float:
        return max(self.frequency_start, self.frequency_end)

    @property
    def _log_ratio(self) -> float:
        return math.log(self.frequency_end / self.frequency_start) if self.law == "exponential" else 0.0

    def frequency(self, t: Array) -> Array:
        """The instantaneous frequency [Hz] at `t` [s]."""
        share = np.mod(t, self.sweep_time) / self.sweep_time
        if self._log_ratio:
            return self.frequency_start * np.exp(self._log_ratio * share)
        return self.frequency_start + (self.frequency_end - self.frequency_start) * share

    def sample(self, t: Array) -> Array:
        share = np.mod(t, self.sweep_time) / self.sweep_time
        if self._log_ratio:
            turns = self.frequency_start * self.sweep_time * np.expm1(self._log_ratio * share) / self._log_ratio
        else:
            rise = 0.5 * (self.frequency_end - self.frequency_start) * share
            turns = self.sweep_time * share * (self.frequency_start + rise)
        return self.amplitude * np.sin(self.phase + 2 * np.pi * turns)
