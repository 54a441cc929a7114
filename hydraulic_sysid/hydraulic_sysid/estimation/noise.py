"""How much of a signal is measurement noise, estimated from the signal alone.

Method: differences of fourth order suppress whatever moves slowly against the sampling time and keep white
noise of standard deviation σ as 70·σ² in variance (70 = Σ of the squared binomial weights 1, −4, 6, −4, 1).
The record is cut into short blocks and the *median* of the blocks' mean squares is taken, so that steps and
reversals, which fill only a few blocks, do not count. A rounded signal carries at least LSB/√12. This is the
idea of the difference-based variance estimators of von Neumann (1941) and Hall, Kay & Titterington,
Biometrika 77 (1990) 521–528.

Valid for noise that is white over the sampled band. Noise that the sensor has low-passed is underestimated,
and motion near the Nyquist frequency is counted as noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import median_filter
from scipy.special import comb
from scipy.stats import chi2

from hydraulic_sim.arrays import Array, Mask

METHOD = "median over blocks of the mean square of fourth differences (white noise), at least LSB/√12"
_STRAY = 0.01  # of the samples: those beside the lattice of the others
_BESIDE = 0.1  # of a step, from which a value lies beside it
_LEAST = (0.0, 0.01, 0.05, 0.2)  # quantiles of the steps between values, one of which is that of the lattice
_FIRST = 10.0  # steps of a lattice, by which it is measured first
_ORDER = 4
_BLOCK = 100
_AROUND = 101  # samples over which the scale of differences is taken
_MEDIAN = 0.6745  # of normal noise: the median of its size over its standard deviation
_PART = 1 << 16  # samples at a time: long records would fill the memory
_STANDS_OUT = 12.0  # standard deviations
_AGREE = 0.3  # of the distance of a spike from its neighbours: what they may differ by


def resolution(signal: ArrayLike) -> float:
    """Smallest step between different values of a signal ``(N,)``: its LSB if it was rounded, else ~0."""
    values = np.unique(np.asarray(signal, dtype=float))
    if values.size < 2:
        return 0.0
    steps = _steps(values)
    return float(steps.min()) if steps.size else 0.0


def code_step(signal: ArrayLike) -> float:
    """The step between the codes of a rounded signal ``(N,)`` to a small part of it; 0 where it was not rounded.

    The values lie on a lattice; its step is the slope of the values over their number on it, which the digits that
    a text file leaves out hardly change. A few values beside it, such as spikes, do not count.
    """
    values, counts = np.unique(np.asarray(signal, dtype=float), return_counts=True)
    steps = np.sort(_steps(values))
    if steps.size < 2:
        return 0.0
    for least in np.unique(np.quantile(steps, _LEAST, method="lower")).tolist():
        step, off = _lattice(values, least)
        if counts[off > _BESIDE].sum() <= _STRAY * counts.sum():
            return step
    return 0.0


def _lattice(values: Array, step: float) -> tuple[float, Array]:
    """The step of a lattice of about this ``step``, and how far sorted ``values`` lie beside it, of a step.

    From a few of its codes to all: a small error of the step is a large one of where the far ones are.
    """
    way, span = values - values[values.size // 2], _FIRST * step
    while True:
        near = way[np.abs(way) <= span]
        phase = np.exp(2j * np.pi * near / step)
        middle = np.angle(phase.mean()) / (2.0 * np.pi)
        number = np.round(near / step - middle)
        off = np.abs(near / step - middle - number)
        good = off <= _BESIDE
        if good.sum() < 2 or number[good][0] == number[good][-1]:
            return 0.0, np.ones(values.size)
        step = float(np.polyfit(number[good], near[good], 1)[0])
        if near.size == values.size:
            return step, off
        span *= 4.0


def _steps(values: Array) -> Array:
    """Between neighbours of sorted ``values``: decimal text makes those of one code differ, which is no step."""
    steps: Array = np.diff(values)
    return steps[steps > 1e-9 * max(abs(values[0]), abs(values[-1]))]


def noise_std(signal: ArrayLike) -> float:
    """Standard deviation of the white measurement noise in a signal ``(N,)``, in the signal's unit.

    :raises ValueError: for fewer than 20 samples.
    """
    y = _checked(signal)
    squares = _squares(y)
    block = min(_BLOCK, squares.size)
    whole = squares[: squares.size // block * block].reshape(-1, block).mean(axis=1)
    return float(max(np.sqrt(np.median(whole)), resolution(y) / np.sqrt(12.0)))


def robust_noise_std(signal: ArrayLike, rounded: bool = True) -> float:
    """As `noise_std`, of a signal ``(N,)`` in which a few samples are wild; motion counts more.

    The median of all squared differences instead of that of the blocks' means: of normal noise it is 0.455 of the
    mean (the median of χ² with one degree of freedom), and an outlier spoils five of them, not a block.

    :param rounded: the values may have been rounded to their smallest step; of a command, its steps are meant

    :raises ValueError: for fewer than 20 samples.
    """
    y = _checked(signal)
    least = resolution(y) / np.sqrt(12.0) if rounded else 0.0
    return float(max(np.sqrt(np.median(_squares(y)) / chi2.median(1)), least))


def spikes(signal: ArrayLike) -> Mask:
    """Which samples (N,) stand alone, far off their neighbours: a loose contact, a converter, a lost frame.

    Each is compared with the two on either side, which must agree among each other, on the scale of what such
    differences are nearby. Fast motion may look alike: whoever has a model looks again.
    """
    y = _checked(signal)
    off, spread = np.zeros(y.size), np.zeros(y.size)
    for first in range(0, y.size - 4, _PART):
        part = y[first : first + _PART + 4]
        beside = np.stack([part[:-4], part[1:-3], part[3:-1], part[4:]])
        at = slice(first + 2, first + part.size - 2)
        off[at] = np.abs(y[at] - np.median(beside, axis=0))
        spread[at] = np.ptp(beside, axis=0)
    scale = np.maximum(median_filter(off, _AROUND), float(np.median(off))) / _MEDIAN
    return (off > _STANDS_OUT * np.maximum(scale, resolution(y))) & (spread < _AGREE * off)


def without(signal: Array, outliers: Mask) -> Array:
    """A signal (N,), those samples on the straight line between their neighbours."""
    if not outliers.any():
        return signal
    number = np.arange(signal.size)
    return np.interp(number, number[~outliers], signal[~outliers])


def _checked(signal: ArrayLike) -> Array:
    y = np.asarray(signal, dtype=float)
    if y.ndim != 1 or y.size < 20:
        raise ValueError(f"the noise needs at least 20 samples, got shape {y.shape}")
    return y


def _squares(y: Array) -> Array:
    """Squared fourth differences, scaled so that their mean is the variance of white noise."""
    return np.diff(y, _ORDER) ** 2 / comb(2 * _ORDER, _ORDER)
