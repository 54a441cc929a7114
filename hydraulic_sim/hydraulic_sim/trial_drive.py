"""A short drive on which a model's integration step is tried before anything relies on it."""

from __future__ import annotations

import numpy as np

from .model import Model
from .trajectory import Array


def trial_drive(model: Model, rate: float) -> Array:
    """Half a second of a sweep from 1 to 40 Hz at a third of the drive, (N,) [V], sampled at ``rate`` [Hz]."""
    t = np.arange(max(2, round(0.5 * rate))) / rate
    return model.value("drive_limit") / 3.0 * np.sin(2.0 * np.pi * (1.0 + 39.0 * t) * t)
