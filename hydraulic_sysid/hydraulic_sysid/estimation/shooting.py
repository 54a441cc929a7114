"""Runs a plant over all pieces of all records, and differentiates by parameters and by initial states."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.plant import Plant

from .segments import Pieces

Array = NDArray[np.float64]

_STEP = 2e-3  # difference step of a parameter, of its scale
_STATE_STEP = 0.5  # difference step of an initial state, of the noise of its channel
_VELOCITY_STEP = 1e-3  # m/s
_PRESSURE_STEP = 1e5  # Pa, where the pressure is not measured


@dataclass(frozen=True)
class Linear:
    """Residuals of one record at a point, with the initial states eliminated.

    ``raw`` (S, m): measured − simulated in units of the noise, priors of the start appended; ``residual`` (S, m): the
    same after the best (linear) change of each start; ``basis`` (S, m, F) orthonormal columns of what the starts can
    explain; ``back`` (S, F, m) the change of the starts that a residual asks for.
    """

    raw: Array
    basis: Array
    back: Array

    @cached_property
    def residual(self) -> Array:
        """See above."""
        return self.project(self.raw)

    def project(self, values: Array) -> Array:
        """What of (S, m) the initial states cannot explain."""
        inner = self.basis.transpose(0, 2, 1) @ values[..., None]
        return values - (self.basis @ inner)[..., 0]


class Shooting:
    """A plant and the pieces it is run over; ``starts`` are changed by `settle`.

    ``misfit``: how many times the noise the model is off. While it is far off, pressures that nobody measured would
    take up its errors and leave all physical bounds; their priors count that many times.
    """

    def __init__(self, plant: Plant, pieces: Sequence[Pieces], workers: int | None = None) -> None:
        self.plant, self.pieces = plant, list(pieces)
        self.starts = [p.states.copy() for p in self.pieces]
        self.misfit = 1.0
        self._unseen = [_unseen(plant, p) for p in self.pieces]
        self._pool = _workers(workers or os.cpu_count() or 1)

    @property
    def guesses(self) -> bool:
        """Whether any start has pressures that were not measured."""
        return any(bool(u.any()) for u in self._unseen)

    def residuals(self, values: Mapping[str, float], starts: Sequence[Array] | None = None) -> list[Array]:
        """(S, m) per record, measured − simulated over noise with the starts' priors appended."""
        return self.run(self.plant.with_parameters(dict(values)), starts)

    def run(self, plant: Plant, starts: Sequence[Array] | None = None) -> list[Array]:
        """As `residuals`, of another plant."""
        chosen = self.starts if starts is None else starts
        return self._map(lambda i: self._residual(plant, i, chosen[i]), range(len(self.pieces)))

    def linearise(self, values: Mapping[str, float]) -> list[Linear]:
        """Eliminate the initial states around the present ones."""
        plant = self.plant.with_parameters(dict(values))
        return self._map(lambda i: self._linearise(plant, i), range(len(self.pieces)))

    def settle(self, values: Mapping[str, float]) -> list[Linear]:
        """Move every start to where its residual is smallest, to first order, and say what is left there.

        The directions in which the starts act are those before the move; they hardly change with it. A start that
        the move makes worse stays where it was.
        """
        linear = self.linearise(values)
        before = [s.copy() for s in self.starts]
        for i, lin in enumerate(linear):
            self.starts[i][:, self.pieces[i].free] += (lin.back @ lin.raw[..., None])[..., 0]
        settled = []
        for i, (raw, lin) in enumerate(zip(self.residuals(values), linear, strict=True)):
            worse = np.sum(raw**2, axis=1) > np.sum(lin.raw**2, axis=1)
            self.starts[i][worse] = before[i][worse]
            settled.append(Linear(np.where(worse[:, None], lin.raw, raw), lin.basis, lin.back))
        return settled

    def jacobian(self, values: Mapping[str, float], scales: Mapping[str, float], base: Sequence[Array]) -> list[Array]:
        """d(residual)/d(parameter/scale) per record (S, m, P), by one-sided differences that stay within bounds."""
        keys = list(scales)
        steps = {k: self._step(k, values[k], scales[k]) for k in keys}
        jobs = [(k, i) for k in keys for i in range(len(self.pieces))]
        plants = {k: self.plant.with_parameters({**values, k: values[k] + steps[k]}) for k in keys}
        found = self._map(lambda job: self._residual(plants[job[0]], job[1], self.starts[job[1]]), jobs)
        columns = dict(zip(jobs, found, strict=True))
        return [
            np.stack([(columns[k, i] - base[i]) * (scales[k] / steps[k]) for k in keys], axis=-1)
            for i in range(len(self.pieces))
        ]

    def _map(self, function: Callable, items) -> list:
        return list(self._pool.map(function, items))

    def _step(self, key: str, value: float, scale: float) -> float:
        high = self.plant.model.entry(key).bounds[1]  # type: ignore[index]
        step = _STEP * scale
        return step if value + step <= high else -step

    def _residual(self, plant: Plant, i: int, states: Array) -> Array:
        pieces = self.pieces[i]
        run = self._run(plant, pieces, states)
        simulated = np.stack([run[c] for c in pieces.channels], axis=-1) / pieces.noise
        off = (pieces.states[:, pieces.free] - states[:, pieces.free]) / pieces.prior
        off = np.where(self._unseen[i], self.misfit * off, off)
        return np.concatenate(((pieces.measured - simulated).reshape(len(pieces.starts), -1), off), axis=1)

    def _run(self, plant: Plant, pieces: Pieces, states: Array) -> dict[str, Array]:
        """The pieces simulated; states that no sensor sees follow the record up to each start."""
        drive, dt, memories = pieces.record["drive"], pieces.record.dt, None
        if plant.has_inner_states:
            tracked, memories = plant.track(drive, dt, pieces.starts, pieces.seen)
            inner = [i for i, name in enumerate(plant.state_names) if i >= pieces.seen.shape[1] and name != "stick"]
            states = states.copy()
            states[:, inner] = tracked[:, inner]
        return plant.predict(drive, dt, pieces.starts, pieces.samples - 1, states, memories)

    def _linearise(self, plant: Plant, i: int) -> Linear:
        pieces, states = self.pieces[i], self.starts[i]
        base = self._residual(plant, i, states)
        columns = []
        for index, name in ((k, self.plant.state_names[k]) for k in pieces.free):
            if name == "velocity":
                step = _VELOCITY_STEP
            elif name in pieces.channels:
                step = _STATE_STEP * pieces.noise[pieces.channels.index(name)]
            else:
                step = _PRESSURE_STEP
            moved = states.copy()
            moved[:, index] += step
            columns.append((self._residual(plant, i, moved) - base) / step)
        jacobian = np.stack(columns, axis=-1)
        basis, triangle = np.linalg.qr(jacobian)
        back = -np.linalg.solve(triangle, basis.transpose(0, 2, 1))
        return Linear(base, basis, back)


@lru_cache(maxsize=4)
def _workers(number: int) -> ThreadPoolExecutor:
    """The threads that all shootings of a process share; simulation holds no lock."""
    return ThreadPoolExecutor(number)


def _unseen(plant: Plant, pieces: Pieces) -> NDArray[np.bool_]:
    """(F,) which of the estimated states are pressures without a sensor."""
    names = [plant.state_names[k] for k in pieces.free]
    return np.array([n.startswith("pressure") and n not in pieces.channels for n in names])
