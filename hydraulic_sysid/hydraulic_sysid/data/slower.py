"""Records at a lower rate: smoothed against aliases without a shift, the drive as its mean over each interval."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import convolve1d

from hydraulic_sim.arrays import Array

from .records.channels import HELD
from .records.record import Record

ALREADY = "decimation"


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
    description = {**record.description, ALREADY: factor}
    found = Record.sampled(record.name, factor * record.dt, channels, record.source, description, record.units)
    return found


def _mean(values: Array, factor: int, count: int) -> Array:
    return values[: count * factor].reshape(count, factor).mean(axis=1)


def _smooth(values: Array, factor: int) -> Array:
    mean = np.full(factor, 1.0 / factor)
    kernel = np.convolve(np.convolve(mean, mean), mean)
    if kernel.size % 2 == 0:  # an even factor: half a sample to either side
        kernel = np.convolve(kernel, [0.5, 0.5])
    return np.asarray(convolve1d(values, kernel, mode="nearest"))
