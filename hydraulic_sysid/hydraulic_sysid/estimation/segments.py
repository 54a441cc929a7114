"""Records cut into short segments, each with an initial state of its own (multiple shooting).

A valve-driven piston integrates: in a free run every small error of flow adds up until it hides all else. Over half a
second it does not. The initial state of a segment is not known exactly either, so that it is estimated together with
the parameters (Bock 1987, multiple shooting; here without continuity between segments).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import savgol_filter

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record

from .errors import SegmentError
from .noise import noise_std, robust_noise_std
from .velocity_filter import VelocityFilter

MEASURED = ("position", "pressure_a", "pressure_b")
"""Channels that are fitted, where a record has them."""
_STATES = ("position", "velocity", "pressure_a", "pressure_b")  # the first of every plant
_FEWEST = 20  # samples of a segment
_SMOOTHING = 15  # samples of the quadratic through which initial values are read
_STICK_SPEED = 2e-3  # m/s; above, dry friction has its full direction
# Of the noise: how far an initial state may be off what was measured there. Sensors with an offset or a wrong scale are
# off by far more than their noise, and the samples of the segment hold the initial state anyway.
_PRIOR = {"position": 1000.0, "pressure_a": 200.0, "pressure_b": 200.0}
_UNMEASURED_PRESSURE = 2e6  # Pa
_VELOCITY = 0.2  # m/s
_NUMERICAL = 1e-6  # of a channel's range: a noise-free record is not held to less


@dataclass(frozen=True)
class Segments:
    """The segments of one record.

    ``first`` (S,) sample indices, ``samples`` per segment; ``measured`` (S, samples, C) in units of ``noise_std`` (C,);
    ``smoothed`` (N, 4) position, velocity and pressures of the whole record, NaN where they were not measured; ``free``
    the indices of the states that are estimated, F of them, and ``prior_std`` (F,) how far each may be off [the state's
    unit].
    """

    record: Record
    first: Index
    samples: int
    channels: tuple[str, ...]
    noise_std: Array
    measured: Array
    smoothed: Array
    free: Index
    prior_std: Array

    def __len__(self) -> int:
        return len(self.first)

    def subset(self, chosen: Mask) -> Segments:
        """Those segments that are ``chosen`` (S,)."""
        return replace(self, first=self.first[chosen], measured=self.measured[chosen])

    def initial_states(self, plant: Plant) -> Array:
        """Where a plant's states begin (S, n_states): as measured, the rest at ease."""
        states = np.tile(plant.initial_state().states, (len(self), 1))
        command = np.clip(self.record["drive"] / plant.value("drive_limit"), -1.0, 1.0)
        begin = self.smoothed[self.first]
        for column, name in enumerate(plant.state_names):
            if name in _STATES:
                states[:, column] = np.where(np.isfinite(begin[:, column]), begin[:, column], states[:, column])
            elif name == "stick":
                states[:, column] = np.clip(begin[:, _STATES.index("velocity")] / _STICK_SPEED, -1.0, 1.0)
            elif plant.layout.state_records[name].initial == "command":
                states[:, column] = command[np.maximum(self.first - 1, 0)]
        return states

    def by_channel(self, residual: Array) -> Array:
        """Residuals (S, m) without the priors' part: (S, samples, C)."""
        return residual[:, : -len(self.free)].reshape(len(self), self.samples, len(self.channels))

    @property
    def unmeasured_pressures(self) -> Mask:
        """(F,) which of the estimated states are pressures without a sensor."""
        return np.array([_STATES[k] not in (*self.channels, "velocity") for k in self.free])

    def with_noise(self, noise_std: Array) -> Segments:
        """The same, to be judged by another noise (C,)."""
        ratio = self.noise_std / noise_std
        prior = self.prior_std.copy()
        for place, index in enumerate(self.free):
            if _STATES[index] in self.channels:
                prior[place] /= ratio[self.channels.index(_STATES[index])]
        return replace(self, noise_std=noise_std, measured=self.measured * ratio, prior_std=prior)


def cut(records: Sequence[Record], kind: str, length: float, robust: bool = False) -> list[Segments]:
    """Cut records into equal segments of about ``length`` seconds; one as long as the record is a free run.

    :param kind: of the plant; only a hydraulic one has pressures
    :param robust: the noise must not follow outliers either

    :raises SegmentError: a record without drive or position, or too short; the message names it.
    """
    return [_cut(record, kind == "hydraulic", length, robust) for record in records]


def _cut(record: Record, hydraulic: bool, length: float, robust: bool) -> Segments:
    for channel in ("drive", "position"):
        if channel not in record:
            raise SegmentError(f"{record.name}: no channel {channel!r}; a calibration needs drive and position")
    if not length > 0.0:
        raise SegmentError(f"segments of {length:g} s: the length must be positive")
    # Neighbours share one sample, as a run of n intervals has n + 1 of them.
    intervals = len(record) - 1
    number = max(1, round(intervals * record.dt / length))
    samples = intervals // number + 1
    if samples < _FEWEST:
        raise SegmentError(
            f"{record.name}: segments of {length:g} s have {samples} samples of {record.dt:g} s; at least {_FEWEST} "
            f"are needed (the record has {len(record)})"
        )
    first: Index = (samples - 1) * np.arange(number, dtype=np.int64)
    channels = tuple(c for c in MEASURED if c in record and (hydraulic or c == "position"))
    noise = np.array([_noise(record[c], robust) for c in channels])
    index = first[:, None] + np.arange(samples)
    measured = np.stack([record[c][index] for c in channels], axis=-1) / noise
    prior = {"velocity": _VELOCITY} | {c: _PRIOR[c] * sigma for c, sigma in zip(channels, noise, strict=True)}
    free = np.arange(len(_STATES) if hydraulic else 2)
    prior_std = np.array([prior.get(_STATES[k], _UNMEASURED_PRESSURE) for k in free])
    return Segments(record, first, samples, channels, noise, measured, _smoothed(record, channels), free, prior_std)


def _noise(values: Array, robust: bool) -> float:
    sigma = robust_noise_std(values) if robust else noise_std(values)
    return max(sigma, _NUMERICAL * float(np.ptp(values)), np.finfo(float).tiny)


def _smoothed(record: Record, channels: tuple[str, ...]) -> Array:
    """Measured values smoothed, the velocity by a derivative filter: (N, 4), NaN for what has no sensor."""
    position = record["position"]
    found = {c: savgol_filter(record[c], _SMOOTHING, 2) for c in channels}
    found["velocity"] = VelocityFilter.for_signal(position, record.dt, noise_std(position))(position)
    missing = np.full(len(record), np.nan)
    return np.stack([found.get(name, missing) for name in _STATES], axis=-1)
