"""Whole periods cut from a record of a periodic excitation, freed of the drift of an integrating plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation import ExcitationError, Plan
from hydraulic_sysid.linear.errors import FrequencyResponseError

_PART = 0.02  # of a period, over which drift from one period to the next is averaged
_PLAYED = 0.05  # of the strongest line: what is stronger was played, where no plan says so


@dataclass(frozen=True)
class Periods:
    """Drive and output of P whole periods, (P, N) each, and the harmonics (K,) that were played."""

    name: str
    drive: Array
    output: Array
    dt: float
    harmonics: Index

    @property
    def spacing(self) -> float:
        """Distance of the lines [Hz]."""
        return 1.0 / (self.drive.shape[1] * self.dt)


def periodic_signal(record: Record) -> tuple[Plan, float, Index] | None:
    """Plan, period [s] and harmonics played of a record whose excitation is a multisine over all its time; or None."""
    plan = _plan(record.description)
    lines, period = getattr(plan and plan.signal, "lines", None), getattr(plan and plan.signal, "period", None)
    if plan is None or lines is None or period is None:
        return None
    return plan, period, np.rint(lines() * period).astype(np.int64)


def periods_of(
    record: Record, output: str = "position", drive: str = "drive", period: float | None = None, start: float = 0.0
) -> Periods:
    """The whole periods of a record: those its plan played, or all of `period` [s] from `start` [s] on.

    Of three periods or more the first is left out: the plant settles in it.

    :raises FrequencyResponseError: no period is known, it is no whole number of samples, or fewer than two fit in.
    """
    record.require(drive, output, error=FrequencyResponseError)
    known = periodic_signal(record)
    harmonics, end = None, record.duration
    if period is None:
        if known is None:
            raise FrequencyResponseError(f"{record.name}: no plan with a period is known of it; give its period")
        plan, period, harmonics = known
        start = plan.signal_start + plan.fade_in
        end = min(plan.signal_start + plan.active_time - plan.fade_out, end)
    size = round(period / record.dt)
    if abs(size * record.dt - period) > 1e-6 * period:
        raise FrequencyResponseError(
            f"{record.name}: the period {period:g} s is no multiple of the sampling time {record.dt:g} s"
        )
    margin = max(1, int(_PART * size))
    first, last = int(np.ceil(start / record.dt - 1e-6)), int(np.floor(end / record.dt + 1e-6))
    count = (last - first - margin) // size
    if count >= 3:
        count -= 1
    if count < 2:
        raise FrequencyResponseError(
            f"{record.name}: {(last - first) * record.dt:g} s hold no two whole periods of {period:g} s"
        )
    begin = last - count * size
    drives = record[drive][begin:last].reshape(count, size)
    if harmonics is None:
        harmonics = _played(drives)
    outputs = _without_drift(record[output], begin, count, size, margin)
    return Periods(record.name, drives, outputs, record.dt, harmonics)


def _without_drift(output: Array, begin: int, count: int, size: int, margin: int) -> Array:
    """Each period minus the straight line from its beginning to its end.

    The transform of a velocity over [0, T] is jω·Y + (y(T) − y(0)): without the line, the spectrum of a position that
    drifts is that of its velocity over jω, at every line. The drift is the mean over a fiftieth of a period before each
    boundary, where the motion itself is the same and the noise averages out.
    """
    ends = [output[begin + p * size - margin : begin + p * size] for p in range(count + 1)]
    drift = np.array([float(np.mean(ends[p + 1] - ends[p])) for p in range(count)])
    whole = output[begin : begin + count * size].reshape(count, size)
    return whole - drift[:, None] * (np.arange(size) / size)


def _played(drives: Array) -> Index:
    spectrum = np.abs(np.fft.rfft(drives.mean(axis=0)))
    spectrum[0] = 0.0
    return np.flatnonzero(spectrum > _PLAYED * spectrum.max()).astype(np.int64)


def _plan(description: Mapping[str, Any]) -> Plan | None:
    content = (description.get("experiment") or {}).get("plan")
    try:
        return Plan.from_mapping(content) if isinstance(content, Mapping) else None
    except (ExcitationError, TypeError):
        return None  # a plan of another version: the record is still good for other methods
