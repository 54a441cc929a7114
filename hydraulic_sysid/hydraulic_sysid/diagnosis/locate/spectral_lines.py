"""Frequencies that all records show whatever was played: a pump, a regulator, a machine next door."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from hydraulic_sim.arrays import Array

_MOST = 3  # lines
_HEIGHT = 12.0  # of the median over records, above the spectrum around: noise reaches 5 in 10⁴ frequencies
_AROUND = 41  # lines of the spectrum around, over whose median a line stands
_LOWEST = 0.3  # Hz
_PADDED = 4  # times as many frequencies as samples give: their phase must hold over a record
_FEWEST = 2  # records: in a single one a line may be that of the excitation


def common_lines(white: Sequence[Array], rate: float) -> list[float]:
    """Frequencies [Hz] of lines in the whitened balances ``(B, m)`` of most records, the strongest first."""
    if len(white) < _FEWEST:
        return []
    size = _PADDED * max(w.shape[1] for w in white)
    window = [np.hanning(w.shape[1]) for w in white]
    heights = []
    for w, taper in zip(white, window, strict=True):
        power = np.sum(np.abs(np.fft.rfft(w * taper, size, axis=1)) ** 2, axis=0)
        heights.append(power / np.maximum(median_filter(power, _PADDED * _AROUND, mode="nearest"), 1e-300))
    common = np.median(heights, axis=0)
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    common[frequency < _LOWEST] = 0.0
    found: list[float] = []
    while len(found) < _MOST:
        top = int(np.argmax(common))
        if common[top] < _HEIGHT:
            break
        found.append(float(frequency[top]))
        common[max(0, top - 4 * _PADDED) : top + 4 * _PADDED + 1] = 0.0
    return found


def waves(lines: Sequence[float], time: Array, record: int, records: int) -> Array:
    """Cosine and sine of every line, of a phase of its own in every record: ``(2·L·records, n)``, others' rows zero."""
    phase = 2.0 * np.pi * np.array(lines).reshape(-1, 1) * time
    found = np.zeros((records, 2 * len(lines), time.size))
    found[record] = np.concatenate((np.cos(phase), np.sin(phase)))
    return found.reshape(-1, time.size)
