"""What an effect explains of the force that a model leaves, by inverse dynamics, where the drive is the force itself.

A position that is read finely enough shows every newton that ripples and rubs somewhere. By its noise all laws are far
off then, and one that is missing in every stroke hardly less than none, since forces are integrated twice. So forces
are compared as forces: what the measured motion asks for beyond the model is explained by least squares, by the model's
free parameters and one candidate at a time, to first order, in as wide a band as the sensor's noise leaves (Gautier &
Khalil, Proc. IEEE Int. Conf. Robotics and Automation 1990, 1027–1032).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sim.effect import Effect, arguments
from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.compare.channels import Scales, measured
from hydraulic_sysid.diagnosis.locate.balances import Balances
from hydraulic_sysid.diagnosis.locate.sensor_errors import SensorErrors
from hydraulic_sysid.diagnosis.locate.whitening import decimate
from hydraulic_sysid.estimation.parameters import Parameters

from .candidates import between
from .score_test import CandidateScore

STEP = 1e-3  # difference step of a parameter, of its scale
NOISY = 0.3  # of the mean square that is left: so much of it the sensor's noise may be in the widest band
RATES = (400.0, 200.0, 100.0, 50.0, 25.0)  # per second, of what is kept
EDGE = 0.1  # s at either end of a record, where smoothing filters have one side only
MOST = 5  # candidates that run with the size that was found for them
SHORTEST = 1.0  # s, of a record
BLOCK = 0.5  # s: one of two has the values by which the other is judged
SOURCE = "fitted to the forces"
SENSORS = SensorErrors()  # a model that is judged by its forces has sensors that show them


@dataclass(frozen=True)
class ForceShare:
    """What an effect explains of the squared force that a model leaves (0…1); ``left``: that force, rms [N].

    Each half of the records is judged by the values of the other. ``without`` and ``model``: fitted to the forces,
    without the effect and with it.
    """

    name: str
    share: float
    left: float
    without: Model
    model: Model


def drives_by_force(model: Model) -> bool:
    """Whether the drive of a model is the force itself: no oil is between them, nor a position loop."""
    return model.kind != "hydraulic" and all(model.library[name].slot != "loop" for name in model.effects)


def follows_from_motion(effect: Effect) -> bool:
    """Whether an effect is a force, and no part of what drives it."""
    return effect.slot == "force" and effect.kernel is not None and "actuator_force" not in arguments(effect.kernel)


def force_shares(model: Model, records: Sequence[Record], scores: Sequence[CandidateScore]) -> list[ForceShare]:
    """Of the best candidates, each in the shape in which it explains most; the largest share first.

    Candidates are forces that follow from the motion. Where a controller closes the loop, the drive answers to what no
    law gives, and whatever follows from the drive would seem to explain that. None where no parameter is free, or all
    records are too short.

    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    sides = [_Side.of(model, record, number) for number, record in enumerate(records) if record.duration >= SHORTEST]
    free = Parameters.of(model, model.free_keys())
    if not (sides and len(free)):
        return []
    nudged = zip(free.keys, free.values, free.scales, strict=True)
    moved = [model.with_values({k: v + STEP * scale}) for k, v, scale in nudged]
    changes = [[s.change(m) for s in sides] for m in moved]
    for rate in RATES:
        known = np.column_stack([_kept(sides, change, rate) for change in changes]) / STEP
        force, noise = (_kept(sides, own, rate) for own in ([s.own for s in sides], [s.noise for s in sides]))
        bare = _Fit.of(known, force, (free.low - free.values) / free.scales, (free.high - free.values) / free.scales)
        if np.mean(noise**2) < NOISY * bare.left:
            break
    half = np.arange(force.size) // max(round(BLOCK * rate), 1) % 2 == 0
    without, unexplained = model.with_values(free.moved(bare.change).by_key, source=SOURCE), bare.held_out(half)
    found = []
    for one in (s for s in scores if follows_from_motion(s.effect)):
        for start in ({}, one.start, *one.others):
            other = model.with_effect(one.effect.name, {k.partition(".")[2]: v for k, v in start.items()})
            column = _kept(sides, [s.change(other) for s in sides], rate)
            if not np.any(column):
                continue
            fit = bare.beside(column, one.effect)
            values = {**free.moved(fit.change[:-1]).by_key, **_sized(other, one.effect, float(fit.change[-1]))}
            done, share = other.with_values(values, source=SOURCE), 1.0 - fit.held_out(half) / unexplained
            found.append(ForceShare(one.effect.name, share, bare.left**0.5, without, done))
    best = {f.name: f for f in sorted(found, key=lambda f: f.share)}
    near = list(best.values())[-MOST:]
    # Forces that are not proportional to what an effect's parameters are give less than they promise.
    given = [np.mean(_kept(sides, [s.asked(f.model) for s in sides], rate) ** 2) for f in near]
    kept = [replace(f, share=min(f.share, 1.0 - float(g) / bare.left)) for f, g in zip(near, given, strict=True)]
    return sorted(kept, key=lambda f: -f.share)


