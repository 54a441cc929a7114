"""Whether what a model leaves is white once the noise model has taken its colour out (Ljung & Box 1978)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hydraulic_sim.arrays import Array

from .criteria import CRITERIA
from .holdout import Split

LAGS = 20  # samples


@dataclass(frozen=True)
class Whiteness:
    """Of one channel's whitened residual, over all segments: ``correlation`` is the largest, at ``lag`` [s].

    ``statistic`` of Ljung and Box over `LAGS` lags and its ``p_value``; ``rms`` [over the noise].
    """

    channel: str
    rms: float
    correlation: float
    lag: float
    statistic: float
    p_value: float

    @property
    def coloured(self) -> bool:
        """By more than a noise model misses."""
        return abs(self.correlation) > CRITERIA.coloured


def whiteness(split: Split, residual: Sequence[Array]) -> list[Whiteness]:
    """Per channel, over all records, of whitened residuals (S, m) each."""
    found = []
    for channel in split.channels:
        products, squares, count, dt = np.zeros(LAGS), 0.0, 0, 0.0
        for segments, own in zip(split.segments, residual, strict=True):
            if channel not in segments.channels:
                continue
            c = segments.channels.index(channel)
            values, dt = segments.by_channel(own)[:, :, c], segments.record.dt
            squares += float(np.sum(values**2))
            count += int(np.sum(~segments.outliers[:, :, c]))
            lags = min(LAGS, values.shape[1] - 1)
            products[:lags] += [np.sum(values[:, k:] * values[:, :-k]) for k in range(1, lags + 1)]
        correlation = products / max(squares, 1e-300)
        most = int(np.argmax(np.abs(correlation)))
        statistic = float(count * (count + 2) * np.sum(correlation**2 / (count - np.arange(1, LAGS + 1))))
        rms = float(np.sqrt(squares / max(count, 1)))
        p_value = float(chi2.sf(statistic, LAGS))
        found.append(Whiteness(channel, rms, float(correlation[most]), (most + 1) * dt, statistic, p_value))
    return found
