"""What records show by themselves: lines in the spectrum of what a model leaves, and the position's resolution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from hydraulic_sysid.noise import code_step

from .anchor import Anchor
from .candidates import Hints

Array = NDArray[np.floating]

STANDS_OUT = 30.0  # power of a line over the median around it
_AROUND = 201  # bins
_MOST = 2
_SLOWEST = 2.0  # Hz, slower is drift within a piece


def hints(anchor: Anchor) -> Hints:
    """Lines, and the step between position readings that all records share (0 where they have none)."""
    steps = [code_step(p.record["position"]) for p in anchor.split.pieces]
    shared = float(np.median(steps)) if max(steps) < 1.01 * min(steps) else 0.0
    return Hints(spectral_lines(anchor), shared)


def spectral_lines(anchor: Anchor) -> tuple[float, ...]:
    """The strongest lines [Hz], at most two. Records shorter than a second show none."""
    found: list[tuple[float, float]] = []
    for pieces, residual in zip(anchor.split.pieces, anchor.residual, strict=True):
        values = residual[:, : -len(pieces.free)].reshape(len(pieces.starts), pieces.samples, len(pieces.channels))
        run = values[:, :-1].reshape(-1, len(pieces.channels))
        if len(run) < 5 * _AROUND:
            continue
        window = np.hanning(len(run))[:, None]
        power = np.sum(np.abs(np.fft.rfft(run * window, axis=0)) ** 2, axis=1)
        frequency = np.fft.rfftfreq(len(run), pieces.record.dt)
        ratio = np.where(frequency > _SLOWEST, power / np.maximum(median_filter(power, _AROUND), 1e-300), 0.0)
        best = int(np.argmax(ratio))
        if ratio[best] > STANDS_OUT:
            found.append((float(ratio[best]), _peak(frequency, np.asarray(power, dtype=float), best)))
    distinct: list[float] = []
    for _, f in sorted(found, reverse=True):
        if all(abs(f - other) > 0.02 * other for other in distinct):
            distinct.append(f)
    return tuple(distinct[:_MOST])


def _peak(frequency: Array, power: Array, best: int) -> float:
    """The line's frequency by a parabola through the logarithms beside the largest bin."""
    if not 0 < best < len(power) - 1:
        return float(frequency[best])
    a, b, c = np.log(np.maximum(power[best - 1 : best + 2], 1e-300))
    return float(frequency[best] + 0.5 * (a - c) / (a - 2.0 * b + c) * (frequency[1] - frequency[0]))
