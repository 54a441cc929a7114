"""What must hold for every effect of the library alike, and for one that is added tomorrow."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hydraulic_sim import base, slots
from hydraulic_sim.effect import Effect, arguments
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.registry import library
from hydraulic_sim.trajectory import Trajectory

Array = np.ndarray

# Those of mechanical plants alone have tests of their own (test_servo_effects.py).
EFFECTS = [e for e in library().values() if "hydraulic" in e.kinds and e.searched]
SWITCHED = [e for e in EFFECTS if not e.always_on]
SEEN = ("position", "velocity", "pressure_a", "pressure_b", "pressure_supply", "spool", "opening")
DT = 1e-3


def ids(effects: list[Effect]) -> list[str]:
    return [e.name for e in effects]


def same(one: Trajectory, other: Trajectory) -> bool:
    return all(np.array_equal(one[c], other[c]) for c in (*SEEN, "true_position", "true_pressure_a", "true_pressure_b"))


def sweep(seconds: float, low: float, high: float, volts: float) -> Array:
    t = np.arange(round(seconds / DT)) * DT
    return volts * np.sin(2.0 * np.pi * (low + 0.5 * (high - low) * t / seconds) * t)


def steps(seconds: float, *volts: float) -> Array:
    return np.repeat(volts, round(seconds / DT / len(volts)))


def triangle(seconds: float, volts: float, periods: float) -> Array:
    phase = np.arange(round(seconds / DT)) * DT / seconds * periods
    return volts * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * phase))


# --- the null value contributes exactly nothing ---------------------------------------------------------------


DRIVES = {"sweep": sweep(0.3, 1.0, 40.0, 8.0), "steps": steps(0.3, 0.0, 5.0, -10.0), "slow": triangle(0.4, 0.4, 2.0)}


@pytest.mark.parametrize("effect", SWITCHED, ids=ids(SWITCHED))
def test_the_null_value_contributes_exactly_nothing(effect: Effect, bare: Model, everything: Model) -> None:
    values = {p.name: p.default if p.null is None else p.null for p in effect.parameters}
    for background in (bare, everything.without_effect(effect.name)):
        without, null = Plant(background), Plant(background.with_effect(effect.name, values))
        for name, drive in DRIVES.items():
            start = without.initial_state(position=-0.1, velocity=0.02)
            assert same(null.simulate(drive, DT, start), without.simulate(drive, DT, start)), name


# --- finite and continuous ------------------------------------------------------------------------------------


def everything_seen(plant: Plant, x: Array, drive: float) -> Array:
    slope, inner = plant.derivative(x, drive, time=0.3)
    return np.concatenate([slope, list(inner.values())])


@pytest.mark.parametrize("effect", EFFECTS, ids=ids(EFFECTS))
def test_the_right_hand_side_is_finite_everywhere(
    effect: Effect, with_effect: Callable[[Effect], Model], everything: Model, random_states: Callable[..., Any]
) -> None:
    for plant in (Plant(with_effect(effect)), Plant(everything)):
        for x, drive in random_states(plant, seed=1, count=150):
            assert np.all(np.isfinite(everything_seen(plant, x, drive))), (x, drive)


def largest_jump(function: Callable[[float], float], halvings: int = 46) -> float:
    """What ``function`` (of 0…1) still changes across ever smaller intervals around its sharpest bend, over its range.

    Followed is the half with the larger second difference: that of a jump stays, that of a bend shrinks with the
    interval and that of a smooth stretch with its square. Of a continuous function nothing is left in the end.
    """
    at = [function(s) for s in (0.0, 0.5, 1.0)]
    low, width, size = 0.0, 1.0, max(map(abs, at)) + 1e-300
    for _ in range(halvings):
        left, right = function(low + 0.25 * width), function(low + 0.75 * width)
        size = max(size, abs(left), abs(right))
        width *= 0.5
        if abs(at[0] - 2.0 * left + at[1]) >= abs(at[1] - 2.0 * right + at[2]):
            at = [at[0], left, at[1]]
        else:
            low, at = low + width, [at[1], right, at[2]]
    return abs(at[2] - at[0]) / size


def test_the_search_for_jumps_finds_one_and_only_one() -> None:
    assert largest_jump(lambda s: 1.0 if s > 0.3217 else 0.0) == 1.0
    assert largest_jump(lambda s: 1e6 * s + (2e6 * (s - 0.7) + 1.0 if s > 0.7 else 0.0)) > 1e-7
    assert largest_jump(lambda s: np.tanh((s - 0.3) * 1e4) + abs(s - 0.6)) < 1e-9


IN_THE_RIGHT_HAND_SIDE = [e for e in EFFECTS if not slots.SLOTS[e.slot].per_sample]


@pytest.mark.parametrize("effect", IN_THE_RIGHT_HAND_SIDE, ids=ids(IN_THE_RIGHT_HAND_SIDE))
def test_the_right_hand_side_is_continuous(effect: Effect, bare: Model, random_states: Callable[..., Any]) -> None:
    """Along straight lines between states far apart: what the effect returns, its own states, and the motion."""
    plant = Plant(with_partner(effect, bare))
    seen = [*plant.state_names, *plant.derivative(plant.initial_state().states, 0.0)[1]]
    own = {f"{effect.name}.{state.name}" for state in effect.states}
    wanted = {*slots.SLOTS[effect.slot].returns, *own, "velocity", "pressure_a", "pressure_b", "direction"}
    draws = list(random_states(plant, seed=2, count=50))
    for (x0, u0), (x1, u1) in zip(draws[::2], draws[1::2], strict=True):
        for place in (i for i, name in enumerate(seen) if name in wanted):

            def between(
                s: float, x0: Array = x0, x1: Array = x1, u0: float = u0, u1: float = u1, i: int = place
            ) -> float:
                return float(everything_seen(plant, x0 + s * (x1 - x0), u0 + s * (u1 - u0))[i])

            assert largest_jump(between) < 1e-8, (seen[place], x0, x1, u0, u1)


ON_THE_COMMAND = [e for e in EFFECTS if e.slot == "command"]


@pytest.mark.parametrize("effect", ON_THE_COMMAND, ids=ids(ON_THE_COMMAND))
def test_effects_on_the_command_are_continuous_in_it(effect: Effect) -> None:
    values = {p.name: p.default for p in effect.parameters} | {"dt": DT, "interval": DT, "into": 0.0}

    def after(command: float) -> float:
        memory = np.zeros(effect.memory)
        for u in (0.2, 0.35, command):
            given = values | {"command": u, "memory": memory}
            last = effect.kernel(*(given[a] for a in arguments(effect.kernel)))
        return float(last)

    assert largest_jump(lambda s: after(2.0 * s - 1.0)) < 1e-6


# --- passive effects never create energy ----------------------------------------------------------------------


SYMMETRIC_PARTNER = {"viscous_asymmetry": "viscous_friction", "friction_asymmetry": "coulomb_friction"}
FORCES = [e for e in EFFECTS if slots.SLOTS[e.slot].subsystem == "force"]
FLOWS = [e for e in EFFECTS if e.slot == "flow"]
VALVES = [e for e in EFFECTS if e.slot in ("spool", "opening", "lands", "supply", "tank")]


def with_partner(effect: Effect, model: Model) -> Model:
    """The effect on, together with the symmetric one that it modulates; the dry kind at three times its level."""
    partner = SYMMETRIC_PARTNER.get(effect.name, "coulomb_friction" if effect.slot == "bristle" else "")
    on = model.with_effect(partner) if partner else model
    return on if effect.always_on else on.with_effect(effect.name)


def force_at(plant: Plant, position: float, velocity: float) -> float:
    """The force besides the pressures while sliding steadily; at rest with everything slack for zero velocity."""
    x = plant.initial_state(position=position, velocity=velocity).states
    x[plant.layout.states["stick"]] = np.sign(velocity)
    return plant.derivative(x, 0.0)[1]["force"]


@pytest.mark.parametrize("effect", FORCES, ids=ids(FORCES))
def test_forces_only_take_power_beyond_what_they_hold_at_rest(effect: Effect, bare: Model) -> None:
    plant = Plant(with_partner(effect, bare))
    generator = np.random.default_rng(3)
    half = 0.5 * plant.value("stroke")
    for _ in range(300):
        x = generator.choice((generator.uniform(-half, half), half + 1e-5, -half - 1e-5, half - 0.01))
        v = generator.normal() * 10.0 ** generator.uniform(-5.0, 1.0)
        assert (force_at(plant, x, v) - force_at(plant, x, 0.0)) * v <= 0.0, (x, v)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("effect", FORCES, ids=ids(FORCES))
def test_no_force_gives_back_more_than_was_put_in(effect: Effect, bare: Model, seed: int) -> None:
    """A free mass pushed about at random: its energy never exceeds the work done on it.

    The work is exact, Σ F_k·(x_{k+1} − x_k) of a force that is held; what a force holds at rest counts as potential.
    """
    plant = Plant(with_partner(effect, mechanical(bare)), longest_step=1e-4)
    generator = np.random.default_rng(seed)
    n = 2500
    hold = int(generator.choice((1, 20, 300)))
    drive = np.repeat(generator.normal(0.0, 6.0, n // hold + 1), hold)[:n]
    run = plant.simulate(drive, DT)
    x, v = run.true_position, run.velocity
    work = np.concatenate([[0.0], np.cumsum(run.drive[:-1] * plant.value("drive_force") * np.diff(x))])
    half = 0.5 * plant.value("stroke")
    grid = np.unique(np.concatenate([x, [0.0], np.clip([-half, half], np.min(x), np.max(x))]))
    at_rest = np.array([force_at(plant, g, 0.0) for g in grid])
    potential = -np.concatenate([[0.0], np.cumsum(np.diff(grid) * 0.5 * (at_rest[1:] + at_rest[:-1]))])
    held = np.interp(x, grid, potential) - np.interp(0.0, grid, potential)
    energy = 0.5 * plant.value("moving_mass") * v**2 + held
    turned_over = np.sum(np.abs(run.drive[:-1] * plant.value("drive_force") * np.diff(x)))
    assert np.max(energy - work) <= 1e-9 * turned_over


def mechanical(model: Model) -> Model:
    """The same mass, pushed by a force instead of oil."""
    return replace(model, kind="mechanical").with_values({"drive_force": 300.0})


@pytest.mark.parametrize("effect", FLOWS, ids=ids(FLOWS))
def test_leakage_only_takes_power(effect: Effect, bare: Model, random_states: Callable[..., Any]) -> None:
    plant = Plant(bare.with_effect(effect.name).with_values({"valve_leakage": 0.0}))
    for x, _ in random_states(plant, seed=4, count=300):
        inner = plant.derivative(x, 0.0)[1]
        assert inner["flow_a"] * x[2] + inner["flow_b"] * x[3] <= 0.0, x


@pytest.mark.parametrize("effect", VALVES, ids=ids(VALVES))
def test_the_valve_only_takes_power(effect: Effect, bare: Model, random_states: Callable[..., Any]) -> None:
    """What flows in from the supply brings at least the power that goes to the chambers and the tank."""
    plant = Plant(bare.with_effect(effect.name))
    for x, drive in random_states(plant, seed=5, count=300):
        inner = plant.derivative(x, drive)[1]
        flow_tank = inner["flow_supply"] - inner["flow_a"] - inner["flow_b"]
        brought = inner["flow_supply"] * inner["pressure_supply"]
        taken = inner["flow_a"] * x[2] + inner["flow_b"] * x[3] + flow_tank * inner["pressure_tank"]
        assert taken <= brought + 1e-9 * (abs(brought) + abs(taken)), (x, drive)


# --- mass balance ---------------------------------------------------------------------------------------------


BALANCED = [e for e in EFFECTS if slots.SLOTS[e.slot].hydraulic or e.always_on]


def capacity(plant: Plant, run: Trajectory, side: str) -> Array:
    """C = V/β + what the effects on the compliance add [m³/Pa], from the effects' kernels called one by one."""
    values = {p.name: plant.value(p.name) for p in base.PARAMETERS}
    volumes = {
        f"volume_{s}": plant.value(f"dead_volume_{s}")
        + plant.value(f"piston_area_{s}") * (0.5 * plant.value("stroke") + (x if s == "a" else -x))
        for s, x in (("a", run.true_position), ("b", run.true_position))
    }
    total = volumes[f"volume_{side}"] / plant.value("bulk_modulus")
    for name in plant.model.effects:
        effect = library()[name]
        if effect.slot != "compliance":
            continue
        own = values | {p.name: plant.value(f"{name}.{p.name}") for p in effect.parameters}
        for k in range(len(run)):
            signals = {"pressure_a": run.true_pressure_a[k], "pressure_b": run.true_pressure_b[k]}
            signals |= {key: volume[k] for key, volume in volumes.items()}
            given = own | signals
            added = effect.kernel(*(given[a] for a in arguments(effect.kernel)))
            total[k] += added["ab".index(side)]
    return total


