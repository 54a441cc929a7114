"""Traces for plots: few points that keep every peak."""

from __future__ import annotations

from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array


def envelope(time: Array, values: Array, buckets: int = 700) -> tuple[Array, Array]:
    """At most ``2·buckets`` points ``(time, value)`` that keep each bucket's extremes, in order.

    Points that are not finite are left out.
    """
    keep = np.isfinite(values)
    t, y = time[keep], values[keep]
    if y.size <= 2 * buckets:
        return t, y
    size = y.size // buckets + (y.size % buckets > 0)
    whole = y.size // size * size
    body = y[:whole].reshape(-1, size)
    start = np.arange(body.shape[0]) * size
    picks = np.concatenate((start + body.argmin(axis=1), start + body.argmax(axis=1)))
    if whole < y.size:
        picks = np.concatenate((picks, [whole + y[whole:].argmin(), whole + y[whole:].argmax()]))
    picks = np.unique(picks)
    return t[picks], y[picks]


def trace(time: Array, values: Array, points: int = 1400) -> dict[str, Any]:
    """A result document's trace: ``time`` and ``value`` of the envelope."""
    t, y = envelope(time, values, points // 2)
    return {"time": t, "value": y}
