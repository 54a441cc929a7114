"""Spectra of measured signals, errors and noise, in bands that suit a logarithmic axis."""

from __future__ import annotations

import numpy as np
from scipy.signal import freqz, welch

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

SEGMENT_SECONDS = 5.0
BANDS_PER_DECADE = 30


def amplitude_density(signal: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and one-sided amplitude spectral density [unit/√Hz] of a signal ``(N,)``.

    Welch's method, Hann window, segments of five seconds with half overlap, means removed; then the power is
    averaged in bands of a thirtieth of a decade.
    """
    finite = signal[np.isfinite(signal)]
    segment = min(finite.size, max(8, int(round(SEGMENT_SECONDS / dt))))
    frequency, power = welch(finite, 1.0 / dt, nperseg=segment)
    return band_average(frequency[1:], power[1:])


def band_average(frequency: Array, power: Array) -> tuple[Array, Array]:
    """Mean frequency and root mean power of each logarithmic band that holds a line."""
    band = np.floor(np.log10(frequency / frequency[0]) * BANDS_PER_DECADE + 1e-9).astype(np.int64)
    _, index, count = np.unique(band, return_inverse=True, return_counts=True)
    mean_f = np.bincount(index, frequency) / count
    return mean_f, np.sqrt(np.bincount(index, power) / count)


def noise_density(frequency: Array, sigma: float, dt: float, derivative: VelocityFilter | None = None) -> Array:
    """Amplitude density of white noise, standard deviation ``sigma``: σ·√(2·dt), times the derivative's gain."""
    level = np.full(frequency.shape, sigma * np.sqrt(2.0 * dt))
    if derivative is None:
        return level
    _, response = freqz(derivative.weights, worN=2.0 * np.pi * np.minimum(frequency * dt, 0.5))
    return level * np.abs(response)


def power_shares(frequency: Array, density: Array, noise: Array, limits: tuple[float, ...]) -> list[float]:
    """Shares of the error power above the noise between successive limits [Hz]; zeros if there is none."""
    width = np.gradient(frequency) if frequency.size > 1 else np.ones(1)
    excess = np.maximum(density**2 - noise**2, 0.0) * width
    total = float(excess.sum())
    edges = (0.0, *limits, np.inf)
    pairs = zip(edges[:-1], edges[1:], strict=True)
    parts = [float(excess[(frequency >= lo) & (frequency < hi)].sum()) for lo, hi in pairs]
    return [p / total if total > 0.0 else 0.0 for p in parts]
