"""The root mean square of a signal over its last few reports."""

from __future__ import annotations

import math
from collections import deque


class RecentRms:
    """Sums of squares per report; `next` closes one and gives the RMS over the last ``reports``."""

    def __init__(self, reports: int) -> None:
        self._closed: deque[tuple[float, int]] = deque(maxlen=reports)
        self._sum, self._count = 0.0, 0

    def take(self, value: float) -> None:
        """One sample; what is not measured (NaN) is left out."""
        if math.isfinite(value):
            self._sum += value * value
            self._count += 1

    def next(self) -> float:
        """The RMS of the last reports, this one included; NaN where they have no sample."""
        self._closed.append((self._sum, self._count))
        self._sum, self._count = 0.0, 0
        count = sum(samples for _, samples in self._closed)
        return math.sqrt(sum(squares for squares, _ in self._closed) / count) if count else math.nan
