"""A record as it is checked: spikes taken out, and means over short windows, which need no filter and no model.

Between the ends of a window the position gives the mean velocity exactly, and three ends in a row the acceleration as
a triangle of two windows weighs it: the force is weighed alike, so that the two compare whatever the resonance does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from scipy.signal import fftconvolve

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.noise import noise_std, spikes, without

MEASURED = ("position", "pressure_a", "pressure_b", "pressure_supply")
"""Channels of sensors."""
FEWEST_SAMPLES = 20  # that a noise estimate needs
FEWEST = 6  # windows that must show something
ROUGH = 5.0  # samples of the resonance's period below which sampling shows it roughly

_PERIODS = 2.0  # of the model's resonance that a window lasts, so that it averages it, …
_LONGEST = 0.2  # … but no longer [s], …
_SPAN = 0.05  # … and so long where nothing oscillates [s]
_SAMPLES = 5  # of a window at least
_MOST = 4000  # windows of a record that are looked at, spread over it
_CHANGE = 0.3  # of the drive within a window, or of the velocity between its halves: more is no steady motion
_BEFORE = 0.5  # of the drive, that it may have differed in the window before: what a dead time still delays
_MOVED = 20.0  # standard deviations of the position's noise that a piston must move within a window, …
_LEAST_MOVED = 1e-5  # … and this part of the stroke: a record without noise
_FAST, _CLEARLY = 0.95, 2.0  # quantile of the motion within windows that must be so many times that
_DIRECTION = 0.25  # of that: what it must move to have a direction
_END = 0.02  # of the travel, next to its ends


@dataclass(frozen=True)
class Windows:
    """Means over W windows, (W,) each, in SI; NaN for what was not measured.

    ``opening``: drive over its limit, −1 … 1; ``held``: the drive hardly changes within the window and since the one
    before; ``moving``: the piston moves beyond its noise; ``steady``: at the same speed in both halves.
    """

    opening: Array
    position: Array
    velocity: Array
    pressure_a: Array
    pressure_b: Array
    pressure_supply: Array
    held: Mask
    moving: Mask
    steady: Mask

    def __len__(self) -> int:
        return len(self.opening)

    def subset(self, chosen: Mask | Index) -> Windows:
        """The ``chosen`` ones alone."""
        return Windows(*(getattr(self, f.name)[chosen] for f in fields(self)))

    @classmethod
    def joined(cls, every: Sequence[Windows]) -> Windows:
        """Those of several records."""
        return cls(*(np.concatenate([getattr(w, f.name) for w in every]) for f in fields(cls)))

    @property
    def flowing(self) -> Windows:
        """In steady motion with the drive held."""
        return self.subset(self.held & self.steady)

    @property
    def resting(self) -> Windows:
        """With the piston at rest and the drive held."""
        return self.subset(self.held & ~self.moving)

    def some(self, most: int) -> Windows:
        """At most so many of them, spread over all."""
        return self.subset(np.arange(0, len(self), max(1, -(-len(self) // most))))

    def going(self, direction: int) -> Windows:
        """Those in which drive and motion have this sign."""
        return self.subset((direction * self.opening > 0.0) & (direction * self.velocity > 0.0))


@dataclass(frozen=True)
class Observed:
    """A record of a ``plant``: ``signals`` (N,) without spikes, standard deviations of their ``noise``, both in SI.

    ``resonance``: of the model [Hz], None where nothing oscillates.
    """

    record: Record
    plant: Plant
    signals: dict[str, Array]
    noise: dict[str, float]
    resonance: float | None

    @classmethod
    def of(cls, record: Record, plant: Plant, resonance: float | None) -> Observed:
        """Of the channels that the record has, at least `FEWEST_SAMPLES` each."""
        channels = [c for c in MEASURED if c in record and (plant.model.kind == "hydraulic" or c == "position")]
        signals = {c: without(record[c], spikes(record[c])) for c in channels}
        noise = {c: noise_std(v) for c, v in signals.items()}
        return cls(record, plant, {**signals, "drive": record["drive"]}, noise, resonance)

    @property
    def named(self) -> tuple[str, ...]:
        """The name of the record, as findings have it."""
        return (self.record.name,)

    @property
    def opening(self) -> Array:
        """Drive over its limit (N,), −1 … 1."""
        return np.clip(self.signals["drive"] / self.plant.value("drive_limit"), -1.0, 1.0)

    @cached_property
    def samples(self) -> int:
        """Of a window: as long as the resonance asks for, or until fast motion stands out of the noise within it."""
        span, x, dt = (
            _SPAN if self.resonance is None else _PERIODS / self.resonance,
            self.signals["position"],
            self.record.dt,
        )
        n = max(_SAMPLES, round(min(span, _LONGEST) / dt))
        while 2 * n * dt < _LONGEST and 2 * n < len(x):
            if np.quantile(np.abs(x[n::n] - x[:-n:n]), _FAST) > _CLEARLY * self.least:
                break
            n *= 2
        return n

    @property
    def least(self) -> float:
        """What a piston that moves must move within a window [m]."""
        return max(_MOVED * self.noise["position"], _LEAST_MOVED * self.plant.value("stroke"))

    @cached_property
    def windows(self) -> Windows:
        """All windows of the record, at most `_MOST`."""
        n = self.samples
        count = (len(self.record) - 1) // n
        first: Index = np.arange(0, n * count, n * max(1, -(-count // _MOST)), dtype=np.int64)
        x, middle = self.signals["position"], first + n // 2
        opening = self.opening[first[:, None] + np.arange(n)] if first.size else np.empty((0, n))
        mean = opening.mean(axis=1) if first.size else np.empty(0)
        before = self.opening[np.maximum(first - n // 2, 0)]
        size, dt = np.abs(mean), self.record.dt
        velocity = (x[first + n] - x[first]) / (n * dt)
        halves = (x[middle] - x[first]) / (n // 2 * dt), (x[first + n] - x[middle]) / ((n - n // 2) * dt)
        moving = np.abs(velocity) * n * dt > self.least
        low, high = opening.min(axis=1, initial=np.inf), opening.max(axis=1, initial=-np.inf)
        held = (high - low <= _CHANGE * size) & (np.abs(before - mean) <= _BEFORE * size)
        steady = moving & (np.abs(halves[0] - halves[1]) <= _CHANGE * np.abs(velocity))
        pressures = {c: self._means(c, first) for c in MEASURED[1:]}
        return Windows(
            opening=mean, position=0.5 * (x[first] + x[first + n]), velocity=velocity, held=held, moving=moving,
            steady=steady, **pressures,
        )  # fmt: skip

    def _means(self, channel: str, first: Index) -> Array:
        if channel not in self.signals:
            return np.full(first.size, np.nan)
        total = np.concatenate(([0.0], np.cumsum(self.signals[channel])))
        return (total[first + self.samples] - total[first]) / self.samples

    def inertia(self, force: Array | None) -> tuple[Array, Array] | None:
        """A force (N,) [N] and the acceleration (M,) over triangles of two windows; None where they cannot be told.

        Each without what is constant or goes with direction, velocity or position: load, friction and springs. Those
        triangles are left out in which the piston comes to rest at an end of its travel: a stop carries the force.
        """
        n, x = self.samples, self.signals["position"]
        rough = self.resonance is not None and ROUGH * self.resonance * self.record.dt > 1.0
        if force is None or rough or len(x) < (FEWEST + 2) * n:
            return None
        span, kernel = n * self.record.dt, np.bartlett(2 * n + 1)
        weighed = fftconvolve(force, kernel / kernel.sum(), mode="valid")[::n]
        ends = x[: (len(x) - 1) // n * n + 1 : n]
        middle, steps, room = ends[1:-1], np.diff(ends), _END * float(np.ptp(x))
        at_end = (middle - x.min() < room) | (x.max() - middle < room)
        free = ~(at_end & (np.minimum(np.abs(steps[1:]), np.abs(steps[:-1])) <= self.least))
        velocity = (steps[1:] + steps[:-1]) / (2.0 * span)
        direction = np.sign(velocity) * (np.abs(velocity) * span > _DIRECTION * self.least)
        both = np.column_stack((weighed[: middle.size], np.diff(steps) / span**2))[free]
        if len(both) < FEWEST:
            return None
        known, _ = np.linalg.qr(np.column_stack((np.ones(middle.size), direction, velocity, middle))[free])
        both = both - known @ (known.T @ both)
        return both[:, 0], both[:, 1]

    @property
    def force(self) -> Array | None:
        """Force (N,) that the records show: of both pressures, or of a mechanical plant's drive; None without it."""
        if self.plant.model.kind == "mechanical":
            if self.plant.closes_a_loop:  # the drive is a position, and the force nowhere in the record
                return None
            force: Array = self.plant.value("drive_force") * self.plant.value("drive_limit") * self.opening
            return force
        if not {"pressure_a", "pressure_b"} <= self.signals.keys():
            return None
        a, b = self.plant.value("piston_area_a"), self.plant.value("piston_area_b")
        return a * self.signals["pressure_a"] - b * self.signals["pressure_b"]