@dataclass(frozen=True)
class _Fit:
    """Least squares of forces (n,) [N] by ``columns`` (n, P) within bounds (P,), and the ``change`` (P,) found."""

    columns: Array
    force: Array
    low: Array
    high: Array
    change: Array

    @classmethod
    def of(cls, columns: Array, force: Array, low: Array, high: Array) -> _Fit:
        """The columns are what the model gives more than before."""
        return cls(columns, force, low, high, np.asarray(lsq_linear(columns, -force, (low, high)).x))

    @property
    def left(self) -> float:
        """Mean square [N²]."""
        return float(np.mean((self.force + self.columns @ self.change) ** 2))

    def beside(self, column: Array, effect: Effect) -> _Fit:
        """With what an effect changes (n,), 0 to all that its parameters may be times so much."""
        low = 0.0 if all(p.null is None or p.null <= p.bounds[0] for p in effect.parameters) else -np.inf
        wider = np.column_stack([self.columns, column])
        return _Fit.of(wider, self.force, np.append(self.low, low), np.append(self.high, np.inf))

    def held_out(self, half: Mask) -> float:
        """Mean square [N²] of each half by the values of the other."""
        total = 0.0
        for seen in (half, ~half):
            change = _Fit.of(self.columns[seen], self.force[seen], self.low, self.high).change
            total += float(np.sum((self.force[~seen] + self.columns[~seen] @ change) ** 2))
        return total / self.force.size


def _sized(model: Model, effect: Effect, times: float) -> dict[str, float]:
    """Values of an effect that acts so many times as much as that of a model, by key."""
    found = {}
    for p in effect.parameters:
        if p.null is not None:
            key = f"{effect.name}.{p.name}"
            value = between(p.null, model.value(key), times, p.default)
            found[key] = min(max(value, p.bounds[0]), p.bounds[1])
    return found


@dataclass(frozen=True)
class _Side:
    """One record: the force ``own`` (n,) that it asks for beyond a model [N], and the sensor's ``noise`` in it."""

    asked: Callable[[Model], Array]
    record: Record
    own: Array
    noise: Array

    @classmethod
    def of(cls, model: Model, record: Record, seed: int) -> _Side:
        data = measured(record, Scales.of(model))
        position, std = data.channels["position"], data.noise["position"]

        def asked(model: Model, position: Array = position) -> Array:
            balances = Balances(model, spool_measured=False).with_parameters(record.settings)
            channels = {"drive": data.channels["drive"], "position": position}
            return balances.form(channels, record.dt, ("force",), data.velocity_filter, SENSORS).values[0]

        own = asked(model)
        noisy = asked(model, position + std * np.random.default_rng(seed).standard_normal(len(record)))
        return cls(asked, record, own, noisy - own)

    def change(self, model: Model) -> Array:
        """(n,) by how much another model asks for more [N]."""
        return self.asked(model) - self.own


def _kept(sides: Sequence[_Side], forces: Sequence[Array], rate: float) -> Array:
    """Forces of all records in the band of a ``rate`` [1/s], one after the other, without their ends."""
    kept = []
    for side, force in zip(sides, forces, strict=True):
        factor = max(round(1.0 / (rate * side.record.dt)), 1)
        edge = max(round(EDGE / (factor * side.record.dt)), 1)
        kept.append(decimate(force, factor)[edge:-edge])
    return np.concatenate(kept)
