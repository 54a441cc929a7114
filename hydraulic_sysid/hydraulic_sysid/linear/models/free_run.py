"""Free run of a linear model: forced response, and the initial state that fits a measurement best."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hydraulic_sim.arrays import Array

_OVERFLOW = 1e8  # beyond it an unstable model has grown past what a least-squares fit can weigh


def free_run(forced: Array, measured: Array | None, modes: Callable[[], Array]) -> Array:
    """``forced`` (N,), and with ``measured`` (N,) the free responses ``modes()`` (N, n) that bring it closest to that.

    Least squares over the whole record, as MATLAB's ``compare`` does by default. NaN throughout if the model is too
    unstable to be run.
    """
    if not np.isfinite(forced).all() or np.abs(forced).max() > _OVERFLOW:
        return np.full(forced.size, np.nan)
    if measured is None:
        return forced
    free = modes()
    if not np.abs(free).max() < _OVERFLOW:
        return np.full(forced.size, np.nan)
    free = free / np.maximum(np.linalg.norm(free, axis=0), 1e-300)
    state, *_ = np.linalg.lstsq(free, measured - forced, rcond=None)
    return forced + free @ state
