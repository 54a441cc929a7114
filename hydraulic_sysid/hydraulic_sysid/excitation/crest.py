"""Phases that give a multisine a low peak."""

from __future__ import annotations

import numpy as np

from hydraulic_sim.arrays import Array, Index

_STEPS = 300
_OVERSAMPLING = 16
_DIGITS = 6  # what is kept of a phase: the same on machines whose sines differ in the last bits


def crest_factor(signal: Array) -> float:
    """Peak over effective value of a signal (N,); 1 for a square wave, √2 for a sine."""
    return float(np.max(np.abs(signal)) / np.sqrt(np.mean(np.square(signal))))


def low_crest_phases(harmonics: Index, phases: Array) -> Array:
    """Phases (K,) [rad] of the sines at `harmonics` (K,) of equal amplitude, from `phases` (K,) on.

    Time-frequency swapping: clip the wave, keep the phases of what results and the amplitudes that are wanted, over
    again with a clip that rises from 0.75 to 0.95 of the peak; the best of all steps is kept.

    Source: E. Van der Ouderaa, J. Schoukens, J. Renneboog, IEEE Trans. Instrumentation and Measurement 37(1), 1988,
    pp. 145–147.
    """
    k = harmonics
    size = 1 << int(np.ceil(np.log2(_OVERSAMPLING * (k.max() + 1))))
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    best, lowest = np.asarray(phases, dtype=float), np.inf
    angle = best
    for step in range(_STEPS):
        spectrum[k] = np.exp(1j * (angle - np.pi / 2))  # a sine
        wave = np.fft.irfft(spectrum, size)
        peak = float(np.abs(wave).max())
        if peak < lowest:
            best, lowest = angle, peak
        level = (0.75 + 0.2 * step / _STEPS) * peak
        angle = np.angle(np.fft.rfft(np.clip(wave, -level, level))[k]) + np.pi / 2
    return np.round(np.mod(best, 2 * np.pi), _DIGITS)
