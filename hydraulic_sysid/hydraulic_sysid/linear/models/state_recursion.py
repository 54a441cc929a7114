"""The one recursion that every state-space simulation here needs, compiled.

A direct-form filter (`scipy.signal.lfilter`) of third order or more loses its digits when the sampling time is short
against the plant's time constants, as all poles then crowd at z = 1; the recursion of states does not.
"""

from __future__ import annotations

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.jit import jit


@jit
def propagate(transition: Array, forcing: Array, initial: Array) -> Array:
    """States ``x[0] = initial``, ``x[k+1] = transition·x[k] + forcing[k]``, as ``(N, n)`` for forcing ``(N, n)``."""
    count, size = forcing.shape
    states = np.empty((count, size))
    now = initial.copy()
    for k in range(count):
        for i in range(size):
            states[k, i] = now[i]
        for i in range(size):
            total = forcing[k, i]
            for j in range(size):
                total += transition[i, j] * states[k, j]
            now[i] = total
    return states
