"""How much an experiment would tell rivals apart after each of them has been refitted to it.

Rival r, refitted to what rival t does, is off by

    λ_tr = min over δ of ‖(y_t − y_r − J_r·δ)/σ‖²,

the sum of squares over the noise that no change of its free parameters (and of the starts of pieces) takes away: the
criterion of T-optimality (Atkinson & Fedorov, Biometrika 62 (1975) 57-70 and 289-303), here with the sensitivities J_r
at the fitted parameters. Parameters are held by their bounds, half of whose width counts as one standard deviation.
Experiments add up: so do ‖y_t − y_r‖², J_r'·(y_t − y_r) and J_r'·J_r, which is all that is kept of one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant, Trajectory
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.estimate import scale
from hydraulic_sysid.estimation.segments import Pieces, cut
from hydraulic_sysid.estimation.shooting import Shooting

Array = NDArray[np.float64]
Pair = tuple[int, int]
"""Numbers of two points: what would be true, and what is refitted to it."""


@dataclass(frozen=True)
class Point:
    """A rival at certain parameters. ``rival``: its name; several points may be of one rival."""

    rival: str
    model: Model

    @cached_property
    def plant(self) -> Plant:
        """The model made executable."""
        return Plant(self.model)

    @cached_property
    def keys(self) -> list[str]:
        """What is refitted: the free parameters and those that smooth corners."""
        return list(dict.fromkeys((*self.model.free_keys(), *self.model.nuisance_keys())))

    @cached_property
    def held(self) -> Array:
        """(P, P) what the parameters' bounds tell, in units of the parameters' scales."""
        widths = [high - low for low, high in (self.model.entry(k).bounds for k in self.keys)]  # type: ignore[misc]
        sizes = np.array([scale(self.model, k) for k in self.keys])
        return np.diag((2.0 * sizes / np.array(widths)) ** 2)


@dataclass(frozen=True)
class Evidence:
    """What one or several experiments tell: per pair ‖d‖² and J'd (P,), per point J'J (P, P)."""

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
            known, gradient = self.information[pair[1]] + points[pair[1]].held, self.gradients[pair]
            taken = float(gradient @ np.linalg.solve(known, gradient)) if gradient.size else 0.0
            found[pair] = max(squares - taken, 0.0)
        return found


def pairs(points: Sequence[Point], first: int) -> list[Pair]:
    """Every rival as it was fitted (the ``first`` points) against every point of another one."""
    return [(t, r) for t in range(first) for r, p in enumerate(points) if p.rival != points[t].rival]


def as_record(name: str, run: Trajectory, dt: float, channels: Sequence[str], spool_travel: float) -> Record:
    """The channels of a trajectory that are measured, without noise."""
    found = {c: run[c] * (spool_travel if c == "spool" else 1.0) for c in channels}
    return Record.sampled(name, dt, {"drive": run.drive, **found})


def pieces(record: Record, plant: Plant, length: float, noise: Mapping[str, float]) -> Pieces:
    """The record in pieces, to be judged by the ``noise`` of its channels (the record itself has none)."""
    (found,) = cut([record], plant, length)
    sigma = np.array([noise[c] for c in found.channels])
    ratio = found.noise / sigma
    prior = found.prior.copy()
    for place, index in enumerate(found.free):
        name = plant.state_names[index]
        if name in found.channels:
            prior[place] /= ratio[found.channels.index(name)]
    return replace(found, noise=sigma, measured=found.measured * ratio, prior=prior)


def evidence(
    points: Sequence[Point], chosen: Sequence[Pair], record: Record, noise: Mapping[str, float], length: float
) -> Evidence:
    """What an experiment tells, ``record`` being what the first point does in it.

    Raises `hydraulic_sim.errors.SimulationError` where a rival cannot follow.
    """
    raw, bases, columns = [], [], []
    parts = pieces(record, points[0].plant, length, noise)
    for point in points:
        if point.plant.state_names != points[0].plant.state_names:  # effects of their own bring states of their own
            parts = pieces(record, point.plant, length, noise)
        shooting = Shooting(point.plant, [parts])
        values = {k: point.model.value(k) for k in point.keys}
        (linear,) = shooting.linearise(values)
        scales = {k: scale(point.model, k) for k in point.keys}
        none = np.zeros((*linear.raw.shape, 0))
        jacobian = shooting.jacobian(values, scales, [linear.raw])[0] if scales else none
        raw.append(linear.raw)
        bases.append(linear)
        seen = np.einsum("smf,smp->sfp", linear.basis, jacobian, optimize=True)
        beyond = jacobian - np.einsum("smf,sfp->smp", linear.basis, seen, optimize=True)
        columns.append(beyond.reshape(-1, jacobian.shape[-1]))
    squares, gradients = {}, {}
    for t, r in chosen:
        apart = bases[r].project(raw[r] - raw[t]).ravel()
        squares[t, r] = float(apart @ apart)
        gradients[t, r] = columns[r].T @ apart
    return Evidence(squares, gradients, {i: c.T @ c for i, c in enumerate(columns)})
