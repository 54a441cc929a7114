"""Where an error sits: its distribution in bins of a variable, and how much of it the variable explains.

The share explained is the correlation ratio η² of the binned means (Fisher 1925; Kelley 1935),
cross-validated: the means come from other data than those they are tried on, so that a variable that explains
nothing gets about zero or less, however many bins it has. Tried on: one record at a time against all others,
or, of a single record, every second half-second against the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.estimation.metrics import autocorrelation

BINS = 32
DIRECTION_EDGES: Array = np.array([-1.5, -0.5, 0.5, 1.5])
"""Of the bins of `directions`."""
_SMALLEST_BIN = 20
EDGE_DIGITS = 12  # that a result file keeps
_BLOCK_SECONDS = 0.5
_VANISHED = 0.05
_CHANCE = 8.0  # three standard deviations of the cross-validated share of n independent samples stay below 8/n


@dataclass(frozen=True)
class ErrorMap:
    """Statistics ``(B,)`` of an error in bins of one variable, SI; bins with too few samples are left out."""

    start: Array
    """Least value of the variable in the bin; it holds what lies from there on and below `end`."""
    end: Array
    center: Array
    count: Index
    mean: Array
    median: Array
    low: Array
    """10 % quantile."""
    high: Array
    """90 % quantile."""
    rms: Array
    explained: float
    """Cross-validated share of the error's variance that the bin means explain; NaN if it cannot be tried."""
    chance_level: float
    """What that share may reach by chance, given how few independent samples a slow error has."""


def adaptive_edges(values: Array, bins: int = BINS) -> Array:
    """Edges ``(≤ bins + 1,)`` that follow half the range and half the density of the values.

    Uniform bins would put the whole neighbourhood of standstill into one, quantile bins the whole of the fast
    motion. The outermost 0.1 % on either side share the end bins.
    """
    grid = np.linspace(0.001, 0.999, 513)
    quantiles = np.quantile(values, grid)
    span = quantiles[-1] - quantiles[0]
    if not span > 0.0:
        return np.array([quantiles[0], quantiles[0]])
    mixed = 0.5 * (quantiles - quantiles[0]) / span + 0.5 * (grid - grid[0]) / (grid[-1] - grid[0])
    edges = np.interp(np.linspace(0.0, 1.0, bins + 1), mixed, quantiles)
    return np.unique(edges)


def folds_of(times: list[Array]) -> Index:
    """Fold of every sample of the records in a row: the record, or alternate half-seconds of a single one."""
    if len(times) > 1:
        return np.repeat(np.arange(len(times)), [t.size for t in times])
    return (np.floor((times[0] - times[0][0]) / _BLOCK_SECONDS + 1e-9) % 2).astype(np.int64)


@dataclass(frozen=True)
class Binning:
    """The samples ``(N,)`` of one variable sorted into bins once, for the errors of several channels."""

    values: Array
    edges: Array
    index: Index
    order: Index
    starts: Index
    """``(B + 1,)`` where each bin begins in ``order``."""

    @classmethod
    def of(cls, values: Array, edges: Array | None = None) -> Binning:
        """Bins of a variable; ``edges`` fixes them (categories), otherwise they adapt to the values.

        What lies beyond an end belongs to the end bin.
        """
        edges = adaptive_edges(values) if edges is None else edges
        edges = np.array([float(f"{edge:.{EDGE_DIGITS}g}") for edge in edges])  # those of the document, to the last bit
        bins = max(edges.size - 1, 1)
        index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
        order = np.argsort(index, kind="stable")
        starts = np.concatenate(([0], np.cumsum(np.bincount(index, minlength=bins))))
        return cls(values, edges, index, order, starts)

    def reach(self) -> Array:
        """``(B + 1,)`` between what values the bins lie; the end bins reach a little beyond all values."""
        found = np.resize(self.edges, self.starts.size).astype(float)
        low, high = min(found[0], float(self.values.min())), max(found[-1], float(self.values.max()))
        room = 1e-6 * max(high - low, abs(high), abs(low))
        found[0], found[-1] = low - room, high + room
        return found


def independent_samples(error: Array, folds: Index) -> float:
    """How many independent samples an error ``(N,)`` amounts to: of each fold N/(1 + 2·Σρ), ρ until it vanishes.

    (Sokal's integrated autocorrelation time.)
    """
    total = 0.0
    for fold in np.unique(folds):
        e = error[(folds == fold) & np.isfinite(error)]
        if e.size < 2 or not np.ptp(e) > 0.0:
            continue
        rho = autocorrelation(e, e.size - 1)
        gone = np.flatnonzero(rho < _VANISHED)
        total += e.size / (1.0 + 2.0 * float(rho[1 : gone[0]].sum())) if gone.size else 1.0
    return total


def error_map(error: Array, binning: Binning, folds: Index, independent: float | None = None) -> ErrorMap:
    """Map of an error ``(N,)`` over a variable; samples without an error (NaN) are left out.

    ``independent`` is the error's number of independent samples, where it is known already.
    """
    independent = independent_samples(error, folds) if independent is None else independent
    rows = []
    ends = binning.reach()
    for bin_, (first, last) in enumerate(zip(binning.starts[:-1], binning.starts[1:], strict=True)):
        inside = binning.order[first:last]
        e = error[inside]
        known = np.isfinite(e)
        e = e[known]
        if e.size < _SMALLEST_BIN:
            continue
        low, middle, high = np.quantile(e, (0.1, 0.5, 0.9))
        place = float(binning.values[inside][known].mean())
        rows.append(
            (*ends[bin_ : bin_ + 2], place, e.size, float(e.mean()), middle, low, high, float(np.sqrt(np.mean(e**2))))
        )
    table = np.array(rows, dtype=float).reshape(-1, 9)
    known = np.isfinite(error)
    share = cross_validated_share(error[known], binning.index[known], folds[known], binning.starts.size - 1)
    start, end, center, count, mean, median, low, high, rms = table.T
    chance = min(1.0, _CHANCE / max(independent, 1.0))
    return ErrorMap(start, end, center, count.astype(np.int64), mean, median, low, high, rms, share, chance)


def cross_validated_share(error: Array, index: Index, folds: Index, bins: int) -> float:
    """1 − Σ(e − ē_bin)²/Σ(e − ē)², with the means ē_bin and ē from the other folds.

    A bin that the other folds do not hold predicts their overall mean. NaN with fewer than two folds.
    """
    names = np.unique(folds)
    if names.size < 2:
        return float("nan")
    rows = np.searchsorted(names, folds)
    cell = rows * bins + index
    count = np.bincount(cell, minlength=names.size * bins).reshape(names.size, bins)
    total = np.bincount(cell, weights=error, minlength=names.size * bins).reshape(names.size, bins)
    other_count, other_total = count.sum(axis=0) - count, total.sum(axis=0) - total
    overall = (other_total.sum(axis=1) / np.maximum(other_count.sum(axis=1), 1))[:, None]
    means = np.where(other_count >= _SMALLEST_BIN, other_total / np.maximum(other_count, 1), overall)
    left = np.sum((error - means[rows, index]) ** 2)
    whole = np.sum((error - overall[rows, 0]) ** 2)
    return float(1.0 - left / whole) if whole > 0.0 else float("nan")


def directions(velocity: Array, threshold: float) -> Array:
    """Category −1 (retracting), 0 (standing, within ±threshold) or 1 (extending)."""
    return np.where(velocity > threshold, 1.0, np.where(velocity < -threshold, -1.0, 0.0))