@pytest.mark.parametrize("effect", BALANCED, ids=ids(BALANCED))
def test_the_oil_that_flows_in_is_where_it_must_be(effect: Effect, with_effect: Callable[[Effect], Model]) -> None:
    """∫q dt = ΔV + ∫C dp along a simulated stroke, for each chamber; q as the right-hand side has it."""
    from scipy.integrate import cumulative_simpson

    plant = Plant(with_effect(effect).with_values({"valve_leakage": 0.003}))
    h, volts = 5e-5, 5.0
    run = plant.simulate(np.full(3001, volts), h, plant.initial_state(position=-0.2, drive=volts))
    states = states_of(plant, np.full(3001, volts), h, plant.initial_state(position=-0.2, drive=volts))
    flows = [plant.derivative(x, volts, t) for x, t in zip(states, run.time, strict=True)]
    for side, sign in (("a", 1.0), ("b", -1.0)):
        flow = np.array([inner[f"flow_{side}"] for _, inner in flows])
        pressure = run[f"true_pressure_{side}"]
        rate = np.array([slope["ab".index(side) + 2] for slope, _ in flows])
        swallowed = sign * plant.value(f"piston_area_{side}") * (run.true_position - run.true_position[0])
        squeezed = cumulative_simpson(capacity(plant, run, side) * rate, dx=h, initial=0.0)
        came = cumulative_simpson(flow, dx=h, initial=0.0)
        assert np.ptp(pressure) > 1e5 and np.ptp(swallowed) > 1e-6, "nothing happened"
        assert np.max(np.abs(came - swallowed - squeezed)) < 1e-6 * np.max(np.abs(came))
        # and the pressure that was integrated is the integral of that rate
        assert np.max(np.abs(cumulative_simpson(rate, dx=h, initial=0.0) - (pressure - pressure[0]))) < 1e-5 * np.ptp(
            pressure
        )


