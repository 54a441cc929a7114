"""Small smooth functions that effect kernels share; compiled by numba, callable from Python as well."""

from __future__ import annotations

import math

from numba import njit


@njit(error_model="numpy")
def smooth_root_gain(drop: float, transition: float) -> float:
    """1/√(|Δp| + Δp_tr): times Δp it is √Δp with a finite slope at zero drop.

    Turbulent orifice flow has infinite slope at Δp = 0; below the transition drop the real flow is laminar
    (Merritt 1967, ch. 3), which this blends to.
    """
    return 1.0 / math.sqrt(abs(drop) + transition)


@njit(error_model="numpy")
def orifice_gain(size: float, drop: float, transition: float) -> float:
    """``size`` times `smooth_root_gain`: flow per drop. Of an orifice that is shut no root is taken."""
    return size * smooth_root_gain(drop, transition) if size != 0.0 else 0.0


@njit(error_model="numpy")
def clamp(value: float, low: float, high: float) -> float:
    """``value`` kept within low…high."""
    return min(max(value, low), high)


@njit(error_model="numpy")
def play(value: float, half_width: float, held: float) -> float:
    """Rate-independent play (backlash) operator: the held output follows within ±half_width of the input.

    Visintin (1994), Differential Models of Hysteresis, ch. III.
    """
    return min(max(held, value - half_width), value + half_width)


@njit(error_model="numpy")
def beyond_whole(span: float, interval: float) -> float:
    """What is left of a ``span`` beyond whole intervals; 0 where that is next to nothing."""
    left = span - interval * int(span / interval + 1e-6)
    return left if left > 1e-6 * interval else 0.0


@njit(error_model="numpy")
def delayed(value: float, delay: float, dt: float, memory) -> float:
    """``value`` delayed by ``delay`` [s], interpolated linearly between samples ``dt`` [s] apart.

    memory[0] counts samples, memory[1:] is a ring. It bounds the delay: the longest is (len(memory) − 3)·dt.
    """
    size = len(memory) - 1
    count = int(memory[0])
    if count == 0:
        for i in range(size):
            memory[1 + i] = value
    memory[1 + count % size] = value
    memory[0] = count + 1.0
    shift = min(delay / dt, size - 2.0)
    whole = int(shift)
    part = shift - whole
    newer = memory[1 + (count - whole + size) % size]
    older = memory[1 + (count - whole - 1 + size) % size]
    return (1.0 - part) * newer + part * older


@njit(error_model="numpy")
def begun(guess: float, reach: float, memory) -> float:
    """With what a sensor of the position begins: what it showed, or the ``guess`` as far as noise hides the difference.

    That is ``reach`` [s²] times an acceleration. memory[1] is what it showed, memory[2] the noise over the usual
    acceleration [s²]: the mean of both, each with the weight of its variance.
    """
    hidden = memory[2]
    return guess + (memory[1] - guess) * reach * reach / (reach * reach + hidden * hidden)
