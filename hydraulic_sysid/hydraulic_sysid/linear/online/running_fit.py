"""How well one step ahead a running model fits of late: best fit with forgetting."""

from __future__ import annotations

import math


class RunningFit:
    """Best fit 100·(1 − √(Σe²/Σ(y − ȳ)²)), every sum with the weight λⁿ of a sample n samples ago."""

    def __init__(self, forgetting: float) -> None:
        self.forgetting = forgetting
        self._weight = self._mean = self._spread = self._squares = 0.0

    def take(self, measured: float, predicted: float) -> None:
        """One more sample."""
        keep = self.forgetting
        before = self._weight
        self._weight = keep * before + 1.0
        away = measured - self._mean
        self._mean += away / self._weight
        # West's update of a weighted variance (Comm. ACM 22 (1979) 532–535), with decaying weights.
        self._spread = keep * self._spread + away * (measured - self._mean)
        self._squares = keep * self._squares + (measured - predicted) ** 2

    @property
    def best_fit(self) -> float:
        """Percent; NaN before the output has moved."""
        return 100.0 * (1.0 - math.sqrt(self._squares / self._spread)) if self._spread > 0.0 else math.nan

    @property
    def rms(self) -> float:
        """Root mean square of the error of late, in the output's unit; NaN before the first sample."""
        return math.sqrt(self._squares / self._weight) if self._weight else math.nan