def states_of(plant: Plant, drive: Array, dt: float, start: Any) -> Array:
    """Every state at every sample (n, n_states)."""
    live = LivePlant(plant, start)
    states = []
    for u in drive:
        states.append(live.state.states)
        live.step(float(u), dt)
    return np.array(states)


# --- parameter bounds -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", EFFECTS, ids=ids(EFFECTS))
def test_parameters_within_bounds_give_motion_or_a_clear_error(effect: Effect, bare: Model) -> None:
    model = with_partner(effect, bare)
    drive = np.concatenate([np.zeros(50), steps(0.2, 4.0, -6.0), sweep(0.15, 1.0, 30.0, 3.0)])
    for parameter in effect.parameters:
        for value in (parameter.default, *parameter.bounds):
            plant = Plant(model.with_values({f"{effect.name}.{parameter.name}": value}))
            try:
                run = plant.simulate(drive, DT)
            except SimulationError as error:
                assert value != parameter.default
                assert re.search(r"at t = [\d.e-]+ s \(sample \d+\); drive", str(error))
                continue
            for channel in SEEN:
                assert np.all(np.isfinite(run[channel])), f"{channel} at {parameter.name} = {value:g}"


@pytest.mark.parametrize("effect", EFFECTS, ids=ids(EFFECTS))
def test_the_default_step_follows_every_effect(effect: Effect, bare: Model) -> None:
    """Halving the step changes no output by more than a thousandth of its range; bouncing in a gap, by three."""
    plant = Plant(with_partner(effect, bare))
    worst = max(plant.step_error(np.concatenate([np.zeros(20), steps(0.4, 4.0, -6.0, 2.0, 5.0)]), DT).values())
    assert worst < (3e-3 if effect.name == "backlash" else 1e-3)


