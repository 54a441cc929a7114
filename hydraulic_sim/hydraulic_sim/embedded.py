"""A plant as compiled code of others can run it: the pieces that a closed loop in one compiled function needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from . import base
from .arrays import Array

POSITION, VELOCITY, PRESSURE_A, PRESSURE_B, TRUE_POSITION = (
    base.OUTPUTS.index(name) for name in ("position", "velocity", "pressure_a", "pressure_b", "true_position")
)
"""Columns of the outputs."""


class Embedded(NamedTuple):
    """A compiled plant as another compiled function calls it.

    ``run(u, dt, start, out, 0, longest_step, turn, on, parameters, hydraulic, x, memory, out, failure)`` integrates
    the drive u (N,) [V] and fills out (N, outputs); it returns how many samples it could follow. Everything but u,
    dt [s], start [s], the state (x, memory), out and failure (2,) is here. The first out and the 0 say that nothing
    that was measured corrects the state.
    """

    run: Callable
    longest_step: float
    turn: float
    on: np.ndarray
    parameters: Array
    hydraulic: np.uint8
    outputs: int
