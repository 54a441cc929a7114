"""Records cut into short segments, each with an initial state of its own (multiple shooting).

A valve-driven piston integrates: in a free run every small error of flow adds up until it hides all else. Over half a
second it does not. The initial state of a segment is not known exactly either, so that it is estimated together with
the parameters (Bock 1987, multiple shooting; here without continuity between segments).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.signal import find_peaks, savgol_filter

from hydraulic_sim import rates
from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record

from .errors import SegmentError
from .noise import noise_std, robust_noise_std, spikes, without
from .noise_model import ChannelNoise
from .projection import Explained, project_out
from .recording import Reading
from .run_ups import RunUps, longest_worth
from .saturation import runs
from .velocity_filter import VelocityFilter
from .whitened_residual import residual

LONGEST = 0.5  # s of a segment, …
PERIODS = 25.0  # … or of the oil's oscillation: over more of them a small error of a frequency is a large one of phase
MEASURED = ("position", "pressure_a", "pressure_b")
"""Channels that are fitted, where a record has them."""
_STATES = ("position", "velocity", "pressure_a", "pressure_b")  # the first of every plant
_FEWEST = 20  # samples of a segment
_SMOOTHING = 15  # samples of the quadratic through which initial values are read
STICK_SPEED = 2e-3  # m/s; above, dry friction has its full direction
_TURNING = 0.005  # s: over twice that the acceleration of a piston that hardly moves is read
_SLIDING = 0.05  # s around the beginning of a segment over which a piston that hardly moves slides on, …
_SLID = 3.0  # … if it goes so many bristle lengths, half of them before …
_SEEN = 5.0  # … and so many times the position's noise
# Of the noise: how far what a sensor reads in an initial state may be off what was measured there. The samples of the
# segment hold the initial state anyway.
_PRIOR = {"position": 1000.0, "pressure_a": 200.0, "pressure_b": 200.0}
# Of the supply pressure: how far a pressure without a sensor may be off what motion and valve say …
_UNMEASURED_PRESSURE = 0.2  # … before the piston has moved, when nothing has said anything yet, …
_TRACKED_PRESSURE = 0.05  # … and later: as a land loses where its flow is off by a twentieth
_FORGOTTEN = 0.5  # of the range of a record, after which such a pressure no longer depends on what it began with
_VELOCITY = 0.2  # m/s, where the piston moves
_SETTLING = 0.1  # s of a record after which states that no sensor sees have forgotten what they began with
_NUMERICAL = 1e-6  # of a channel's range: a noise-free record is not held to less
_LEAST_NOISE = float(np.finfo(float).tiny) ** 0.5  # of a channel that stands still: its square must not vanish


@dataclass(frozen=True)
class Segments:
    """The segments of one record.

    ``first`` (S,) sample indices, ``samples`` per segment; ``measured`` (S, samples, C) [SI] with the ``noise`` of
    each channel; ``smoothed`` (N, 4) position, velocity and pressures of the whole record, NaN where they were not
    measured; ``free`` the indices of the states that are estimated, F of them, and ``prior_std`` (S, F) how far
    each may be off [the state's unit; pressures without a sensor: of the supply pressure]; ``readings``: how
    the channels were recorded; ``hum``: mains lines [Hz] in each; ``outliers`` (S, samples, C): samples that do not
    count; ``nuisance`` (S, samples·C, K), whitened: what may be off in every segment by about one of each column,
    such as hum and laws that are not quite those of the bench; ``disturbance`` (S, samples, C, D) [SI]: what else
    may be, known from before.
    """

    record: Record
    first: Index
    samples: int
    channels: tuple[str, ...]
    noise: tuple[ChannelNoise, ...]
    measured: Array
    smoothed: Array
    free: Index
    prior_std: Array
    readings: tuple[Reading, ...]
    hum: tuple[tuple[float, ...], ...]
    outliers: Mask
    nuisance: Array
    disturbance: Array
    loudness: Array
    """(S, C) by how many times the noise of a channel is stronger in a segment than in all."""
    run_ups: RunUps = field(default_factory=RunUps, repr=False, compare=False)
    """Of the record; shared with all that is made from these segments."""

    def __len__(self) -> int:
        return len(self.first)

    def subset(self, chosen: Mask) -> Segments:
        """Those segments that are ``chosen`` (S,)."""
        return replace(
            self,
            first=self.first[chosen],
            prior_std=self.prior_std[chosen],
            measured=self.measured[chosen],
            outliers=self.outliers[chosen],
            nuisance=self.nuisance[chosen],
            disturbance=self.disturbance[chosen],
            loudness=self.loudness[chosen],
        )

    @property
    def noise_std(self) -> Array:
        """(C,) of each channel, its colour included [SI]."""
        return np.array([n.std for n in self.noise])

    @property
    def states(self) -> list[int]:
        """(C,) which state each channel measures."""
        return [_STATES.index(c) for c in self.channels]

    @cached_property
    def all_nuisance(self) -> tuple[Array, Explained]:
        """(S, m, K) that of laws and hum and of what low passes held, 0 for priors; and what it explains by itself."""
        columns = np.concatenate((self.nuisance, self.starts_of_filters), axis=-1)
        columns = np.pad(columns, ((0, 0), (0, len(self.free)), (0, 0)))
        return columns, Explained.by(columns)

    @cached_property
    def drive(self) -> Array:
        """(N,) [V] of the whole record, in an array that compiled code takes as it is."""
        return np.array(self.record["drive"])

    @cached_property
    def longest_run_up(self) -> int:
        """Samples of the longest run-up to the segments that saves much."""
        return longest_worth(self.first)

    @cached_property
    def _missing(self) -> list[list[tuple[int, Array]]]:
        return [noise.missing(self.outliers[:, :, c]) for c, noise in enumerate(self.noise)]

    @cached_property
    def _compiled(self) -> tuple[Array | Index | Mask, ...]:
        """How each channel is read and whitened, as `whitened_residual.residual` takes it."""
        orders = np.array([n.order for n in self.noise])
        coefficients = np.zeros((len(orders), orders.max() + 1))
        heads = np.zeros((len(orders), orders.max(), orders.max()))
        for c, (noise, p) in enumerate(zip(self.noise, orders.tolist(), strict=True)):
            coefficients[c, : p + 1], heads[c, :p, :p] = noise.filter, noise.head
        delays, lags = np.array([(r.delay, r.lag) for r in self.readings]).T.copy() / self.record.dt
        gains = np.array([1.0 + r.gain for r in self.readings])
        return self.outliers, delays, lags, gains, orders, coefficients, heads, np.ascontiguousarray(self.loudness)

    @property
    def counted(self) -> Index:
        """(S,) how many measured values count in each segment."""
        return np.sum(~self.outliers, axis=(1, 2))

    @cached_property
    def timing(self) -> Array:
        """(C,) by how much a delay of a channel changes all that is recorded of it, over the noise, squared [1/s²]."""
        inside = self.first[:, None] + np.arange(self.samples)
        return np.asarray(np.sum((self._rates[inside] / self.noise_std) ** 2, axis=(0, 1)))

    @cached_property
    def _rates(self) -> Array:
        """(N, C) of the channels, smoothed [SI/s]."""
        return np.asarray(np.gradient(self.smoothed[:, self.states], self.record.dt, axis=0))

    def deviation(self, run: Array, priors: Array) -> Array:
        """(S, m) measured − what a simulated ``run`` (S, samples, C) looks like in the record, whitened.

        The ``priors`` of the initial states, or residuals that end with them, are appended.
        """
        left = np.asarray(residual(self.measured, run, *self._compiled))
        for c in range(len(self.channels)):
            for row, basis in self._missing[c]:
                own = left[row, c :: len(self.channels)]
                own[:] = project_out(basis, own)
        return np.concatenate((left, priors[:, -len(self.free) :]), axis=1)

    def recorded(self, run: Array) -> Array:
        """(S, samples, C) what a simulated ``run`` of that shape looks like in the record [SI]."""
        return np.stack([r.applied(run[..., c], self.record.dt) for c, r in enumerate(self.readings)], axis=-1)

    def whitened(self, values: Array) -> Array:
        """(S, samples, C, …) in units of the noise and without its colour, channel by channel: (S, samples·C, …)."""
        found = []
        for c, noise in enumerate(self.noise):
            own = values[:, :, c]
            if self._missing[c]:
                out = self.outliers[:, :, c]
                own = np.where(out.reshape(out.shape + (1,) * (own.ndim - 2)), 0.0, own)
            white = noise.whiten(own)
            for row, basis in self._missing[c]:
                white[row] -= np.tensordot(basis, np.tensordot(basis, white[row], axes=(0, 0)), axes=(1, 0))
            found.append(white / self.loudness[:, c].reshape((-1,) + (1,) * (white.ndim - 1)))
        return np.stack(found, axis=2).reshape(len(values), values.shape[1] * len(self.noise), *values.shape[3:])

    @cached_property
    def starts_of_filters(self) -> Array:
        """(S, samples·C, L) whitened: what a low pass still holds, in each segment, of what came before it.

        One column per channel behind one; its size is what its lag makes of the channel's rate there, and usually.
        """
        lagged = [c for c, reading in enumerate(self.readings) if reading.lag > 0.0]
        if not lagged:
            return self.nuisance[..., :0]
        found = np.zeros((*self.measured.shape, len(lagged)))
        for column, c in enumerate(lagged):
            fading = np.exp(-self.record.dt / self.readings[c].lag * np.arange(self.samples))
            rate = self._rates[:, c]
            held = self.readings[c].lag * (np.abs(rate[self.first]) + np.sqrt(np.mean(rate**2)))
            found[:, :, c, column] = held[:, None] * fading
        return self.whitened(found)

    def initial_states(self, plant: Plant) -> Array:
        """Where a plant's states begin (S, n_states): as measured, the rest at ease.

        A pressure without a sensor is that beyond what follows from motion and valve (`Shooting`), and so 0.
        """
        states = np.tile(plant.initial_state().states, (len(self), 1))
        command = np.clip(self.drive / plant.value("drive_limit"), -1.0, 1.0)
        begin = self.smoothed[self.first]
        for column, name in enumerate(plant.state_names):
            if name in _STATES:
                states[:, column] = np.where(np.isfinite(begin[:, column]), begin[:, column], 0.0)
            elif name == "stick":
                slid = self._slid(plant)
                states[:, column] = np.where(slid != 0.0, slid, self._bent(plant))
            elif plant.layout.state_records[name].initial == "command":
                states[:, column] = command[np.maximum(self.first - 1, 0)]
        return states

    def by_channel(self, residual: Array) -> Array:
        """Whitened residuals (S, m) without the priors' part: (S, samples, C)."""
        return residual[:, : self.samples * len(self.channels)].reshape(len(self), self.samples, len(self.channels))

    def in_units(self, residual: Array) -> Array:
        """Whitened residuals (S, m) as deviations (S, samples, C) [SI], coloured as they were recorded."""
        white = self.by_channel(residual)
        return np.stack(
            [n.colour(white[:, :, c] * self.loudness[:, c, None]) for c, n in enumerate(self.noise)], axis=-1
        )

    def turning(self, plant: Plant) -> Array:
        """(S,) acceleration with which segments begin [m/s²] whose piston hardly moves there, NaN for the others.

        It is read from what follows, as before that the piston may have braked; 0 where it stays at rest. One that
        creeps has its dry friction in full.
        """
        return np.where(self._slid(plant) != 0.0, np.nan, self._turning)

    def _slid(self, plant: Plant) -> Array:
        """(S,) the direction in which the piston slides on by its bristles' length, or 0.

        It must do so before a segment and go on with it: one that comes to rest bends them back. Without hydraulics the
        drive is the force, and what the acceleration asks for is known well enough.
        """
        if plant.model.kind != "hydraulic":
            return np.zeros(len(self))
        length = plant.bristle_length
        position, channel = self.smoothed[:, _STATES.index("position")], self.channels.index("position")
        half = max(1, round(0.5 * _SLIDING / self.record.dt))
        before, after = np.maximum(self.first - half, 0), np.minimum(self.first + half, len(position) - 1)
        ways = np.stack([position[self.first] - position[before], position[after] - position[self.first]])
        far = 0.5 * max(_SLID * length, _SEEN * float(self.noise_std[channel]))
        return np.where((ways > far).all(axis=0), 1.0, np.where((ways < -far).all(axis=0), -1.0, 0.0))

    def _bent(self, plant: Plant) -> Array:
        """(S,) how far the bristles are bent: in full above `STICK_SPEED`, in proportion below.

        Those that are longer than what the noise of the position hides, by the way gone since the piston last turned;
        not without hydraulics, where the acceleration says it (`_slid`), whatever the law of the bristles.
        """
        length = plant.bristle_length
        position, velocity = (self.smoothed[self.first, _STATES.index(name)] for name in ("position", "velocity"))
        hidden = length < float(self.noise_std[self.channels.index("position")])
        if hidden or plant.model.kind != "hydraulic":
            return np.clip(velocity / STICK_SPEED, -1.0, 1.0)
        bent, before = np.zeros(len(self._turns)), np.searchsorted(self._turns, self.first, side="right") - 1
        turned = self.smoothed[self._turns, _STATES.index("position")]

        def after(bent: Array, way: Array) -> Array:
            return np.sign(way) + (bent - np.sign(way)) * np.exp(-np.abs(way) / length)

        for i, way in enumerate(np.diff(turned)):
            bent[i + 1] = after(bent[i], way)
        return after(bent[before], position - turned[before])

    @cached_property
    def _turns(self) -> Index:
        """Samples at which the piston turns by more than the noise, the first of the record among them."""
        position = self.smoothed[:, _STATES.index("position")]
        seen = _SEEN * float(self.noise_std[self.channels.index("position")])
        peaks = [find_peaks(way * position, prominence=seen)[0] for way in (1.0, -1.0)]
        return np.unique(np.concatenate(([0], *peaks)))

    @cached_property
    def _turning(self) -> Array:
        velocity, ahead = self.smoothed[:, _STATES.index("velocity")], max(1, round(_TURNING / self.record.dt))
        inside = np.minimum(self.first[:, None] + np.arange(2 * ahead + 1), len(velocity) - 1)
        slow = np.abs(velocity[inside]) < STICK_SPEED
        slope = np.polynomial.polynomial.polyfit(self.record.dt * np.arange(2 * ahead + 1), velocity[inside].T, 1)[1]
        return np.where(slow[:, 0], np.where(slow.all(axis=1), 0.0, slope), np.nan)

    @cached_property
    def shown(self) -> tuple[Array, float] | None:
        """(S,) what the position's sensor showed where segments begin [m], and its noise over the usual acceleration.

        None where it was recorded behind a low pass.
        """
        channel = self.channels.index("position")
        reading = self.readings[channel]
        if reading.lag > 0.0:
            return None
        position, velocity = (self.smoothed[:, _STATES.index(name)] for name in ("position", "velocity"))
        usual = float(np.sqrt(np.mean(np.gradient(velocity, self.record.dt) ** 2)))
        shown = position[self.first] / (1.0 + reading.gain) + reading.delay * velocity[self.first]
        return shown, float(self.noise_std[channel]) / max(usual, 1e-300)

    @cached_property
    def tracked(self) -> list[int]:
        """States that are pressures without a sensor."""
        return [int(k) for k, pressure in zip(self.free, self.unmeasured_pressures, strict=True) if pressure]

    @cached_property
    def unmeasured_pressures(self) -> Mask:
        """(F,) which of the estimated states are pressures without a sensor."""
        return np.array([_STATES[k] not in (*self.channels, "velocity") for k in self.free])

    def with_noise(self, noise: Sequence[ChannelNoise]) -> Segments:
        """The same, to be judged by another noise of each channel, without nuisance."""
        prior = self.prior_std.copy()
        for place, index in enumerate(self.free):
            if _STATES[index] in self.channels:
                channel = self.channels.index(_STATES[index])
                prior[:, place] *= noise[channel].std / self.noise[channel].std
        return replace(self, noise=tuple(noise), prior_std=prior, nuisance=self.nuisance[..., :0])

    def with_exact_laws(self) -> Segments:
        """The same, of the nuisance only what the recording adds: hum and disturbances of the drive."""
        laws = self.nuisance.shape[-1] - 2 * sum(map(len, self.hum)) - self.disturbance.shape[-1]
        return replace(self, nuisance=self.nuisance[..., laws:])


def segment_length(model: Model, records: Sequence[Record]) -> float:
    """Seconds of a segment, from the oil's natural frequency with the piston in mid stroke and the sampling."""
    shortest = max((2.0 * _FEWEST * r.dt for r in records), default=0.0)
    if model.kind != "hydraulic":
        return max(LONGEST, shortest)
    values = {k: model.value(k) for k in model.keys()}  # noqa: SIM118, a method of the model
    return max(min(LONGEST, PERIODS * 2.0 * math.pi / rates.oil_at(values, 0.0)), shortest)


def shorter(length: float, times: float, records: Sequence[Record]) -> float:
    """Seconds of segments so many times shorter, as far as the sampling allows."""
    return min(length, max(length / times, max(1.25 * _FEWEST * r.dt for r in records)))


def spread(segments: Sequence[Segments], most: int) -> list[Segments]:
    """About ``most`` of the segments, spread over all records."""
    every = max(1, round(sum(map(len, segments)) / most))
    return [s.subset(np.arange(len(s)) % every == 0) for s in segments]


def cut(
    records: Sequence[Record],
    kind: str,
    length: float,
    robust: bool = False,
    left_out: Sequence[Mask] | None = None,
) -> list[Segments]:
    """Cut records into equal segments of about ``length`` seconds; one as long as the record is a free run.

    :param kind: of the plant; only a hydraulic one has pressures
    :param robust: the noise must not follow outliers either
    :param left_out: per record the samples (N,) that no segment may hold; segments then begin behind each of them

    :raises SegmentError: a record without drive or position, or too short; the message names it.
    """
    without_parts = [None] * len(records) if left_out is None else left_out
    hydraulic = kind == "hydraulic"
    return [_cut(r, hydraulic, length, robust, out) for r, out in zip(records, without_parts, strict=True)]


def _cut(record: Record, hydraulic: bool, length: float, robust: bool, left_out: Mask | None) -> Segments:
    for channel in ("drive", "position"):
        if channel not in record:
            raise SegmentError(f"{record.name}: no channel {channel!r}; a calibration needs drive and position")
    if not length > 0.0:
        raise SegmentError(f"segments of {length:g} s: the length must be positive")
    # Neighbours share one sample, as a run of n intervals has n + 1 of them.
    settling = unjudged(record)
    intervals = len(record) - 1 - settling
    number = max(1, round(intervals * record.dt / length))
    samples = intervals // number + 1
    if samples < _FEWEST:
        raise SegmentError(
            f"{record.name}: segments of {length:g} s have {samples} samples of {record.dt:g} s; at least {_FEWEST} "
            f"are needed (the record has {len(record)})"
        )
    first: Index = settling + (samples - 1) * np.arange(number, dtype=np.int64)
    if left_out is not None and left_out.any():
        first, samples = _between(left_out, settling, samples)
        if not first.size:
            raise SegmentError(
                f"{record.name}: no stretch of {_FEWEST} samples is left between those that are set aside (converters "
                "at their end, rests against an unknown stop)"
            )
        number = len(first)
    channels = tuple(c for c in MEASURED if c in record and (hydraulic or c == "position"))
    alone = {c: spikes(record[c]) for c in channels}
    signals = {c: without(record[c], alone[c]) for c in channels}
    noise = tuple(ChannelNoise.white(_noise(signals[c], robust)) for c in channels)
    index = first[:, None] + np.arange(samples)
    measured = np.stack([record[c][index] for c in channels], axis=-1)
    smoothed = _smoothed(record, signals)
    slow = np.abs(smoothed[first, _STATES.index("velocity")]) < STICK_SPEED
    prior: dict[str, float | Array] = {c: _PRIOR[c] * n.std for c, n in zip(channels, noise, strict=True)}
    prior["velocity"] = np.where(slow, STICK_SPEED, _VELOCITY)
    free = np.arange(len(_STATES) if hydraulic else 2)
    unknown = np.where(_moved(smoothed[:, 0])[first], _TRACKED_PRESSURE, _UNMEASURED_PRESSURE)
    prior_std = np.stack([np.broadcast_to(prior.get(_STATES[k], unknown), first.shape) for k in free], axis=-1)
    return Segments(
        record, first, samples, channels, noise, measured, smoothed, free, prior_std,
        tuple(Reading() for _ in channels), tuple(() for _ in channels),
        np.stack([alone[c][index] for c in channels], axis=-1), np.zeros((number, samples * len(channels), 0)),
        np.zeros((*measured.shape, 0)), np.ones((number, len(channels))),
    )  # fmt: skip


def _moved(position: Array) -> Mask:
    """From which sample on a record (N,) has seen the piston move far enough to flush both chambers."""
    reach = np.maximum.accumulate(position) - np.minimum.accumulate(position)
    return np.asarray(reach > _FORGOTTEN * np.ptp(position))


def unjudged(record: Record) -> int:
    """Samples at the beginning of a record in which states that no sensor sees are not known."""
    return round(_SETTLING / record.dt) if record.duration > 10.0 * _SETTLING else 0


def _between(left_out: Mask, settling: int, samples: int) -> tuple[Index, int]:
    """First samples of segments in the stretches between samples that are left out, and how many samples each has.

    Where no stretch is as long as a segment was meant to be, they are as short as the longest.
    """
    sound = ~left_out
    sound[:settling] = False
    stretches = runs(sound)
    longest = max((b - a for a, b in stretches), default=0)
    samples = min(samples, longest)
    if samples < _FEWEST:
        return np.zeros(0, dtype=np.int64), samples
    found = [a + (samples - 1) * np.arange((b - a - 1) // (samples - 1), dtype=np.int64) for a, b in stretches]
    return np.concatenate(found), samples


def _noise(values: Array, robust: bool) -> float:
    sigma = robust_noise_std(values) if robust else noise_std(values)
    return max(sigma, _NUMERICAL * float(np.ptp(values)), _LEAST_NOISE)


def _smoothed(record: Record, signals: Mapping[str, Array]) -> Array:
    """Measured values smoothed, the velocity by a derivative filter: (N, 4), NaN for what has no sensor."""
    position = signals["position"]
    found = {c: savgol_filter(values, _SMOOTHING, 2) for c, values in signals.items()}
    found["velocity"] = VelocityFilter.for_signal(position, record.dt, noise_std(position))(position)
    missing = np.full(len(record), np.nan)
    return np.stack([found.get(name, missing) for name in _STATES], axis=-1)
