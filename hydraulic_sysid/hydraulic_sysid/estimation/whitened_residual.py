"""What a simulated run leaves of a record, as it was recorded and without the colour of the noise.

A fit asks for it some thousand times, so that it is compiled: channel by channel within one segment.
"""

from __future__ import annotations

import math

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask

from .jit import jit


@jit
def _record(values: Array, delay: float, lag: float, old: Array) -> None:
    """One channel (n,) in place, as in `recorded`; ``old`` (n,) is scratch."""
    n = values.size
    if lag > 0.0:  # 1/(lag·s + 1), exactly for values that are straight between samples
        fade = math.exp(-1.0 / lag)
        gain = lag * (1.0 - fade)
        before = values[0]
        values[0] = before - lag * (values[1] - before)
        for i in range(1, n):
            now = values[i]
            values[i] = fade * values[i - 1] + (1.0 - gain) * now + (gain - fade) * before
            before = now
    whole = round(delay)
    if whole != 0:
        old[:] = values
        for i in range(n):
            k = i - whole
            if k < 0:
                values[i] = old[0] + k * (old[1] - old[0])
            elif k >= n:
                values[i] = old[n - 1] + (k - n + 1) * (old[n - 1] - old[n - 2])
            else:
                values[i] = old[k]
    rest = delay - whole
    if rest != 0.0:  # a Taylor step of second order
        _differences(values, old)
        for i in range(n):
            low, high = max(i - 1, 0), min(i + 1, n - 1)
            values[i] += rest * (0.5 * rest * (old[high] - old[low]) / (high - low) - old[i])


@jit
def _differences(values: Array, found: Array) -> None:
    """Slope of values (n,) per sample, central within."""
    n = values.size
    found[0] = values[1] - values[0]
    for i in range(1, n - 1):
        found[i] = 0.5 * (values[i + 1] - values[i - 1])
    found[n - 1] = values[n - 1] - values[n - 2]


@jit
def _whiten(values: Array, width: int, coefficients: Array, head: Array, found: Array) -> None:
    """One segment (n·width,) of samples that are ``width`` values side by side, as in `whitened`."""
    order = coefficients.size - 1
    begin = order * width
    after = found[begin:]
    after[:] = 0.0
    for lag in range(order + 1):
        factor, earlier = coefficients[lag], values[begin - lag * width : values.size - lag * width]
        for i in range(after.size):  # counted from 0 in both, so that the processor takes several at once
            after[i] += factor * earlier[i]
    for k in range(order):
        for w in range(width):
            total = 0.0
            for j in range(k + 1):
                total += head[k, j] * values[j * width + w]
            found[k * width + w] = total


@jit
def recorded(values: Array, delay: float, lag: float) -> Array:
    """What is recorded of simulated values (S, n), ``delay`` late and behind a first-order low pass of ``lag``.

    Both in sampling intervals; values are taken to have moved straight on before they begin and after they end.
    """
    found = values.copy()
    old = np.empty(values.shape[1])
    for s in range(values.shape[0]):
        _record(found[s], delay, lag, old)
    return found


@jit
def whitened(values: Array, width: int, coefficients: Array, head: Array) -> Array:
    """Σ_l c_l·x_{t−l} of segments (S, n·width), n samples of ``width`` values; the first p by ``head`` (p, p)."""
    found = np.empty_like(values)
    for s in range(values.shape[0]):
        _whiten(values[s], width, coefficients, head, found[s])
    return found


@jit
def residual(
    measured: Array,
    run: Array,
    dropped: Mask,
    delays: Array,
    lags: Array,
    gains: Array,
    orders: Index,
    coefficients: Array,
    heads: Array,
    loudness: Array,
) -> Array:
    """``measured`` (S, n, C) − what is recorded of a ``run`` of that shape, whitened: (S, n·C).

    ``dropped`` (S, n, C): samples whose residual is taken to be 0; ``delays`` and ``lags`` (C,) as of `recorded`;
    ``gains`` (C,) of the channels; ``orders`` (C,), ``coefficients`` (C, p + 1), ``heads`` (C, p, p): as of `whitened`;
    ``loudness`` (S, C).
    """
    segments, n, channels = measured.shape
    found = np.empty((segments, n * channels))
    values, white = np.empty(n), np.empty(n)
    for s in range(segments):
        for c in range(channels):
            values[:] = run[s, :, c]
            _record(values, delays[c], lags[c], white)
            seen, gain, out = measured[s, :, c], gains[c], dropped[s, :, c]
            for i in range(n):
                values[i] = seen[i] - gain * values[i]
            for i in range(n):
                if out[i]:
                    values[i] = 0.0
            order = orders[c]
            _whiten(values, 1, coefficients[c, : order + 1], heads[c], white)
            scale, left = 1.0 / loudness[s, c], found[s, c::channels]
            for i in range(n):
                left[i] = scale * white[i]
    return found
