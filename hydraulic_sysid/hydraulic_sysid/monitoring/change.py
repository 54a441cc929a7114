"""A test for change: a self-starting CUSUM chart, whose rate of false alarms is chosen.

Hawkins (1987), Self-starting CUSUM charts, The Statistician 36, 299–315: each value is compared with the mean of those
before it; that ratio follows Student's t, is turned into a normal deviate, and summed beyond an allowance. The
threshold follows from the wanted run length without change by Siegmund (1985), Sequential Analysis, ch. 2:
ARL ≈ (exp(b) − b − 1)/(2·k²), b = 2·k·(h + 1.166).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from hydraulic_sim.arrays import Array

from .random_effects import pooled

ALLOWANCE = 0.5
"""Half the change [standard deviations] that the chart is quickest to find; 1 is usual (Page 1954)."""
_LARGEST = 8.0  # normal deviate of a value that no normal distribution has
_CORRECTION = 1.166  # of the threshold, for steps in place of a continuous path


@dataclass(frozen=True)
class Alarm:
    """A change: the bag at which the chart raised it, the first bag after the onset, and the direction, ±1."""

    at: int
    onset: int
    direction: int


@dataclass(frozen=True)
class Chart:
    """The chart of one parameter over n bags: sums upwards and downwards (n,), threshold, first alarm or None.

    ``deviates`` (n,) are the normal deviates of each bag from those before it; NaN within the baseline.
    """

    up: Array
    down: Array
    deviates: Array
    threshold: float
    alarm: Alarm | None


def threshold(run_length: float) -> float:
    """Threshold of one side of a chart at which a false alarm comes once in ``run_length`` values (> 1)."""
    k = ALLOWANCE

    def off(h: float) -> float:
        b = 2.0 * k * (h + _CORRECTION)
        return float((np.exp(b) - b - 1.0) / (2.0 * k * k)) - run_length

    return float(optimize.brentq(off, 0.0, 50.0)) if off(0.0) < 0.0 else 0.0


def chart(values: Array, errors: Array, run_length: float, baseline: int) -> Chart:
    """The chart of a parameter's ``values`` (n,) with standard ``errors`` (n,), bag by bag.

    :param run_length: bags without change until a false alarm, both directions together
    :param baseline: bags at the beginning that raise no alarm, at least 3
    """
    limit = threshold(2.0 * run_length)
    up, down = np.zeros(len(values)), np.zeros(len(values))
    deviates = np.full(len(values), np.nan)
    alarm = None
    for k in range(baseline, len(values)):
        before = slice(0, alarm.onset if alarm else k)  # what has changed is no baseline
        known = pooled(values[before], errors[before])
        ratio = known.distance(float(values[k]), float(errors[k]))
        deviate = float(stats.norm.ppf(stats.t.cdf(-abs(ratio), known.count - 1)))
        deviates[k] = np.copysign(min(-deviate, _LARGEST), ratio)
        up[k] = max(0.0, up[k - 1] + deviates[k] - ALLOWANCE)
        down[k] = max(0.0, down[k - 1] - deviates[k] - ALLOWANCE)
        if alarm is None and max(up[k], down[k]) > limit:
            side, direction = (up, 1) if up[k] > down[k] else (down, -1)
            quiet = np.flatnonzero(side[:k] == 0.0)
            alarm = Alarm(k, int(quiet[-1]) + 1, direction)
    return Chart(up, down, deviates, limit, alarm)
