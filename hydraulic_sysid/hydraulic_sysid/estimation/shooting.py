"""Runs a plant over all segments of all records, and differentiates by parameters and by initial states."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant

from .parallel import results
from .parameters import Parameters
from .projection import Projection
from .run_ups import sufficient
from .segments import Segments

T = TypeVar("T")

_NUDGE = 1e-6  # of the mass: no propagation knows it any better
_MOST_KNOWN = 256  # propagations along a record that are kept
_STIFFEST = 4.0  # times shorter than the plant's: steps that a fit does not follow a parameter to, …
_ANYWAY = 2.5e-4  # s … unless they are as long as that
_STEP = 2e-3  # difference step of a parameter, of its value, …
_LEAST_STEP = 0.1  # … or of so much of its scale
_TURNED = 0.01  # rad, by which that of a frequency may turn what it drives at the end of a record
_NEAR_STOP = 0.05  # of the stroke: what goes no nearer to an end of it stays clear of the stop
_STATE_STEP = 0.5  # difference step of an initial state, of the noise of its channel
_VELOCITY_STEP = 1e-3  # m/s
_PRESSURE_STEP = 1e5  # Pa, where the pressure is not measured


@dataclass(frozen=True)
class Inner:
    """States of a plant that no sensor sees: their ``columns``, values (S, n_states) and the memories of its laws.

    ``pressures``: columns and values of those that are counted from there.
    """

    columns: list[int]
    values: Array
    memories: Array | None
    pressures: tuple[list[int], Array] | None = None

    def into(self, states: Array) -> tuple[Array, Array | None]:
        """These states (S, n_states) with the inner ones in their place."""
        if self.columns or self.pressures:
            states = states.copy()
        if self.columns:
            states[:, self.columns] = self.values[:, self.columns]
        if self.pressures:
            columns, values = self.pressures
            states[:, columns] += values[:, columns]
        return states, self.memories


@dataclass(frozen=True)
class Shooting:
    """A plant and the segments it is run over; initial states are passed in, per record (S, n_states).

    A pressure that nobody measured follows from motion and valve along the record; its initial state is what it is
    beyond that. Where a segment begins with a piston that hardly moves, dry friction is what its
    acceleration asks for, as far as it can be.

    ``misfit``: how many times the noise the model is off. While it is far off, pressures that nobody measured would
    take up its errors and leave all physical bounds; their priors count that many times.
    """

    plant: Plant
    segments: Sequence[Segments]
    misfit: float = 1.0

    @cached_property
    def _known(self) -> dict[tuple[int, tuple[float | str, ...], tuple[str, ...]], tuple[Array, Array]]:
        """What was propagated along a record, by record, path and library: most plants of a fit share it."""
        return {}

    @cached_property
    def initial_states(self) -> list[Array]:
        """As the records show them."""
        return [s.initial_states(self.plant) for s in self.segments]

    @cached_property
    def _turning(self) -> list[Array]:
        """The acceleration (S,) that dry friction is to give where segments begin at rest, per record."""
        return [s.turning(self.plant) for s in self.segments]

    def nearer(self, plant: Plant, other: Sequence[Array]) -> list[Array]:
        """Of `initial_states` and another set of them those that leave less beyond the nuisance, in each segment."""
        own, new = (self._left(self.residuals(plant, states)) for states in (self.initial_states, other))
        pairs = zip(self.initial_states, other, own, new, strict=True)
        return [np.where((b < a)[:, None], changed, states) for states, changed, a, b in pairs]

    def _left(self, raw: Sequence[Array]) -> list[Array]:
        return [s.all_nuisance[1].left(r) for s, r in zip(self.segments, raw, strict=True)]

    def try_out(self, plant: Plant, initial_states: Sequence[Array]) -> list[Array]:
        """The `residuals` of another plant.

        :raises hydraulic_sim.errors.SimulationError: it does not run, or is so stiff that fits stay away from it.
        """
        if plant.longest_step < min(self.plant.longest_step / _STIFFEST, _ANYWAY):
            raise SimulationError(
                f"{plant.model.name!r}: the physics asks for steps of {plant.longest_step:.2g} s, at the beginning of "
                f"the fit for {self.plant.longest_step:.2g} s"
            )
        return self.residuals(plant, [self._laid_out(plant, states) for states in initial_states])

    def _laid_out(self, plant: Plant, states: Array) -> Array:
        """These states (S, n_states) as another plant has them, of a library with other effects that are off."""
        own = self.plant.state_names
        if plant.state_names == own:
            return states
        column = {name: states[:, i] for i, name in enumerate(own)}
        return np.column_stack([column.get(name, np.zeros(len(states))) for name in plant.state_names])

    def residuals(self, plant: Plant, initial_states: Sequence[Array]) -> list[Array]:
        """(S, m) per record: measured − simulated over the noise, the priors of the initial states appended."""
        return self._map(lambda i: self._residual(plant, i, initial_states[i]), range(len(self.segments)))

    def projections(self, plant: Plant, initial_states: Sequence[Array]) -> list[Projection]:
        """Eliminate the initial states around those given."""
        return self._map(lambda i: self._projection(plant, i, initial_states[i]), range(len(self.segments)))

    def settled(
        self, plant: Plant, initial_states: Sequence[Array], shares: Sequence[float] = (1.0,)
    ) -> tuple[list[Array], list[Projection]]:
        """Initial states where the residual is smallest, to first order, and what is left there."""
        return self.improved(plant, initial_states, self.projections(plant, initial_states), shares)

    def improved(
        self,
        plant: Plant,
        initial_states: Sequence[Array],
        before: Sequence[Projection],
        shares: Sequence[float] = (1.0,),
    ) -> tuple[list[Array], list[Projection]]:
        """As `settled`, from residuals and directions that are known, which hardly change with the move.

        An initial state goes by that one of the ``shares`` of the way that leaves least, or stays where it was.
        """
        states, best = list(initial_states), list(before)
        for share in shares:
            moved = self.corrected(initial_states, before, [share * p.raw for p in before])
            with suppress(SimulationError):  # from so far off it does not run
                states, best = better_of((states, best), (moved, self.seen_from(before, plant, moved)))
        return states, best

    def better(
        self, plant: Plant, before: Sequence[Projection], one: Sequence[Array], other: Sequence[Array]
    ) -> tuple[list[Array], list[Projection]]:
        """Of two initial states of every segment those that leave less, in directions that are known."""
        tried = [p.with_raw(r) for p, r in zip(before, self.try_out(plant, one), strict=True)]
        return better_of((one, tried), (other, self.seen_from(before, plant, other)))

    def seen_from(self, before: Sequence[Projection], plant: Plant, states: Sequence[Array]) -> list[Projection]:
        """What another plant leaves with these initial states, in directions that are known."""
        return [p.with_raw(r) for p, r in zip(before, self.residuals(plant, states), strict=True)]

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
        longest = max(len(s.record) * s.record.dt for s in self.segments)
        steps = np.minimum(steps, _TURNED / np.maximum(parameters.turning * longest, 1e-300))
        steps = np.where(values + steps <= parameters.high, steps, -steps)
        moved = zip(parameters.keys, (values + steps).tolist(), strict=True)
        plants = [plant.with_parameters({key: value}) for key, value in moved]
        columns = [np.empty((*r.shape, len(parameters))) for r in base]

        def column(job: tuple[int, int]) -> None:
            k, i = job
            residual = self._residual(plants[k], i, initial_states[i])
            columns[i][..., k] = (residual - base[i]) * (scales[k] / steps[k])

        self._map(column, [(k, i) for k in range(len(plants)) for i in range(len(self.segments))])
        return columns

    def _map(self, function: Callable[..., T], items: Iterable) -> list[T]:
        return list(results(function, items))

    def _residual(self, plant: Plant, i: int, states: Array, inner: Inner | None = None) -> Array:
        segments = self.segments[i]
        run = self._run(plant, i, states, inner)
        # A sensor's offset or scale is no error of the state: what it reads is compared, not what is.
        seen = states.copy()
        seen[:, [plant.state_names.index(c) for c in segments.channels]] = run[:, 0]
        off = (self.initial_states[i][:, segments.free] - seen[:, segments.free]) / segments.prior_std
        if segments.tracked:
            off = np.where(segments.unmeasured_pressures, self.misfit / self.plant.value("supply_pressure") * off, off)
        return segments.deviation(run, off)

    def simulated(self, plant: Plant, initial_states: Sequence[Array]) -> list[Array]:
        """(S, samples, C) per record: the measured channels as they are in the plant [SI]."""
        return self._map(lambda i: self._run(plant, i, initial_states[i]), range(len(self.segments)))

    def driven(self, plant: Plant, i: int, initial_states: Array, drive: Array) -> Array:
        """As `simulated` for record ``i`` alone, with another drive (N,) [V] within the segments."""
        return self._run(plant, i, initial_states, drive=drive)

    def _run(
        self, plant: Plant, i: int, states: Array, inner: Inner | None = None, drive: Array | None = None
    ) -> Array:
        segments = self.segments[i]
        states, memories = (inner or self._inner(plant, i)).into(states)
        drive = segments.drive if drive is None else drive
        beside, shown = self._beside(plant, i), segments.shown if plant.begins_shown else None

        def seen(plant: Plant, own: Mask | slice) -> Array:
            return plant.predict_channels(
                segments.channels, drive, segments.record.dt, segments.first[own], segments.samples - 1, states[own],
                None if memories is None else memories[own], self._turning[i][own],
                None if shown is None else (shown[0][own], shown[1]),
            )  # fmt: skip

        free, clear = beside.clear_of_stops(), self._clear[i]
        if free is beside or not clear.any():
            return seen(beside, slice(None))
        if clear.all():
            return seen(free, slice(None))
        found = np.empty((len(states), segments.samples, len(segments.channels)))
        found[clear], found[~clear] = seen(free, clear), seen(beside, ~clear)
        return found

    def _inner(self, plant: Plant, i: int) -> Inner:
        """States that no sensor sees, propagated along the record up to each segment."""
        found, segments, plant = Inner([], np.empty(0), None), self.segments[i], self._beside(plant, i)
        if plant.has_inner_states:
            measured = segments.smoothed.shape[1]
            columns = [k for k, name in enumerate(plant.state_names) if k >= measured and name != "stick"]
            path, inner = plant.drive_path, plant.inner_path
            tracked = None if path is None else plant.driven
            found = Inner(columns, *self._track(plant, tracked, i, path or plant.path, inner, columns))
        if segments.tracked:
            # The piston moves as it was seen to, whatever its forces.
            path = ("held", *plant.held_path)
            values, _ = self._track(plant, plant.held, i, path, path, segments.tracked)
            found = replace(found, pressures=(segments.tracked, values))
        return found

    def _track(
        self,
        plant: Plant,
        made: Callable[[], Plant] | None,
        i: int,
        path: tuple[float | str, ...],
        hangs_on: tuple[float | str, ...],
        columns: list[int],
    ) -> tuple[Array, Array]:
        """States and memories at each segment; those of another plant of the same ``path``, where there was one.

        What is ``made`` of the plant is propagated. Only these ``columns`` of the states are of use; their memory
        ``hangs_on`` these effects and values.
        """
        key = (i, path, plant.layout.places)
        known = self._known.get(key)
        if known is None:
            plant = plant if made is None else made()
            if len(self._known) > _MOST_KNOWN:
                self._known.clear()
            segments, run_up = self.segments[i], self._run_up(plant, i, hangs_on, columns)
            known = plant.track(segments.drive, segments.record.dt, segments.first, segments.smoothed, run_up)
            self._known[key] = known
        return known

    def _run_up(self, plant: Plant, i: int, hangs_on: tuple[float | str, ...], columns: list[int]) -> int | None:
        """Samples before each segment from which on such a plant is propagated; None: from the beginning."""
        segments = self.segments[i]
        most = segments.longest_run_up
        if not most or (plant.lasting_memories and plant.drive_path is None):  # what never forgets the motion
            return None

        def propagated(plant: Plant, starts: Index, run_up: int | None) -> Array:
            states, _ = plant.track(segments.drive, segments.record.dt, starts, segments.smoothed, run_up)
            return states[:, columns]

        def seek(least: int, most: int) -> int | None:
            nudged = plant.with_parameters({"moving_mass": (1.0 + _NUDGE) * plant.value("moving_mass")})
            return sufficient(len(segments.drive), partial(propagated, plant), partial(propagated, nudged), least, most)

        return segments.run_ups.find(hangs_on, most, seek)

    def _beside(self, plant: Plant, i: int) -> Plant:
        """The plant with what record ``i`` states of the machine."""
        return plant.with_parameters(self.segments[i].record.settings)

    @cached_property
    def _clear(self) -> list[Mask]:
        """Which segments (S,) of each record stay clear of the model's end stops."""
        end = (0.5 - _NEAR_STOP) * self.plant.value("stroke")
        return [np.abs(s.measured[..., s.channels.index("position")]).max(axis=1) < end for s in self.segments]

    def _projection(self, plant: Plant, i: int, states: Array) -> Projection:
        segments, inner = self.segments[i], self._inner(plant, i)
        base = self._residual(plant, i, states, inner)
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
            jacobian[..., place] = (self._residual(plant, i, moved, inner) - base) / step
        return Projection.of(base, jacobian, *segments.all_nuisance)


def better_of(
    one: tuple[Sequence[Array], Sequence[Projection]], other: tuple[Sequence[Array], Sequence[Projection]]
) -> tuple[list[Array], list[Projection]]:
    """Of two initial states of every segment, and what they leave, those that leave less beyond the nuisance.

    That may take up most of what a move leaves.
    """

    def chosen(each: tuple[Array, Projection, Array, Projection]) -> tuple[Array, Projection]:
        old, p, new, q = each
        closer = (q.costs <= p.costs)[:, None]
        return np.where(closer, new, old), p.with_raw(np.where(closer, q.raw, p.raw))

    found = list(results(chosen, zip(*one, *other, strict=True)))
    return [states for states, _ in found], [left for _, left in found]
