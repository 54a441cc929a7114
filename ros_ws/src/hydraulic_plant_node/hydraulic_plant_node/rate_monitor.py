"""How well a periodic loop keeps its deadlines: rate, period jitter, overruns; lately and since the start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Jitter of the whole run is kept as counts per microsecond; what is longer than this is counted in the last
# bin.
_BIN_NS = 1000
_BINS = 20_000


@dataclass(frozen=True)
class RateReport:
    """Timing of a loop; times in s, `rate` in Hz. NaN where fewer than two ticks were seen.

    Jitter is the deviation of the period between two ticks from the nominal one, as a magnitude: `jitter_*`
    over the last ticks, `run_jitter_*` since the start. `lateness_max` is the largest delay behind a deadline
    lately. The counters run since the start.
    """

    rate: float = math.nan
    jitter_p50: float = math.nan
    jitter_p99: float = math.nan
    jitter_max: float = math.nan
    lateness_max: float = math.nan
    run_jitter_p50: float = math.nan
    run_jitter_p99: float = math.nan
    run_jitter_max: float = math.nan
    ticks: int = 0
    overruns: int = 0
    skipped: int = 0


class RateMonitor:
    """Collects the tick times of a loop of `period_ns`; `window` ticks count as "lately".

    `tick` is called by the loop, `report` by anybody: at worst it sees a window in which one tick is missing.
    """

    def __init__(self, period_ns: int, window: int = 2000) -> None:
        if period_ns <= 0 or window < 2:
            raise ValueError(f"period is {period_ns} ns and window {window} ticks; need > 0 and >= 2")
        self.period_ns = period_ns
        self.ticks = 0
        self.overruns = 0
        self.skipped = 0
        self._window = window
        self._times = [0] * window
        self._late = [0] * window
        self._histogram = [0] * (_BINS + 1)
        self._last_ns = 0
        self._worst_ns = 0

    def tick(self, due_ns: int, actual_ns: int, skipped: int = 0) -> None:
        """Note a tick due at `due_ns` that happened at `actual_ns`, after `skipped` abandoned ones."""
        late = actual_ns - due_ns
        slot = self.ticks % self._window
        self._times[slot] = actual_ns
        self._late[slot] = late
        if self.ticks:
            jitter = abs(actual_ns - self._last_ns - self.period_ns)
            self._histogram[min(jitter // _BIN_NS, _BINS)] += 1
            self._worst_ns = max(self._worst_ns, jitter)
        self._last_ns = actual_ns
        self.ticks += 1
        self.overruns += late >= self.period_ns
        self.skipped += skipped

    def report(self) -> RateReport:
        """Timing lately and since the start."""
        count = min(self.ticks, self._window)
        if count < 2:
            return RateReport(ticks=self.ticks, overruns=self.overruns, skipped=self.skipped)
        times = np.sort(np.array(self._times[:count]))
        jitter = np.abs(np.diff(times) - self.period_ns) * 1e-9
        p50, p99 = np.percentile(jitter, [50, 99])
        return RateReport(
            rate=float((count - 1) * 1e9 / max(times[-1] - times[0], 1)),
            jitter_p50=float(p50),
            jitter_p99=float(p99),
            jitter_max=float(jitter.max()),
            lateness_max=max(self._late[:count]) * 1e-9,
            run_jitter_p50=self._quantile(0.5),
            run_jitter_p99=self._quantile(0.99),
            run_jitter_max=self._worst_ns * 1e-9,
            ticks=self.ticks,
            overruns=self.overruns,
            skipped=self.skipped,
        )

    def _quantile(self, share: float) -> float:
        totals = np.cumsum(self._histogram)
        return (int(np.searchsorted(totals, share * totals[-1])) + 1) * _BIN_NS * 1e-9
