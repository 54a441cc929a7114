"""Curves of the force that a motion asks for beyond a model, where the drive is that force: no motion is simulated.

What a model lacks bends its motion, and to first order around a bent motion a curve may be anything. Force by force
nothing is bent: mass times acceleration and what the model's forces give are known at every sample, and a curve beside
the free parameters follows by least squares (Gautier & Khalil, Proc. IEEE Int. Conf. Robotics and Automation 1990,
1027-1032).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.effect import arguments
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.diagnosis.locate.basis import hat_functions
from hydraulic_sysid.estimation.parameters import Parameters
from hydraulic_sysid.estimation.segments import Segments

from .force_balance import BLOCK, STEP, drives_by_force
from .nonparametric_curves import Place

RATE = 400.0  # samples per second that are looked at
SMOOTH = 0.03  # of what a column is: weight of second differences of a curve, which decides where nothing is seen


@dataclass(frozen=True)
class ForceCurve:
    """A curve at a place: ``heights`` (K,) [N] at ``knots``, and ``values`` of the free parameters beside it.

    ``share`` (0…1): of the squared force that the free parameters leave, each half judged by the other's values.
    """

    place: Place
    knots: Array
    heights: Array
    values: dict[str, float]
    share: float


@dataclass(frozen=True)
class Forces:
    """What records ask for beyond a model at some of their samples.

    ``left`` (n,) [N]; ``columns`` (n, P): what the ``free`` parameters give more with each scale; ``direction`` (n,) of
    motion; ``kept``: the samples of each record; ``half`` (n,): blocks that are judged by the others' values.
    """

    free: Parameters
    left: Array
    columns: Array
    direction: Array
    kept: Index
    half: Mask

    @classmethod
    def of(cls, model: Model, free: Parameters, segments: Sequence[Segments]) -> Forces | None:
        """None where the drive is not the force, or passes a law with a memory first, or no parameter is free.

        None, too, where the model does not run along a record.
        """
        late = any(model.library[name].slot == "command" for name in model.effects)
        if late or not len(free) or not drives_by_force(model):
            return None
        plant = Plant(model).with_parameters(free.by_key)
        moved = (free.values + STEP * free.scales).tolist()
        plants = [plant, *(plant.with_parameters({k: v}) for k, v in zip(free.keys, moved, strict=True))]
        kept = [np.arange(0, len(s.record), max(round(1.0 / (RATE * s.record.dt)), 1)) for s in segments]
        try:
            found = [_forces(plants, s, own) for s, own in zip(segments, kept, strict=True)]
        except SimulationError:
            return None
        given, direction = (np.concatenate(part) for part in zip(*found, strict=True))
        half = np.concatenate([own * s.record.dt // BLOCK % 2 == 0 for own, s in zip(kept, segments, strict=True)])
        begin = np.cumsum([0, *(len(s.record) for s in segments)])
        samples = np.concatenate([own + n for own, n in zip(kept, begin, strict=False)])
        return cls(free, given[:, 0], (given[:, :1] - given[:, 1:]) / STEP, direction, samples, half)

    def curve(self, place: Place, knots: Array) -> ForceCurve:
        """The curve there."""
        hats = hat_functions(place.values[self.kept], knots).T
        if "direction" in arguments(place.effect.kernel):
            hats = hats * self.direction[:, None]
        change, left = self._solved(np.column_stack((self.columns, hats)))
        own, heights = np.split(change, [len(self.free)])
        return ForceCurve(place, knots, heights, self.free.moved(own).by_key, 1.0 - left / self._bare[1])

    @property
    def values(self) -> dict[str, float]:
        """Of the free parameters as the forces ask for."""
        return self.free.moved(self._bare[0]).by_key

    @cached_property
    def _bare(self) -> tuple[Array, float]:
        """As `_solved`, by the free parameters alone."""
        return self._solved(self.columns)

    def _solved(self, columns: Array) -> tuple[Array, float]:
        """What of the columns (n, P + K) gives the force (P + K,), and the mean square of each half by the other [N²].

        They are what a model gives against the motion more than before.
        """
        free, number = self.free, columns.shape[1] - len(self.free)
        far = np.full(number, np.inf)
        low, high = (np.concatenate(ends) for ends in zip(free.reach, (-far, far), strict=True))
        bend = np.zeros((max(number - 2, 0), columns.shape[1]))
        if number > 2:
            size = SMOOTH * float(np.linalg.norm(columns[:, len(free) :], axis=0).max())
            bend[:, len(free) :] = size * np.diff(np.eye(number), 2, axis=0)

        def solve(rows: Mask) -> Array:
            aim = np.concatenate((self.left[rows], np.zeros(len(bend))))
            return np.asarray(lsq_linear(np.concatenate((columns[rows], bend)), aim, (low, high)).x)

        squares = [float(np.sum((self.left - columns @ solve(seen))[~seen] ** 2)) for seen in (self.half, ~self.half)]
        return solve(np.ones_like(self.half)), sum(squares) / self.left.size


def _forces(plants: Sequence[Plant], segments: Segments, every: Index) -> tuple[Array, Array]:
    """What each plant gives against the motion beyond what the motion asks for (n, Q) [N], and the direction (n,)."""
    record = segments.record
    dt, drive = record.dt, np.asarray(record["drive"], dtype=np.float64)
    acceleration = np.gradient(segments.smoothed[:, 1], dt)[every]
    found, direction = np.empty((len(every), len(plants))), np.empty(len(every))
    for number, plant in enumerate(plants):
        beside = plant.with_parameters(record.settings)
        # Dry friction turns with the motion that was seen: moved by the drive, it would make up for what is missing.
        states, _ = beside.held().track(drive, dt, every, segments.smoothed)
        given = [beside.derivative(x, drive[k], k * dt) for x, k in zip(states, every, strict=True)]
        own = np.array([slope[1] for slope, _ in given])
        found[:, number] = beside.mass * (own - acceleration)
        if number == 0:
            direction[:] = [signals["direction"] for _, signals in given]
    return found, direction
