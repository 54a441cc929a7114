"""The plant: a model made executable. Simulates records, steps live, and offers its right-hand side."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from . import base, rates
from .acting import STOPS
from .arrays import Array
from .compiled import compiled
from .effect import arguments
from .embedded import Embedded
from .errors import SimulationError
from .model import Model
from .trajectory import PlantState, Trajectory

LONGEST_MEMORY = 256  # samples of past drive that effects on the command may need
LONGEST_STEP = 5e-4  # s; shortened where an effect or the oil is faster
# s, and how much longer than otherwise: off by a hundredth of the sensors' noise on all benches tried
FIT_STEP, FIT_REFINEMENT = {"hydraulic": 1e-3, "mechanical": 5e-3}, 2.2
YIELDS = {"hydraulic": 1e-5, "mechanical": 1e-4}  # of the stroke, by the full force: less than sensors of such see
HEAVY = 1e6
_READINGS = 4  # of the outputs, the first: what sensors read
FOLLOWED = 1e-3  # change of an output, of its range, by half the step that still counts as following the physics
MOST_HALVINGS = 6
CORRECTED_EVERY = 4  # samples after which a tracked plant is set to what was measured


class Plant:
    """A model composed and compiled.

    Building one costs about 0.1 ms once the library is compiled in this process. Simulation releases the GIL.
    ``longest_step`` [s] is shortened where the physics is faster; ``refinement`` shortens the steps that follow the
    oil through the lands as well (see `following`), above 1 it lengthens those that follow all else.

    :raises ModelError: a model that does not compose (two laws in one slot, missing base parameters).
    """

    def __init__(self, model: Model, longest_step: float = LONGEST_STEP, refinement: float = 1.0) -> None:
        model.check_complete()
        self.model = model
        self._compiled = compiled(model.library)
        layout = self._compiled.layout
        self.layout = layout
        self._on = np.zeros(len(layout.effects), dtype=np.uint8)
        active = (*model.effects, *(e.name for e in layout.library.values() if e.always_on))
        for name in active:
            self._on[layout.effects[name]] = 1
        self._parameters = np.array([model.value(key) for key in layout.parameters])
        self._hydraulic = np.uint8(model.kind == "hydraulic")
        self._acting = self._compiled.acting(active)
        values = self._values()
        self.refinement, self._allowed_step = refinement, longest_step
        fastest, clear = self._fastest(values)
        self.longest_step, self._clear_step = (rates.step(r, longest_step, refinement) for r in (fastest, clear))
        self._shortest_dt = rates.shortest_sampling(self._acting.effects, values)

    def _fastest(self, values: dict[str, float]) -> tuple[float, float]:
        """The fastest rate [1/s] for such values, and that away from the stops."""
        causes = rates.by_cause(self._acting.effects, values, self.model.kind)
        clear = (rate for name, rate in causes.items() if name != STOPS)
        return max(causes.values(), default=0.0), max(clear, default=0.0)

    def _values(self) -> dict[str, float]:
        return dict(zip(self.layout.parameters, self._parameters.tolist(), strict=True))

    @classmethod
    def at_rate(cls, model: Model, rate: float) -> Plant:
        """The plant of a model, its step fine enough for drives sampled at ``rate`` [Hz] (see `following`).

        Tried on half a second of a sweep from 1 to 40 Hz at a third of the drive.

        :raises SimulationError: no step follows its physics.
        """
        t = np.arange(max(2, round(0.5 * rate))) / rate
        sweep = model.value("drive_limit") / 3.0 * np.sin(2.0 * np.pi * (1.0 + 39.0 * t) * t)
        return cls(model).following(sweep, 1.0 / rate)

    @classmethod
    def for_fits(cls, model: Model) -> Plant:
        """The plant of a model with steps as long as do where sensors' noise hides the integrator's error.

        End stops so stiff that no sensor sees them yield would ask for short steps everywhere, and are softer.
        """
        key = f"{STOPS}.stiffness"
        if not model.entry(key).free:
            values = {k: model.value(k) for k in model.keys()}  # noqa: SIM118, a method of the model
            if model.kind == "hydraulic":
                force = values["supply_pressure"] * max(values["piston_area_a"], values["piston_area_b"])
            else:
                force = abs(values["drive_force"] * values["drive_limit"])
            enough = force / (YIELDS[model.kind] * values["stroke"])
            if values[key] > enough >= model.parameter(key).bounds[0]:
                model = model.with_values({key: enough})
        return cls(model, FIT_STEP[model.kind], FIT_REFINEMENT)

    @property
    def fastest(self) -> tuple[str, float, float]:
        """What asks for the shortest steps away from the stops: an effect or ``oil``, its rate [1/s], the step [s]."""
        causes = rates.by_cause(self._acting.but_stops, self._values(), self.model.kind)
        cause = max(causes, key=lambda name: causes[name], default="")
        return cause, causes.get(cause, 0.0), self._clear_step

    def held(self) -> Plant:
        """This plant with a piston so heavy that no force moves it within a few samples: it goes where it was seen."""
        other = self.with_parameters({"moving_mass": HEAVY * self.value("moving_mass")})
        rate, _ = other._fastest(other._values())
        other.longest_step = rates.step(rate, self._allowed_step, self.refinement)
        return other

    @property
    def path(self) -> tuple[float | str, ...]:
        """All that a plant's motion follows from besides the drive: effects and values, without those of sensors."""
        return self._acting.motion.path(self._parameters)

    @property
    def held_path(self) -> tuple[float | str, ...]:
        """All that the pressures of a `held` plant follow from besides its record: effects and values.

        Forces move nothing there, and what sensors read comes after.
        """
        return self._acting.held.path(self._parameters)

    @property
    def inner_path(self) -> tuple[float | str, ...]:
        """What the memory of inner states hangs on beside what is seen and the drive: their effects and the values."""
        return self._acting.memory.path(self._parameters)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Keys of the states, in the order of their array."""
        return self.layout.state_names

    def with_parameters(self, values: dict[str, float]) -> Plant:
        """This plant with other parameter values (SI); nothing is compiled. For fits: bounds are not checked.

        The integrator's step stays as it is, so that a small change of a value changes results smoothly, unless
        the physics becomes more than twice too fast for it (or a little, where the step is long already).

        :raises ModelError: an unknown key.
        """
        if not values:
            return self
        other = copy.copy(self)
        other._parameters = self._parameters.copy()
        for key, value in values.items():
            try:
                other._parameters[self.layout.parameters[key]] = value
            except KeyError:
                self.model.parameter(key)
                raise
        now = other._values()
        fastest, clear = other._fastest(now)
        other.longest_step = self._followed(fastest, self.longest_step)
        other._clear_step = self._followed(clear, self._clear_step)
        other._shortest_dt = rates.shortest_sampling(self._acting.effects, now)
        return other

    def _followed(self, rate: float, longest: float) -> float:
        """The ``longest`` step [s], or a shorter one for physics that has become too fast for it."""
        step = rates.step(rate, longest, self.refinement)
        return step if step < min(0.5 * self.refinement, 0.75) * longest else longest

    def clear_of_stops(self) -> Plant:
        """This plant for a piston that stays clear of its end stops: without them, where they ask for shorter steps.

        On a small piston they are the stiffest of all.
        """
        if self._clear_step <= self.longest_step:
            return self
        other = copy.copy(self)
        other._on = self._on.copy()
        other._acting = self._compiled.acting(tuple(e.name for e in self._acting.but_stops))
        other._on[self.layout.effects[STOPS]] = 0
        other.longest_step = self._clear_step
        return other

    def value(self, key: str) -> float:
        """The value in use of a parameter [SI]."""
        return float(self._parameters[self.layout.parameters[key]])

    @property
    def closes_a_loop(self) -> bool:
        """Whether a controller inside the actuator follows a commanded position: then the drive is that command."""
        return self._acting.closes_a_loop

    @property
    def mass(self) -> float:
        """All that moves with the piston [kg]: moving_mass and what effects put on."""
        total = self.value("moving_mass")
        for e in self._acting.effects:
            if e.slot == "inertia":
                total += e.kernel(*(self.value(f"{e.name}.{name}") for name in arguments(e.kernel)))
        return total

    @property
    def bristle_length(self) -> float:
        """The sliding distance over which dry friction turns [m], as effects leave it."""
        return rates.bristles(self._acting.effects, self._values())["bristle_length"]

    def initial_state(
        self,
        position: float = 0.0,
        velocity: float = 0.0,
        pressure_a: float | None = None,
        pressure_b: float | None = None,
        drive: float = 0.0,
    ) -> PlantState:
        """A state to start from; pressures left out are those of rest.

        At rest without a load the force on the piston vanishes, p_A·A_A = p_B·A_B; both are half the supply for
        equal areas (a critical-centre valve, Merritt 1967, ch. 5).
        """
        x = np.zeros(len(self.layout.states))
        command = max(-1.0, min(1.0, drive / self.value("drive_limit")))
        for key, record in self.layout.state_records.items():
            start = record.initial
            if start == "command":
                start = command
            elif isinstance(start, str):
                start = self.value(start)
            x[self.layout.states[key]] = start
        area_a, area_b = self.value("piston_area_a"), self.value("piston_area_b")
        supply, tank = self.value("supply_pressure"), self.value("tank_pressure")
        ratio = area_a / area_b
        rest_a = (supply + tank * ratio**2) / (1.0 + ratio**3) if self._hydraulic else 0.0
        rest_b = rest_a * ratio if self._hydraulic else 0.0
        if abs(ratio - 1.0) < 1e-12 and self._hydraulic:
            rest_a = rest_b = 0.5 * (supply + tank)
        x[0], x[1] = position, velocity
        x[2] = rest_a if pressure_a is None else pressure_a
        x[3] = rest_b if pressure_b is None else pressure_b
        return PlantState(x, np.zeros(self.layout.n_memory))

    def simulate(self, drive: ArrayLike, dt: float, initial: PlantState | None = None) -> Trajectory:
        """Run the plant over ``drive`` (N,) [V], held over each sample of ``dt`` [s].

        :raises SimulationError: a state stops being finite or the step cannot follow (time, state and last drive
            named).
        """
        u = np.require(drive, np.float64, ("C", "W"))  # records are read-only, which compiled code does not take
        if u.ndim != 1 or not np.all(np.isfinite(u)):
            raise SimulationError("the drive must be a one-dimensional array of finite volts")
        begin = initial or self.initial_state(drive=float(u[0]) if len(u) else 0.0)
        self.check_state(begin)
        x, memory = begin.states.copy(), begin.memory.copy()
        out = np.empty((len(u), len(base.OUTPUTS)))
        self.advance(u, dt, begin.time, x, memory, out)
        columns = {name: out[:, i] for i, name in enumerate(base.OUTPUTS)}
        limit = self.value("drive_limit")
        force = columns["pressure_a"] * self.value("piston_area_a") - columns["pressure_b"] * self.value(
            "piston_area_b"
        )
        return Trajectory(
            time=begin.time + dt * np.arange(len(u), dtype=np.float64),
            drive=np.clip(u, -limit, limit),
            force=force,
            final=PlantState(x, memory, begin.time + dt * len(u)),
            **columns,
        )

    def predict(
        self,
        drive: ArrayLike,
        dt: float,
        starts: ArrayLike,
        horizon: int,
        initial_states: ArrayLike,
        memories: Array | None = None,
        turning: ArrayLike | None = None,
        shown: tuple[Array, float] | None = None,
    ) -> dict[str, Array]:
        """What `predict_channels` says of all outputs, by their names: (S, horizon + 1), column 0 being the start."""
        runs = self.predict_channels(base.OUTPUTS, drive, dt, starts, horizon, initial_states, memories, turning, shown)
        return {name: runs[:, :, i] for i, name in enumerate(base.OUTPUTS)}

    def predict_channels(
        self,
        channels: Sequence[str],
        drive: ArrayLike,
        dt: float,
        starts: ArrayLike,
        horizon: int,
        initial_states: ArrayLike,
        memories: Array | None = None,
        turning: ArrayLike | None = None,
        shown: tuple[Array, float] | None = None,
    ) -> Array:
        """Many short runs over one drive, each from a state of its own: what is seen of C ``channels``.

        ``starts`` (S,) sample indices into ``drive`` (N,); ``horizon`` samples ahead, ``starts + horizon`` < N;
        ``initial_states`` (S, n_states). Returns (S, horizon + 1, C) of the outputs named, sample 0 being the start.
        Effects on the command remember the drive before each start, or begin with ``memories`` (S, n_memory) as
        `track` gives them. Where ``turning`` (S,) is an acceleration [m/s²], dry friction begins with what that asks
        for, as far as it can; NaN: with the state ``stick``. ``shown``: what the position's sensor showed at the starts
        (S,) [m], and its noise over the usual acceleration [s²]; its memory then begins with that.

        :raises SimulationError: as `simulate` does.
        """
        u = np.require(drive, np.float64, ("C", "W"))  # records are read-only, which compiled code does not take
        first = np.require(starts, np.int64, ("C", "W"))
        states = np.require(initial_states, np.float64, ("C", "W"))
        if len(first) and (first.min() < 0 or first.max() + horizon >= len(u)):
            raise SimulationError(
                f"starts {first.min()}…{first.max()} and a horizon of {horizon} leave the {len(u)} samples"
            )
        if states.shape != (len(first), len(self.layout.states)):
            raise SimulationError(
                f"initial_states has the shape {states.shape}; expected {(len(first), len(self.layout.states))}"
            )
        self._check_dt(dt)
        wanted = np.array([base.OUTPUTS.index(name) for name in channels], dtype=np.int64)
        out = np.empty((len(first), horizon + 1, len(wanted)))
        failure = np.zeros(2)
        past = LONGEST_MEMORY if self._acting.remembers and memories is None else 0
        if memories is None:
            memories = np.zeros((len(first), self.layout.n_memory))
        if shown is not None and self.begins_shown:
            memories = self._with_shown(memories, *shown)
        asked = np.full(len(first), np.nan) if turning is None else np.require(turning, np.float64, ("C", "W"))
        done = self._compiled.run_many(
            u, dt, self.longest_step, self._turn, first, horizon + 1, past, states, memories, asked,
            self._on, self._parameters, self._hydraulic, wanted, out, failure,
        )  # fmt: skip
        if done < len(first):
            start = int(first[done])
            into = min(max(int((failure[0] - start * dt) / dt + 1e-6), 0), horizon)
            seen = _named(channels, out[done, into])
            raise self._failed(failure, start + into, u, seen, f"the run from sample {start} failed")
        # One sum over all of it is four times as fast as a look at each reading, and as sure.
        if not np.isfinite(out.sum()):
            read = out[:, :, wanted < _READINGS]
            for i, k in np.argwhere(~np.isfinite(read).all(axis=2)):
                raise SimulationError(
                    f"{self.model.name!r}: a sensor reads nothing finite at sample {first[i] + k}: {read[i, k]}"
                )
        return out

    def _with_shown(self, memories: Array, reading: Array, hidden: float) -> Array:
        """Memories (S, n_memory) in which those of the position's sensor begin with what it showed (S,)."""
        having = [e for e in self._acting.effects if e.begins_shown]
        last = max(having, key=lambda e: e.order)  # what it gives is what is shown
        start = self.layout.memories[last.name].start
        memories = memories.copy()
        memories[:, start], memories[:, start + 1], memories[:, start + 2] = -1.0, reading, hidden
        return memories

    @property
    def begins_shown(self) -> bool:
        """Whether the memory of a position sensor may begin with what the sensor showed."""
        return self._acting.begins_shown

    @property
    def has_inner_states(self) -> bool:
        """Whether an effect that is on has states of its own, which no sensor sees, or never forgets a drive."""
        return self._acting.has_inner_states

    @property
    def lasting_memories(self) -> list[int]:
        """Places in the array of memories of those that may keep what is longer past than `LONGEST_MEMORY` samples."""
        return self._acting.lasting_memories

    def driven(self) -> Plant:
        """This plant without all that its `drive_path` has nothing to do with: `track` is faster there."""
        other, inner = copy.copy(self), self._acting.inner
        other._on = np.zeros_like(self._on)
        for e in inner:
            other._on[self.layout.effects[e.name]] = 1
        other._hydraulic = np.uint8(0)
        rate = rates.fastest(inner, self._values(), "mechanical")
        other.longest_step = max(self.longest_step, rates.step(rate, self._allowed_step, self.refinement))
        return other

    @property
    def drive_path(self) -> tuple[float | str, ...] | None:
        """All that inner states follow from besides the drive: effects and values; None where the motion matters too.

        Plants of one library with the same path propagate a record to the same inner states.
        """
        return self.inner_path if self._acting.follows_the_drive_alone else None

    def track(
        self, drive: ArrayLike, dt: float, starts: ArrayLike, seen: ArrayLike, run_up: int | None = None
    ) -> tuple[Array, Array]:
        """States at each start, those that no sensor sees propagated along the record, the others as measured.

        ``drive`` (N,) [V]; ``starts`` (S,) rising sample indices; ``seen`` (N, 4): position, velocity, pressures of
        A and B as measured, NaN where they were not; ``run_up``: samples before a start that do, by default all;
        before them effects on the command see `LONGEST_MEMORY` samples of the drive, or all where they never forget and
        follow nothing else. Returns the states (S, n_states) and memories (S, n_memory); those of the position's sensor
        begin anew, as what was measured has passed it.

        :raises SimulationError: a state stops being finite.
        """
        u = np.require(drive, np.float64, ("C", "W"))
        first = np.require(starts, np.int64, ("C", "W"))
        measured = np.require(seen, np.float64, ("C", "W"))
        if measured.shape != (len(u), 4):
            raise SimulationError(f"what was measured has the shape {measured.shape}; expected {(len(u), 4)}")
        if len(first) and (first[0] < 0 or first[-1] >= len(u) or np.any(np.diff(first) < 0)):
            raise SimulationError(f"the starts must rise within 0…{len(u) - 1}")
        self._check_dt(dt)
        begin = self.initial_state(drive=float(u[0]), **self._balanced(measured[0]))
        x, memory, failure = begin.states.copy(), begin.memory.copy(), np.zeros(2)
        states, memories = np.empty((len(first), x.size)), np.empty((len(first), memory.size))
        past = len(u) if self.lasting_memories and self.drive_path is not None else LONGEST_MEMORY
        run_up = len(u) if run_up is None else run_up
        out, done = np.empty((1, len(base.OUTPUTS))), 0
        for i, until in enumerate(first.tolist()):
            begins = done + max(until - run_up - done, 0) // CORRECTED_EVERY * CORRECTED_EVERY
            if begins > done:
                before = max(begins - past, done)
                self._compiled.prime(u[before:begins], dt, before * dt, self._on, self._parameters, x, memory)
            reached = begins + self._compiled.run(
                u[begins:until], dt, begins * dt, measured[begins:until], CORRECTED_EVERY, self.longest_step,
                self._turn, self._on, self._parameters, self._hydraulic, x, memory, out, failure,
            )  # fmt: skip
            if reached < until:
                state = _named(self.layout.states, x)
                raise SimulationError(f"propagation along the record failed at sample {reached}; state: {state}")
            x[:4] = np.where(np.isnan(measured[until]), x[:4], measured[until])
            states[i], memories[i], done = x, memory, until
        for name, place in self.layout.memories.items():
            if self.layout.library[name].slot.endswith("_sensor"):
                memories[:, place] = 0.0
        return states, memories

    def _balanced(self, seen: Array) -> dict[str, float]:
        """Pressures of rest beside the one that was ``seen`` (4,), within supply and tank [Pa]."""
        a, b = float(seen[2]), float(seen[3])
        if not self._hydraulic or math.isfinite(a) == math.isfinite(b):
            return {}
        ratio = self.value("piston_area_a") / self.value("piston_area_b")
        low, high = self.value("tank_pressure"), self.value("supply_pressure")
        name, other = ("pressure_b", a * ratio) if math.isfinite(a) else ("pressure_a", b / ratio)
        return {name: min(max(other, low), high)}

    def check_state(self, state: PlantState) -> None:
        """Refuse a state of another library: compiled code trusts the lengths.

        :raises SimulationError: the state is one.
        """
        found, expected = (
            (state.states.shape, state.memory.shape),
            ((len(self.layout.states),), (self.layout.n_memory,)),
        )
        if found != expected:
            raise SimulationError(
                f"a state of the shapes {found} does not fit {self.model.name!r}; its states and memory have {expected}"
            )

    def _check_dt(self, dt: float) -> None:
        if not (math.isfinite(dt) and dt > 0.0):
            raise SimulationError(f"the sampling interval is {dt} s; it must be positive")
        if dt < self._shortest_dt:
            raise SimulationError(
                f"the sampling interval is {dt:g} s; the memory of a delay needs at least {self._shortest_dt:g} s"
            )

    @property
    def _turn(self) -> float:
        """How much of the rate of the oil through the lands one step may cover."""
        return rates.STEP_TIMES_LANDS * min(self.refinement, 1.0)

    def advance(self, u: Array, dt: float, start: float, x: Array, memory: Array, out: Array) -> None:
        """Move the state ``x`` and ``memory`` on in place over ``u`` (N,) [V] from the time ``start`` [s].

        ``out`` (N, n_outputs) takes the outputs.

        :raises SimulationError: as `simulate` does.
        """
        self._check_dt(dt)
        failure = np.zeros(2)
        done = self._compiled.run(
            u, dt, start, out, 0, self.longest_step, self._turn, self._on, self._parameters, self._hydraulic, x, memory,
            out, failure,
        )  # fmt: skip
        if done < len(u):
            seen, where = _named(base.OUTPUTS, out[done]), _named(self.layout.states, x)
            raise self._failed(failure, done, u, seen, f"state reached: {where}")

    def embedded(self) -> Embedded:
        """What compiled code of others needs to run this plant; the arrays are its own and not to be written to."""
        return Embedded(
            self._compiled.run, self.longest_step, self._turn, self._on, self._parameters, self._hydraulic,
            len(base.OUTPUTS),
        )  # fmt: skip

    def _failed(self, failure: Array, sample: int, u: Array, outputs: str, more: str) -> SimulationError:
        why = (
            "a state is no longer finite"
            if failure[1] == 0.0
            else f"the physics is too stiff: more than {failure[1]:.0f} substeps in one sample"
        )
        return SimulationError(
            f"{why} at t = {failure[0]:.6g} s (sample {sample}); drive {u[sample]:.6g} V, "
            f"before it {u[max(sample - 1, 0)]:.6g} V; at the sample: {outputs}; {more}"
        )

    def derivative(self, state: Array, drive: float, time: float = 0.0) -> tuple[Array, dict[str, float]]:
        """d(state)/dt (n_states,) for a drive [V] without the command's effects of memory, and inner signals.

        The signals: spool, opening, pressure_supply, pressure_tank, flow_a, flow_b, flow_supply [m³/s], force
        (besides the pressures) and drive_force [N], direction, pressure_rate [1/s].
        """
        n = self.layout.n_rates
        total = len(self.layout.states)
        slope, rate, goal, seen = np.zeros(total), np.zeros(total - n), np.zeros(total - n), np.zeros(11)
        x = np.require(state, np.float64, ("C", "W"))
        self.check_state(PlantState(x, np.zeros(self.layout.n_memory)))
        command = max(-1.0, min(1.0, drive / self.value("drive_limit")))
        self._compiled.rhs(time, x, command, self._on, self._parameters, self._hydraulic, slope, rate, goal, seen)
        slope[n:] = rate * (goal - x[n:])
        names = ("spool", "pressure_supply", "opening", "pressure_rate", "flow_a", "flow_b", "force", "drive_force",
                 "flow_supply", "direction", "pressure_tank")  # fmt: skip
        return slope, dict(zip(names, seen.tolist(), strict=True))

    def step_error(self, drive: ArrayLike, dt: float, initial: PlantState | None = None) -> dict[str, float]:
        """How far the step is from following the physics: the largest change of each output when it is halved.

        Relative to the output's range over the record, or to a millionth of its usual size where it hardly changes.
        Above about 1e-3 the step is too long for this model.
        """
        coarse = self.simulate(drive, dt, initial)
        other = self._halved(dt).simulate(drive, dt, initial)
        return {
            s.name: float(
                np.max(np.abs(coarse[s.name] - other[s.name])) / max(float(np.ptp(other[s.name])), 1e-6 * s.scale)
            )
            for s in base.STATES
            if s.name in base.OUTPUTS
        }

    def following(
        self, drive: ArrayLike, dt: float, initial: PlantState | None = None, tolerance: float = FOLLOWED
    ) -> Plant:
        """This plant, its step halved until halving it once more changes no output by more than ``tolerance``.

        :raises SimulationError: `MOST_HALVINGS` do not suffice: the physics is too stiff for it, or chaotic (a piston
            bouncing on its stop).
        """
        plant = self
        for _ in range(MOST_HALVINGS):
            error = plant.step_error(drive, dt, initial)
            worst = max(error, key=lambda name: error[name])
            if error[worst] <= tolerance:
                return plant
            plant = plant._halved(dt)
        raise SimulationError(
            f"{self.model.name}: no step down to {plant.longest_step:.1e} s follows the physics; halving it still "
            f"changes {worst} by {error[worst]:.1e} of its range (allowed: {tolerance:g})"
        )

    def _halved(self, dt: float) -> Plant:
        """This plant with every step half as long."""
        other = copy.copy(self)
        other.longest_step = 0.5 * min(self.longest_step, dt)
        other.refinement = 0.5 * self.refinement
        return other


def _named(names: Iterable[str], values: Array) -> str:
    return ", ".join(f"{name}={value:.6g}" for name, value in zip(names, values, strict=True))