# --- every effect shows in the experiment that is stated to excite it -----------------------------------------


def repeated(seconds: float) -> Array:
    return steps(seconds, *([3.0, -3.0] * round(seconds)))


EXPERIMENTS: dict[str, tuple[str, Array, dict[str, float], float]] = {
    # what the words in `excited_by` mean: pattern, drive [V], effects' loads that hold [N], where it starts [m]
    "chirp": (r"chirp|resonance|fast large sines", sweep(1.0, 1.0, 60.0, 4.0), {}, 0.0),
    "large steps": (r"step|large stroke|fast stroke|speeds|speed at|pressure swings", steps(1.2, 0, 8, -8, 8), {}, 0.0),
    "staircase": (r"staircase|opening held|extending and retracting", steps(1.2, 1, 3, 6, -1, -3, -6), {}, 0.0),
    "slow": (r"slow|lowest|standstill|through null|small reversals|small loops", triangle(4.0, 0.5, 2.0), {}, 0.1),
    "rest": (r"rest ", np.zeros(1500), {}, 0.3),
    "holding": (r"holding", np.zeros(2000), {"constant_load": 20e3}, 0.0),
    "ends": (r"end|stop|whole travel", steps(2.0, 9.0, -6.0), {}, 0.6),
    "reversals": (r"reversals", triangle(2.0, 3.0, 3.0), {}, 0.0),
    "repeated": (r"repeated", repeated(60.0), {}, 0.0),
}


