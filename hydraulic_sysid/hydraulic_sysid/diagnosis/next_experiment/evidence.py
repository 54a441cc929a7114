"""How well an experiment would distinguish models after each of them has been refitted to it.

Model r, refitted to what model t does, is off by

    λ_tr = min over δ of ‖(y_t − y_r − J_r·δ)/σ‖²,

the sum of squares over the noise that no change of its free parameters (and of the segments' initial states) takes
away: the criterion of T-optimality (Atkinson & Fedorov, Biometrika 62 (1975) 57-70 and 289-303), here with the
sensitivities J_r at the fitted parameters. Half the width between the bounds of a parameter counts as one standard
deviation that is known of it. Experiments add up: so do ‖y_t − y_r‖², J_r'·(y_t − y_r) and J_r'·J_r, which is all that
is kept of one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant, Trajectory
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.fit import FitPoint
from hydraulic_sysid.estimation.noise_model import ChannelNoise
from hydraulic_sysid.estimation.parameters import Parameters
from hydraulic_sysid.estimation.segments import Segments, cut
from hydraulic_sysid.estimation.shooting import Shooting

Pair = tuple[int, int]
"""Numbers of two points: what would be true, and what is refitted to it."""


@dataclass(frozen=True)
class Point:
    """A model at certain parameters. ``name``: of the model; several points may be of one."""

    name: str
    model: Model

    @cached_property
    def plant(self) -> Plant:
        """The model made executable."""
        return Plant(self.model)

    @cached_property
    def parameters(self) -> Parameters:
        """What is refitted."""
        return Parameters.of(self.model, self.model.movable_keys())

    @cached_property
    def prior(self) -> Array:
        """(P, P) the information in the parameters' bounds, in units of the parameters' scales."""
        return np.diag((2.0 * self.parameters.scales / (self.parameters.high - self.parameters.low)) ** 2)


@dataclass(frozen=True)
class Evidence:
    """What one or several experiments show: per pair ‖d‖² and J'd (P,), per point J'J (P, P)."""

    squares: Mapping[Pair, float]
    gradients: Mapping[Pair, Array]
    information: Mapping[int, Array]

    def __add__(self, other: Evidence) -> Evidence:
        return Evidence(
            {p: v + other.squares[p] for p, v in self.squares.items()},
            {p: v + other.gradients[p] for p, v in self.gradients.items()},
            {i: v + other.information[i] for i, v in self.information.items()},
        )

    def left(self, points: Sequence[Point]) -> dict[Pair, float]:
        """λ of every pair."""
        found = {}
        for pair, squares in self.squares.items():
            known, gradient = self.information[pair[1]] + points[pair[1]].prior, self.gradients[pair]
            taken = float(gradient @ np.linalg.solve(known, gradient)) if gradient.size else 0.0
            found[pair] = max(squares - taken, 0.0)
        return found


def pairs(points: Sequence[Point], first: int) -> list[Pair]:
    """Every model as it was fitted (the ``first`` points) against every point of another one."""
    return [(t, r) for t in range(first) for r, p in enumerate(points) if p.name != points[t].name]


def as_record(name: str, run: Trajectory, dt: float, channels: Sequence[str], spool_travel: float) -> Record:
    """The channels of a trajectory that are measured, without noise."""
    found = {c: run[c] * (spool_travel if c == "spool" else 1.0) for c in channels}
    return Record.sampled(name, dt, {"drive": run.drive, **found})


def segments(record: Record, kind: str, length: float, noise: Mapping[str, float]) -> Segments:
    """The record in segments, to be judged by the ``noise`` of its channels (the record itself has none)."""
    (found,) = cut([record], kind, length)
    return found.with_noise([ChannelNoise.white(noise[c]) for c in found.channels])


def evidence(
    points: Sequence[Point], chosen: Sequence[Pair], record: Record, noise: Mapping[str, float], length: float
) -> Evidence:
    """What an experiment shows, ``record`` being what the first point does in it.

    :raises SimulationError: a model cannot follow.
    """
    linear, columns = [], []
    cuts = segments(record, points[0].model.kind, length, noise)
    for point in points:
        shooting = Shooting(point.plant, [cuts])
        projections = shooting.projections(point.plant, shooting.initial_states)
        at = FitPoint(shooting, point.parameters, shooting.initial_states, projections)
        linear.append(projections[0])
        columns.append(at.beyond(at.columns)[0].reshape(-1, len(point.parameters)))
    squares, gradients = {}, {}
    for t, r in chosen:
        apart = linear[r].beyond((linear[r].raw - linear[t].raw)[..., None]).ravel()
        squares[t, r] = float(apart @ apart)
        gradients[t, r] = columns[r].T @ apart
    return Evidence(squares, gradients, {i: c.T @ c for i, c in enumerate(columns)})
