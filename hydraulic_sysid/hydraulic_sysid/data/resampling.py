"""Bring a plant's drive and output to a slower sampling time so that a sampled model still holds between them.

A drive held over each fast sample is averaged over each slow one, and the output is taken at the slow
instants. For an integrating plant the output then follows from the averages exactly; for any plant nothing of
the future gets into the past, which a symmetric low-pass would bring there: a model that looks one sample
back would then chase it with unstable poles. Folding of fast output motion is no concern between samples of a
plant (Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed., ch. 2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import RecordError


def held_average(drive: ArrayLike, dt: float, sampling_time: float) -> Array:
    """Mean over each new sample ``(M,)`` of a drive ``(N,)`` that is held over samples of ``dt`` seconds.

    :raises RecordError: if the new sampling time is shorter than ``dt`` or longer than the record.
    """
    u = np.asarray(drive, dtype=float)
    edges = _instants(u.size, dt, sampling_time, whole=True)
    integral = np.concatenate(([0.0], np.cumsum(u))) * dt
    return np.diff(np.interp(edges, dt * np.arange(u.size + 1), integral)) / sampling_time


def sampled(output: ArrayLike, dt: float, sampling_time: float) -> Array:
    """An output ``(N,)`` at the beginning of each new sample ``(M,)``, between two samples by a straight line.

    :raises RecordError: if the new sampling time is shorter than ``dt`` or longer than the record.
    """
    y = np.asarray(output, dtype=float)
    return np.interp(_instants(y.size, dt, sampling_time), dt * np.arange(y.size), y)


def delayed(values: Array, samples: int) -> Array:
    """The values ``(N,)`` that many samples later; the first one where there was none yet."""
    late = min(samples, values.size)
    return np.concatenate((np.full(late, values[0]), values[: values.size - late]))


def _instants(count: int, dt: float, sampling_time: float, whole: bool = False) -> Array:
    """Beginnings of the new samples that lie wholly in the record; with ``whole`` the end of the last one too."""
    if sampling_time < dt * (1.0 - 1e-9):
        raise RecordError(f"sampling time {sampling_time:g} s is shorter than the record's {dt:g} s")
    fits = int(np.floor(count * dt / sampling_time + 1e-9))
    if fits < 1:
        raise RecordError(f"sampling time {sampling_time:g} s is longer than the record of {count * dt:g} s")
    return np.arange(fits + (1 if whole else 0), dtype=float) * sampling_time
