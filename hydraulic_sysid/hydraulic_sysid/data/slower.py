"""Records at a lower rate: smoothed against aliases without a shift, the drive as its mean over each interval."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import convolve1d

from hydraulic_sim.arrays import Array

from .records.channels import HELD
from .records.record import Record


def slower(record: Record, factor: int) -> Record:
    """Every ``factor``-th sample of a record.

    What is measured is smoothed by a cubic spline three new intervals wide, centred on the sample that is kept. What
    is held until the next sample (drive, command) is averaged over the interval that the sample stands for.
    """
    if factor <= 1:
        return record
    count = len(record) // factor
    channels = {
        name: _mean(values, factor, count) if name in HELD else _smooth(values, factor)[: count * factor : factor]
        for name, values in record.channels.items()
    }
    description = {**record.description, "decimation": factor}
    return Record.sampled(record.name, factor * record.dt, channels, record.source, description, record.units)


def spline(factor: int) -> Array:
    """Weights of the cubic spline that is three times ``factor`` samples wide: three running means."""
    mean = np.full(factor, 1.0 / factor)
    return np.asarray(np.convolve(np.convolve(mean, mean), mean), dtype=np.float64)


def _mean(values: Array, factor: int, count: int) -> Array:
    return values[: count * factor].reshape(count, factor).mean(axis=1)


def _smooth(values: Array, factor: int) -> Array:
    kernel = spline(factor)
    if kernel.size % 2 == 0:  # an even factor: half a sample to either side
        kernel = np.asarray(np.convolve(kernel, [0.5, 0.5]), dtype=np.float64)
    return np.asarray(convolve1d(values, kernel, mode="nearest"))
