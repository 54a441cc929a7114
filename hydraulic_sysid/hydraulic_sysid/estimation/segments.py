"""Records cut into short pieces, each with an initial state of its own (multiple shooting).

A valve-driven piston integrates: in a free run every small error of flow adds up until it hides all else. Over half a
second it does not. What a piece starts from is not known exactly either, so that it is estimated along with the
parameters (Bock 1987, multiple shooting; here without continuity between pieces).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.noise import noise_floor, robust_noise_floor
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

Array = NDArray[np.float64]

MEASURED = ("position", "pressure_a", "pressure_b")
"""Channels that are fitted, where a record has them."""
_FEWEST = 20  # samples of a piece
_VELOCITY_COLUMN = 1
_SMOOTHING = 15  # samples of the quadratic through which initial values are read
_STICK_SPEED = 2e-3  # m/s; above, dry friction has its full direction
# Of the noise: how far a start may be off what was measured there. Sensors with an offset or a wrong scale are off by
# far more than their noise, and the samples of the piece hold the start anyway.
_PRIOR = {"position": 1000.0, "pressure_a": 200.0, "pressure_b": 200.0}
_UNMEASURED_PRESSURE = 2e6  # Pa
_VELOCITY = 0.2  # m/s
_NUMERICAL = 1e-6  # of a channel's range: a noise-free record is not held to less


class SegmentError(HydraulicError, ValueError):
    """A record cannot be cut (too short, no drive or position)."""


@dataclass(frozen=True)
class Pieces:
    """The pieces of one record.

    ``starts`` (S,) sample indices, ``samples`` per piece; ``measured`` (S, samples, C) in units of ``noise`` (C,);
    ``states`` (S, n_states) to start from; ``seen`` (N, 4) position, velocity and pressures of the whole record,
    smoothed, NaN where they were not measured; ``free`` the indices of the states that are estimated, F of them, and
    ``prior`` (F,) how far each may be off [the state's unit].
    """

    record: Record
    starts: NDArray[np.int64]
    samples: int
    channels: tuple[str, ...]
    noise: Array
    measured: Array
    states: Array
    seen: Array
    free: NDArray[np.int64]
    prior: Array

    def some(self, chosen: NDArray[np.bool_]) -> Pieces:
        """Those pieces that are ``chosen`` (S,)."""
        return replace(self, starts=self.starts[chosen], measured=self.measured[chosen], states=self.states[chosen])


def cut(records: Sequence[Record], plant: Plant, length: float, robust: bool = False) -> list[Pieces]:
    """Cut records into equal pieces of about ``length`` seconds; one as long as the record makes it a free run.

    ``robust``: the noise floors too must not follow outliers. Raises `SegmentError`, naming the record.
    """
    return [_cut(record, plant, length, robust) for record in records]


def _cut(record: Record, plant: Plant, length: float, robust: bool) -> Pieces:
    for channel in ("drive", "position"):
        if channel not in record:
            raise SegmentError(f"{record.name}: no channel {channel!r}; a calibration needs drive and position")
    if not length > 0.0:
        raise SegmentError(f"a piece of {length:g} s: the length must be positive")
    # Neighbours share one sample, as a run of n intervals has n + 1 of them.
    intervals = len(record) - 1
    number = max(1, round(intervals * record.dt / length))
    samples = intervals // number + 1
    if samples < _FEWEST:
        raise SegmentError(
            f"{record.name}: pieces of {length:g} s have {samples} samples of {record.dt:g} s; at least {_FEWEST} are "
            f"needed (the record has {len(record)})"
        )
    starts: NDArray[np.int64] = (samples - 1) * np.arange(number, dtype=np.int64)
    hydraulic = plant.model.kind == "hydraulic"
    channels = tuple(c for c in MEASURED if c in record and (hydraulic or c == "position"))
    noise = np.array([_noise(record[c], robust) for c in channels])
    index = starts[:, None] + np.arange(samples)
    measured = np.stack([record[c][index] for c in channels], axis=-1) / noise
    free, prior = _free_states(plant, channels, dict(zip(channels, noise, strict=True)))
    seen = _seen(record, channels)
    states = _states(record, plant, seen, starts)
    return Pieces(record, starts, samples, channels, noise, measured, states, seen, free, prior)


def _noise(values: Array, robust: bool) -> float:
    floor = robust_noise_floor(values) if robust else noise_floor(values)
    return max(floor, _NUMERICAL * float(np.ptp(values)), np.finfo(float).tiny)


def _free_states(plant: Plant, channels: tuple[str, ...], noise: dict[str, float]) -> tuple[NDArray[np.int64], Array]:
    names = plant.state_names
    free, prior = [], []
    for name in ("position", "velocity", "pressure_a", "pressure_b"):
        if name.startswith("pressure") and plant.model.kind != "hydraulic":
            continue
        free.append(names.index(name))
        if name == "velocity":
            prior.append(_VELOCITY)
        else:
            prior.append(_PRIOR[name] * noise[name] if name in channels else _UNMEASURED_PRESSURE)
    return np.array(free), np.array(prior)


def _seen(record: Record, channels: tuple[str, ...]) -> Array:
    """Measured values smoothed, the velocity by a derivative filter: (N, 4), NaN for what has no sensor."""
    position = record["position"]
    velocity = VelocityFilter.for_signal(position, record.dt, noise_floor(position))(position)
    missing = np.full(len(record), np.nan)
    smooth = {c: savgol_filter(record[c], _SMOOTHING, 2) for c in channels}
    return np.stack(
        [smooth["position"], velocity, smooth.get("pressure_a", missing), smooth.get("pressure_b", missing)], axis=-1
    )


def _states(record: Record, plant: Plant, seen: Array, starts: NDArray[np.int64]) -> Array:
    """Where each piece starts: at what was seen, the rest at ease."""
    states = np.tile(plant.initial_state().states, (starts.size, 1))
    command = np.clip(record["drive"] / plant.value("drive_limit"), -1.0, 1.0)
    for column, name in enumerate(plant.state_names):
        if column < seen.shape[1]:
            known = np.isfinite(seen[starts, column])
            states[known, column] = seen[starts[known], column]
        elif name == "stick":
            states[:, column] = np.clip(seen[starts, _VELOCITY_COLUMN] / _STICK_SPEED, -1.0, 1.0)
        elif plant.layout.state_records[name].initial == "command":
            states[:, column] = command[np.maximum(starts - 1, 0)]
    return states
