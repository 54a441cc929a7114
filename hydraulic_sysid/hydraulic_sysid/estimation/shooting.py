"""Runs a plant over all segments of all records, and differentiates by parameters and by initial states."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.plant import Plant

from .parameters import Parameters
from .projection import Projection
from .segments import Segments

T = TypeVar("T")

_STEP = 2e-3  # difference step of a parameter, of its value, …
_LEAST_STEP = 0.1  # … or of so much of its scale
_STATE_STEP = 0.5  # difference step of an initial state, of the noise of its channel
_VELOCITY_STEP = 1e-3  # m/s
_PRESSURE_STEP = 1e5  # Pa, where the pressure is not measured


@dataclass(frozen=True)
class Shooting:
    """A plant and the segments it is run over; initial states are passed in, per record (S, n_states).

    ``misfit``: how many times the noise the model is off. While it is far off, pressures that nobody measured would
    take up its errors and leave all physical bounds; their priors count that many times.
    """

    plant: Plant
    segments: Sequence[Segments]
    misfit: float = 1.0

    @cached_property
    def initial_states(self) -> list[Array]:
        """As the records show them."""
        return [s.initial_states(self.plant) for s in self.segments]

    def residuals(self, plant: Plant, initial_states: Sequence[Array]) -> list[Array]:
        """(S, m) per record: measured − simulated over the noise, the priors of the initial states appended."""
        return self._map(lambda i: self._residual(plant, i, initial_states[i]), range(len(self.segments)))

    def projections(self, plant: Plant, initial_states: Sequence[Array]) -> list[Projection]:
        """Eliminate the initial states around those given."""
        return self._map(lambda i: self._projection(plant, i, initial_states[i]), range(len(self.segments)))

    def settled(self, plant: Plant, initial_states: Sequence[Array]) -> tuple[list[Array], list[Projection]]:
        """Initial states where the residual is smallest, to first order, and what is left there.

        The directions in which they act are those before the move; they hardly change with it. An initial state that
        the move makes worse stays where it was.
        """
        before = self.projections(plant, initial_states)
        moved = self.corrected(initial_states, before, [p.raw for p in before])
        states, projections = [], []
        for old, new, raw, p in zip(initial_states, moved, self.residuals(plant, moved), before, strict=True):
            better = (np.sum(raw**2, axis=1) <= np.sum(p.raw**2, axis=1))[:, None]
            states.append(np.where(better, new, old))
            projections.append(Projection(np.where(better, raw, p.raw), p.basis, p.correction))
        return states, projections

    def corrected(
        self, initial_states: Sequence[Array], projections: Sequence[Projection], residuals: Sequence[Array]
    ) -> list[Array]:
        """Initial states moved to where these residuals (S, m) ask for, to first order."""
        found = []
        for segments, states, p, r in zip(self.segments, initial_states, projections, residuals, strict=True):
            new = states.copy()
            new[:, segments.free] += (p.correction @ r[..., None])[..., 0]
            found.append(new)
        return found

    def jacobian(
        self, plant: Plant, parameters: Parameters, initial_states: Sequence[Array], base: Sequence[Array]
    ) -> list[Array]:
        """d(residual)/d(parameter/scale) per record (S, m, P), by one-sided differences that stay within bounds.

        ``plant`` has ``parameters``, and ``base`` are its residuals.
        """
        values, scales = parameters.values, parameters.scales
        steps = _STEP * np.maximum(np.abs(values), _LEAST_STEP * scales)
        steps = np.where(values + steps <= parameters.high, steps, -steps)
        moved = zip(parameters.keys, (values + steps).tolist(), strict=True)
        plants = [plant.with_parameters({key: value}) for key, value in moved]
        jobs = [(p, i) for p in plants for i in range(len(self.segments))]
        found = self._map(lambda job: self._residual(job[0], job[1], initial_states[job[1]]), jobs)
        columns = [np.empty((*r.shape, len(parameters))) for r in base]
        for number, residual in enumerate(found):
            k, i = divmod(number, len(self.segments))
            columns[i][..., k] = (residual - base[i]) * (scales[k] / steps[k])
        return columns

    def _map(self, function: Callable[..., T], items: Iterable) -> list[T]:
        return list(_workers(os.cpu_count() or 1).map(function, items))

    def _residual(self, plant: Plant, i: int, states: Array) -> Array:
        segments = self.segments[i]
        run = self._run(plant, segments, states)
        simulated = np.stack([run[c] for c in segments.channels], axis=-1) / segments.noise_std
        off = (self.initial_states[i] - states)[:, segments.free] / segments.prior_std
        off = np.where(segments.unmeasured_pressures, self.misfit * off, off)
        return np.concatenate(((segments.measured - simulated).reshape(len(segments), -1), off), axis=1)

    def _run(self, plant: Plant, segments: Segments, states: Array) -> dict[str, Array]:
        """The segments simulated; states that no sensor sees are propagated along the record up to each segment."""
        drive, dt, memories = segments.record["drive"], segments.record.dt, None
        if plant.has_inner_states:
            tracked, memories = plant.track(drive, dt, segments.first, segments.smoothed)
            measured = segments.smoothed.shape[1]
            inner = [i for i, name in enumerate(plant.state_names) if i >= measured and name != "stick"]
            states = states.copy()
            states[:, inner] = tracked[:, inner]
        return plant.predict(drive, dt, segments.first, segments.samples - 1, states, memories)

    def _projection(self, plant: Plant, i: int, states: Array) -> Projection:
        segments = self.segments[i]
        base = self._residual(plant, i, states)
        jacobian = np.empty((*base.shape, len(segments.free)))
        for place, index in enumerate(segments.free):
            name = plant.state_names[index]
            if name == "velocity":
                step = _VELOCITY_STEP
            elif name in segments.channels:
                step = _STATE_STEP * float(segments.noise_std[segments.channels.index(name)])
            else:
                step = _PRESSURE_STEP
            moved = states.copy()
            moved[:, index] += step
            jacobian[..., place] = (self._residual(plant, i, moved) - base) / step
        return Projection.of(base, jacobian)


@lru_cache(maxsize=4)
def _workers(number: int) -> ThreadPoolExecutor:
    """The threads that all shootings of a process share; simulation holds no lock."""
    return ThreadPoolExecutor(number)