@pytest.mark.parametrize("effect", SWITCHED, ids=ids(SWITCHED))
def test_the_stated_experiment_shows_the_effect(effect: Effect, bare: Model) -> None:
    """Some output changes by more than 1e-4 of its range in an experiment that `excited_by` names.

    That is ten times what the integrator's step leaves.
    """
    usual = bare.with_effect("viscous_friction").with_effect("coulomb_friction").with_effect("internal_leakage")
    shown: dict[str, float] = {}
    for name, (pattern, drive, loads, start) in EXPERIMENTS.items():
        if not re.search(pattern, effect.excited_by):
            continue
        model = usual
        for load, value in loads.items():
            model = model.with_effect(load, {"load": value})
        without = Plant(model.without_effect(effect.name) if effect.name in model.effects else model)
        changed = Plant(model if effect.name in model.effects else model.with_effect(effect.name))
        one = without.simulate(drive, DT, without.initial_state(position=start, drive=float(drive[0])))
        two = changed.simulate(drive, DT, changed.initial_state(position=start, drive=float(drive[0])))
        floor = {"position": 1e-5, "velocity": 1e-4, "spool": 1e-6, "opening": 1e-6}
        shown[name] = max(float(np.max(np.abs(one[c] - two[c])) / max(np.ptp(one[c]), floor.get(c, 1e4))) for c in SEEN)
    assert shown, f"no experiment is known for {effect.excited_by!r}"
    assert max(shown.values()) > 1e-4, shown
