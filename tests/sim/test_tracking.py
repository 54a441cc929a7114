"""What no sensor sees is led along a record, so that runs may begin anywhere in it."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

DT, SECONDS, AHEAD = 1e-3, 12.0, 400
SEEN = ("position", "velocity", "pressure_a", "pressure_b")


@pytest.fixture(scope="module")
def bench() -> Model:
    return load_model("sample_bench")


def slowly(plant: Plant) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """A slow sine of the drive, what the plant does, and starts all over it."""
    drive = 0.4 * np.sin(2.0 * np.pi * 0.1 * DT * np.arange(round(SECONDS / DT)))
    run = plant.simulate(drive, DT, plant.initial_state())
    return drive, {c: np.asarray(getattr(run, c)) for c in SEEN}, np.arange(500, len(drive) - AHEAD - 1, 500)


@pytest.mark.parametrize("effect", ["valve_hysteresis", "spool_dynamics", "spool_rate_limit"])
def test_runs_from_within_a_record_go_on_as_the_whole_did(bench: Model, effect: str) -> None:
    plant = Plant(bench.with_effect(effect))
    assert plant.has_inner_states
    drive, seen, starts = slowly(plant)
    states, memories = plant.track(drive, DT, starts, np.stack([seen[c] for c in SEEN], axis=-1))
    again = plant.predict(drive, DT, starts, AHEAD, states, memories)
    whole = np.stack([seen["position"][s : s + AHEAD + 1] for s in starts])
    moved = np.ptp(whole, axis=1).max()
    assert np.abs(again["position"] - whole).max() < 0.01 * moved


@pytest.mark.parametrize(
    ("effect", "values", "left"),
    [
        ("sensor_lag", {"time": 9e-3}, 1e-9),
        ("sensor_backlash", {"half_gap": 5e-4}, 1e-9),
        ("sensor_delay", {"delay": 6.4e-3}, 0.75),  # the way between is taken to be a parabola
    ],
)
def test_a_sensor_goes_on_from_what_it_showed(bench: Model, effect: str, values: dict[str, float], left: float) -> None:
    """A wild drive, so that in the middle of it nothing has always moved like now; ``left``: of the error without."""
    plant = Plant(bench.without_effect("coulomb_friction").with_effect(effect, values))  # which has a state of its own
    drive = np.repeat(np.random.default_rng(5).uniform(-6.0, 6.0, 60), 25)
    run = plant.simulate(drive, DT)
    starts = np.arange(40, len(drive) - 101, 100)
    true = plant.with_parameters({f"{effect}.{name}": 0.0 for name in values}).simulate(drive, DT)
    assert np.allclose(true.true_position, run.true_position, atol=1e-12)
    states = np.tile(plant.initial_state().states, (len(starts), 1))
    for k, column in enumerate((true.true_position, true.velocity, true.true_pressure_a, true.true_pressure_b)):
        states[:, k] = column[starts]
    whole = np.stack([run.position[s : s + 101] for s in starts])
    errors = [
        np.abs(plant.predict(drive, DT, starts, 100, states, shown=shown)["position"] - whole).max()
        for shown in (None, (run.position[starts], 1e-12))
    ]
    assert errors[0] > 1e-5
    assert errors[1] < max(left * errors[0], 1e-12)


def test_a_sensor_with_nothing_to_remember_does_not_mind_what_it_showed(bench: Model) -> None:
    drive = np.full(50, 1.0)
    states = np.tile(Plant(bench).initial_state(velocity=0.1).states, (1, 1))
    for name, parameter in (("sensor_lag", "time"), ("sensor_backlash", "half_gap"), ("sensor_delay", "delay")):
        plant = Plant(bench.with_effect(name, {parameter: 0.0}))
        shown = (np.array([0.3]), 1e-6)
        assert np.array_equal(
            plant.predict(drive, DT, [0], 40, states, shown=shown)["position"],
            plant.predict(drive, DT, [0], 40, states)["position"],
        )


def test_what_forgets_soon_needs_no_leading(bench: Model) -> None:
    assert not Plant(bench).has_inner_states
    assert not Plant(bench.with_effect("command_delay")).has_inner_states
    assert not Plant(bench.with_effect("sensor_backlash")).has_inner_states


@pytest.mark.parametrize("effect", ["spool_dynamics", "spool_rate_limit", "valve_hysteresis"])
def test_states_that_follow_from_the_drive_alone_are_those_of_any_plant_with_the_same_valve(
    bench: Model, effect: str
) -> None:
    one = Plant(bench.with_effect(effect))
    other = one.with_parameters({"moving_mass": 1.1 * one.value("moving_mass")})
    assert one.drive_path is not None and other.drive_path == one.drive_path
    drive, seen, starts = slowly(one)
    smoothed = np.stack([seen[c] for c in SEEN], axis=-1)
    inner = [k for k, name in enumerate(one.state_names) if name not in (*SEEN, "stick")]
    (mine, memories), (others, other_memories) = (p.track(drive, DT, starts, smoothed) for p in (one, other))
    assert inner and np.array_equal(mine[:, inner], others[:, inner]) and np.array_equal(memories, other_memories)
    alone, alone_memories = one.driven().track(drive, DT, starts, smoothed)
    assert np.allclose(alone[:, inner], mine[:, inner], rtol=0.0, atol=1e-6)
    assert np.array_equal(alone_memories, memories)
    parameter = next(p.name for p in bench.library[effect].parameters)
    moved = one.with_parameters({f"{effect}.{parameter}": 1.1 * one.value(f"{effect}.{parameter}")})
    assert moved.drive_path != one.drive_path


@pytest.mark.parametrize("effect", ["spool_dynamics", "supply_droop", "return_back_pressure", "valve_hysteresis"])
def test_a_run_up_does_where_nothing_remembers_longer(bench: Model, effect: str) -> None:
    """Standing still from a half-stroke on, a valve's play is where the whole way before has left it."""
    plant = Plant(bench.with_effect(effect, {"half_width": 0.01} if effect == "valve_hysteresis" else None))
    drive, seen, starts = slowly(plant)
    drive = np.where(np.arange(len(drive)) < len(drive) // 2, drive, 0.0)
    starts, smoothed = starts[[0, -1]], np.stack([seen[c] for c in SEEN], axis=-1)
    (whole, kept), (part, begun) = (plant.track(drive, DT, starts, smoothed, n) for n in (None, 1500))
    inner = [k for k, name in enumerate(plant.state_names) if name not in (*SEEN, "stick")]
    assert np.all(np.abs(part - whole)[:, inner] <= 1e-5 * np.ptp(whole, axis=0)[inner])
    assert bool(plant.lasting_memories) == (effect == "valve_hysteresis")
    assert np.array_equal(begun[:, plant.lasting_memories], kept[:, plant.lasting_memories])


@pytest.mark.parametrize("effect", ["supply_droop", "structural_flexibility"])
def test_states_that_the_motion_moves_too_have_no_path_of_the_drive(bench: Model, effect: str) -> None:
    plant = Plant(bench.with_effect(effect))
    assert plant.has_inner_states and plant.drive_path is None


def test_a_pressure_without_a_sensor_follows_from_motion_and_valve_whatever_the_forces(bench: Model) -> None:
    real = Plant(bench.with_effect("constant_load", {"load": 20e3}).with_values({"coulomb_friction.level": 3e3}))
    drive, seen, starts = slowly(real)
    moving = starts[starts > 1000]
    smoothed = np.stack([seen[c] for c in SEEN], axis=-1)
    smoothed[:, SEEN.index("pressure_b")] = np.nan
    plant = Plant.for_fits(bench)
    off = {
        name: p.track(drive, DT, moving, smoothed)[0][:, 3] - seen["pressure_b"][moving]
        for name, p in (("held", plant.held()), ("free", plant))
    }
    assert np.abs(off["held"]).max() < 0.01 * bench.value("supply_pressure")
    assert np.abs(off["held"]).max() < 0.2 * np.abs(off["free"]).max()


def test_a_stop_far_stiffer_than_the_oil_asks_for_no_short_steps_in_fits(bench: Model) -> None:
    light = bench.without_effect("coulomb_friction").with_entry("moving_mass", value=1.0, bounds=(0.5, 2.0))
    light = light.with_values({"piston_area_a": 2e-4, "piston_area_b": 2e-4, "viscous_friction.coefficient": 100.0})
    fit, exact = Plant.for_fits(light), Plant(light)
    assert fit.longest_step > 3.0 * exact.longest_step
    assert fit.value("end_stop.stiffness") < light.value("end_stop.stiffness") == exact.value("end_stop.stiffness")
    assert Plant.for_fits(bench).value("end_stop.stiffness") == bench.value("end_stop.stiffness")
    free = light.with_entry("end_stop.stiffness", free=True)
    assert Plant.for_fits(free).value("end_stop.stiffness") == light.value("end_stop.stiffness")
    # Driven against it, the piston goes no deeper than a position sensor sees.
    drive, start = np.full(100, 8.0), fit.initial_state(position=0.755)
    soft, hard = (p.simulate(drive, 1e-3, start).position[-1] for p in (fit, exact))
    assert 0.0 < hard - 0.762 < soft - 0.762 < 1e-5 * light.value("stroke")


def test_a_light_piston_clear_of_its_stops_takes_longer_steps_the_same_way(bench: Model) -> None:
    light = bench.without_effect("coulomb_friction").with_entry("moving_mass", value=1.0, bounds=(0.5, 2.0))
    light = light.with_values({
        "piston_area_a": 2e-4, "piston_area_b": 2e-4, "viscous_friction.coefficient": 300.0, "valve_flow": 1e-4,
        "stroke": 0.2, "dead_volume_a": 2e-5, "dead_volume_b": 2e-5,
    })  # fmt: skip
    stopped = Plant.for_fits(light)
    clear = stopped.clear_of_stops()
    assert clear.longest_step > 2.0 * stopped.longest_step
    assert Plant.for_fits(bench).clear_of_stops().longest_step == Plant.for_fits(bench).longest_step
    nudged = stopped.with_parameters({"moving_mass": 1.01})
    assert nudged.clear_of_stops().longest_step == clear.longest_step, "small changes must not change the step"
    lighter = stopped.with_parameters({"moving_mass": 0.01})
    assert lighter.clear_of_stops().longest_step < clear.longest_step, "what becomes far faster must"
    drive, start = 2.0 * np.sin(2.0 * np.pi * 2.0 * 1e-3 * np.arange(1000)), stopped.initial_state()
    runs = [p.simulate(drive, 1e-3, start) for p in (stopped, clear)]
    assert np.abs(runs[0].position).max() < 0.08
    for name in ("position", "pressure_a"):
        assert runs[1][name] == pytest.approx(runs[0][name], abs=1e-3 * float(np.ptp(runs[0][name]))), name
    ahead = {p: p.simulate(np.full(400, 8.0), 1e-3, start).position[-1] for p in (stopped, clear)}
    assert ahead[stopped] < 0.1001 < ahead[clear], "without stops it goes on"


def test_a_held_plant_goes_the_same_path_whatever_its_forces(bench: Model) -> None:
    one = Plant.for_fits(bench)
    drive, seen, starts = slowly(Plant(bench))
    smoothed = np.stack([seen[c] for c in SEEN], axis=-1)
    smoothed[:, SEEN.index("pressure_a")] = np.nan

    def pressures(plant: Plant) -> np.ndarray:
        return plant.held().track(drive, DT, starts, smoothed)[0][:, 2]

    for key in ("moving_mass", "coulomb_friction.level", "viscous_friction.coefficient", "bristle_length"):
        other = one.with_parameters({key: 1.3 * one.value(key)})
        assert other.held_path == one.held_path, key
        assert np.allclose(pressures(other), pressures(one), rtol=1e-6), key
    for key in ("valve_flow", "bulk_modulus", "internal_leakage.coefficient", "supply_pressure"):
        other = one.with_parameters({key: 1.3 * one.value(key)})
        assert other.held_path != one.held_path, key
        assert not np.allclose(pressures(other), pressures(one), rtol=1e-6), key
    assert Plant.for_fits(bench.with_effect("valve_deadband")).held_path != one.held_path


@pytest.mark.parametrize("damping", [0.2, 1.0, 2.0])
def test_a_spool_is_propagated_however_it_is_damped(bench: Model, damping: float) -> None:
    valve = {"frequency": 250.0, "damping": damping}
    plant = Plant.for_fits(bench.with_effect("spool_dynamics", valve))
    drive, seen, starts = slowly(plant)
    smoothed = np.stack([seen[c] for c in SEEN], axis=-1)
    (coarse, _), (fine, _) = (p.track(drive, DT, starts, smoothed) for p in (plant.driven(), Plant(plant.model)))
    lift = plant.state_names.index("spool_dynamics.lift")
    assert np.allclose(coarse[:, lift], fine[:, lift], rtol=0.0, atol=5e-3)
