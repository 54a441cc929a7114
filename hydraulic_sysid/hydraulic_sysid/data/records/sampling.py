"""Whether time stamps are evenly spaced, and the period if they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array, Index

MAX_DEVIATION = 0.5
"""Of a stamp from the even grid, in periods: beyond it the stamp might belong to another sample."""
P99_DEVIATION = 0.25
"""The same for 99 % of the stamps: beyond it the record is not sampled evenly enough to be taken so."""
_SAME = 1e-6


class IrregularTimeError(HydraulicError):
    """Stamps that are not evenly spaced: ``index`` of the first bad one, the problem, what was expected."""

    def __init__(self, index: int, problem: str, expected: str) -> None:
        self.index, self.problem, self.expected = index, problem, expected
        super().__init__(f"sample {index + 1}: {problem}; expected {expected}")


@dataclass(frozen=True)
class Sampling:
    """Period ``dt`` and the largest and 99 % deviation of the stamps from the even grid; all in seconds."""

    dt: float
    deviation_p99: float
    deviation_max: float


def increasing(time: Array) -> None:
    """Check that stamps ``(N,)`` in seconds are finite and increase.

    :raises IrregularTimeError: naming the first that does not.
    """
    if not np.isfinite(time).all():
        index = int(np.flatnonzero(~np.isfinite(time))[0])
        raise IrregularTimeError(index, f"the time is {time[index]}", "a number")
    steps = np.diff(time)
    if (steps > 0.0).all():
        return
    index = int(np.flatnonzero(steps <= 0.0)[0])
    if steps[index] == 0.0:
        problem = f"the time {time[index]:.9g} s is there twice"
    else:
        problem = f"the time goes back from {time[index]:.9g} s to {time[index + 1]:.9g} s"
    raise IrregularTimeError(index + 1, problem, "increasing time")


def gaps(time: Array) -> list[int]:
    """Indices of the samples of increasing stamps before which at least one sample is missing."""
    return [int(index) + 1 for index in np.flatnonzero(_periods(time)[0] > 1)]


def sampling(time: Array) -> Sampling:
    """Period of evenly spaced stamps ``(N,)``, N ≥ 2, in seconds.

    The period is that of the straight line through all stamps. Of all periods that explain the stamps as
    well as that one (within the stamps' own deviation from it) it is the one with the fewest digits: stamps
    written with three decimals, or set by a jittering clock, still give 0.001 s.

    :raises IrregularTimeError: not increasing, samples missing, or deviations beyond `MAX_DEVIATION`,
        `P99_DEVIATION`.
    """
    increasing(time)
    periods, step = _periods(time)
    expected = f"one sample every {step:.6g} s"
    odd = np.flatnonzero(periods != 1)
    if odd.size:
        index = int(odd[0]) + 1
        stride = time[index] - time[index - 1]
        if periods[index - 1] > 1:
            missing = int(periods[index - 1]) - 1
            problem = f"{missing} sample{'s' * (missing > 1)} missing: {stride:.6g} s since the one before"
        else:
            problem = f"only {stride:.6g} s since the sample before"
        raise IrregularTimeError(index, problem, expected)
    count = np.arange(time.size)
    centred = count - count.mean()
    slope = float(centred @ time / (centred @ centred))
    largest = _deviation(time, slope).max()
    dt = slope
    for digits in range(1, 13):
        rounded = float(f"{slope:.{digits - 1}e}")
        if _deviation(time, rounded).max() <= 1.5 * largest + _SAME * slope:
            dt = rounded
            break
    deviation = _deviation(time, dt)
    p99, worst = float(np.percentile(deviation, 99)), int(np.argmax(deviation))
    if deviation[worst] > MAX_DEVIATION * dt or p99 > P99_DEVIATION * dt:
        raise IrregularTimeError(
            worst,
            f"the time {time[worst]:.9g} s is {deviation[worst]:.3g} s off the even grid "
            f"(99 % of all samples: {p99:.3g} s)",
            f"{expected}, at most {MAX_DEVIATION * dt:.3g} s off, 99 % at most {P99_DEVIATION * dt:.3g} s",
        )
    return Sampling(dt, p99, float(deviation[worst]))


def _periods(time: Array) -> tuple[Index, float]:
    """Whole periods between neighbours, and the period of those that are one apart."""
    steps = np.diff(time)
    median = float(np.median(steps))
    # Stamps with few decimals alternate between two steps, and the median is only one of them.
    step = float(steps[(steps > 0.5 * median) & (steps < 1.6 * median)].mean())
    return np.rint(steps / step).astype(np.int64), step


def _deviation(time: Array, dt: float) -> Array:
    offset = time - dt * np.arange(time.size)
    return np.abs(offset - 0.5 * (offset.min() + offset.max()))
