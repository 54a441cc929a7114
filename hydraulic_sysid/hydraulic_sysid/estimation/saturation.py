"""Stretches of a signal in which its converter or sensor is at the end of its range.

Two signs are looked for at the largest and the smallest value of a signal. A converter that clips piles samples up at
exactly that value, while noise alone reaches it rarely. Behind a low pass the pile is smeared, but the noise is still
cut off on one side: at rest its distribution is skewed away from the end.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d

from hydraulic_sim.arrays import Array, Mask

from .noise import resolution, robust_noise_std

AROUND = 31  # samples over which the share at the end is taken
SHARE = 0.1  # of them at the end, from which the mean of the noise is bent
PILE = 20  # samples at the end at least, and more than within one standard deviation below
LEVEL = 1e-9  # of the range: levels that are nearer differ by rounding
FEWEST_LEVELS = 3  # steps between levels, from which they are a sensor's
FLICKERS = 0.5  # share of samples equal to the one before, below which noise shows that a channel is alive
NEAR = 0.01  # of the range, within which a signal rests at its end
RESTS = 1000  # samples of such a rest at least
SKEW = 0.6  # of the noise at rest, from which it is cut off on one side …
SURE = 5.0  # … and so many of its standard errors


def at_end_of_range(signal: ArrayLike) -> Mask:
    """Which samples (N,) lie in a stretch in which the signal is at the end of its range; none for a quiet signal."""
    y = np.asarray(signal, dtype=float)
    found = np.zeros(y.size, dtype=bool)
    if y.size < AROUND or not np.ptp(y) > 0.0:
        return found
    for towards in (y, -y):
        found |= _piled(towards) | _cut_off(towards)
    return found


def _piled(y: Array) -> Mask:
    """Stretches with a good part of the samples at exactly the largest value."""
    end = float(y.max())
    at = y == end
    same = (np.diff(y) == 0.0) & ~at[1:]
    noise = robust_noise_std(y[~at]) if (~at).sum() >= AROUND else 0.0
    if noise < max(resolution(y), _between_levels(y)) or same.sum() >= FLICKERS * max((~at).sum(), 1):
        return np.zeros(y.size, dtype=bool)  # too little noise to tell a pile from a signal that rests
    if at.sum() < max(PILE, int(((y > end - noise) & ~at).sum())):
        return np.zeros(y.size, dtype=bool)
    return np.asarray(uniform_filter1d(at.astype(float), AROUND) >= SHARE)


def _between_levels(y: Array) -> float:
    """The least step between levels that a signal keeps for some samples: a sensor's step, seen through resampling.

    Samples between two that are interpolated hide it elsewhere. 0 where there are too few such levels.
    """
    still = np.diff(y) == 0.0
    kept = y[2:][still[1:] & still[:-1]]
    levels = np.unique(kept)
    steps = np.diff(levels)
    steps = steps[steps > LEVEL * float(np.ptp(y))]
    return float(steps.min()) if steps.size >= FEWEST_LEVELS else 0.0


def _cut_off(y: Array) -> Mask:
    """Rests near the largest value, if the noise of one of them is cut off towards it."""
    near = y > y.max() - NEAR * float(np.ptp(y))
    rests = [(first, last) for first, last in runs(near) if last - first >= RESTS]
    step = max(resolution(y), _between_levels(y)) if rests else 0.0
    cut = any(_skewed(y[first:last], step) for first, last in rests)
    return near if cut else np.zeros(y.size, dtype=bool)


def _skewed(rest: Array, step: float) -> bool:
    """Whether the noise in the middle half of a rest (n,) is bounded above and not below.

    Noise of less than a ``step`` between levels says nothing: rounded, it leans to where its mean is not.
    """
    quarter = rest.size // 4
    off = rest[quarter:-quarter] - rest[quarter:-quarter].mean()
    if not off.std() > step:
        return False
    # Neighbours of a smoothed signal say the same: it is worth about as many samples as it changes its sign.
    worth = max(int(np.count_nonzero(np.diff(np.signbit(off)))), 1)
    skew = float(np.mean(off**3) / np.mean(off**2) ** 1.5)
    return skew < -max(SKEW, SURE * (6.0 / worth) ** 0.5)


def runs(flags: Mask) -> list[tuple[int, int]]:
    """First index and the one behind the last of each run of true values (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return [(int(a), int(b)) for a, b in list(pairwise(edges))[::2]]
