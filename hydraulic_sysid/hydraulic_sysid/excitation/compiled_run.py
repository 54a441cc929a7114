"""A plan and a plant in one compiled loop: some fifteen times as fast as sample by sample from Python.

Compiled once and kept on disk: the plant is a pointer to compiled code, whatever its effects.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numba import njit, types

from hydraulic_sim.embedded import POSITION, RUN
from hydraulic_sysid.excitation import answer as answers

DONE, LOST, STRAYED = range(3)
"""How a run ends: as planned, with a plant that cannot be followed, or where its piston may not be."""
_real, _reals, _table = types.float64, types.float64[::1], types.float64[:, ::1]
_plan = types.NamedTuple([_reals, _reals, types.int64, *[_real] * 7], answers.Answers)
_SIGNATURE = types.UniTuple(types.int64, 2)(
    types.FunctionType(RUN), _real, _real, types.uint8[::1], _reals, types.uint8,
    _reals, _reals, _plan, _real, _real, _reals, _real, _table, _reals,
)  # fmt: skip
_answer, _strays = njit(error_model="numpy")(answers.answer), njit(error_model="numpy")(answers.strays)


def _play(run, longest, turn, on, parameters, hydraulic, x, memory, plan, dt, limit, seen, resolution, out, drive):
    """From the state (x, memory), which moves on; ``limit`` of the drive [V], ``resolution`` of the position [m].

    ``seen`` (N,) has the position's noise and takes its readings, ``out`` (N, outputs) and ``drive`` (N,) what the
    plant did. Returns how many samples were played, and how that ended.
    """
    u, failure = np.zeros(1), np.zeros(2)
    for i in range(len(drive)):
        drive[i] = min(max(u[0], -limit), limit)
        u[0] = drive[i]
        now = out[i : i + 1]
        if run(u, dt, i * dt, longest, turn, on, parameters, hydraulic, x, memory, now, failure) < 1:
            return i, LOST
        position = now[0, POSITION] + seen[i]
        if resolution > 0.0:
            position = np.rint(position / resolution) * resolution
        seen[i] = position
        if _strays(plan, i - 1, position):
            return i + 1, STRAYED
        u[0] = _answer(plan, i, position)
    return len(drive), DONE


@lru_cache(maxsize=1)
def compiled() -> Callable[..., tuple[int, int]]:
    """`_play`, compiled."""
    function: Callable[..., tuple[int, int]] = njit(_SIGNATURE, cache=True, nogil=True, error_model="numpy")(_play)
    return function
