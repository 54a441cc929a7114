"""Many simulations at once are what they are one by one; live, predicted and simulated runs are one run."""

from __future__ import annotations

import sys
import threading

import numpy as np
import pytest

from hydraulic_sim.batch import Job, scatter, simulate_batch
from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trajectory import Trajectory

Array = np.ndarray

DT = 1e-3
CHANNELS = ("position", "velocity", "pressure_a", "pressure_b", "pressure_supply", "spool", "force", "true_position")


def drive(n: int, seed: int = 0) -> Array:
    return np.repeat(np.random.default_rng(seed).uniform(-8.0, 8.0, -(-n // 10)), 10)[:n]


def same(one: Trajectory, other: Trajectory) -> bool:
    return all(np.array_equal(one[c], other[c]) for c in CHANNELS) and np.array_equal(
        one.final.states, other.final.states
    )


@pytest.mark.parametrize("workers", [None, 1, 2, 5])
def test_a_batch_is_bit_for_bit_what_one_by_one_gives(bare: Model, everything: Model, workers: int | None) -> None:
    plants = [Plant(bare), Plant(everything)] + [
        Plant(m) for m in scatter(everything, {"moving_mass": 0.1, "coulomb_friction.level": 0.3}, 6, seed=3)
    ]
    jobs = [
        Job(plant, drive(400 + 50 * i, seed=i), DT, plant.initial_state(position=0.05 * i))
        for i, plant in enumerate(plants)
    ]
    alone = [job.plant.simulate(job.drive, job.dt, job.initial) for job in jobs]
    together = simulate_batch(jobs, workers)
    assert len(together) == len(jobs)
    assert all(same(one, other) for one, other in zip(alone, together, strict=True))
    assert not same(alone[2], alone[3])


def test_an_empty_batch_is_empty() -> None:
    assert simulate_batch([]) == []


def test_a_failing_job_fails_the_batch(bare: Model) -> None:
    good = Plant(bare)
    with pytest.raises(SimulationError, match="no longer finite"):
        simulate_batch([Job(good, drive(50), DT), Job(broken(bare), drive(50), DT), Job(good, drive(50), DT)])


def broken(model: Model) -> Plant:
    return Plant(model).with_parameters({"bulk_modulus": float("nan")})


def test_simulation_releases_the_interpreter(everything: Model) -> None:
    """Python code goes on while a plant is simulated in another thread, which would never be made to give way."""
    plant, drives, counted = Plant(everything), drive(60_000), 0
    enough, done = threading.Event(), threading.Event()

    def work() -> None:
        for _ in range(100):  # nothing but the simulation gives way in here
            plant.simulate(drives, DT)
            if enough.is_set():
                break
        done.set()

    before = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    thread = threading.Thread(target=work)
    thread.start()
    try:
        while counted < 3 and not done.wait(0.001):
            counted += 1
    finally:
        enough.set()
        thread.join()
        sys.setswitchinterval(before)
    assert counted >= 3


# --- scatter --------------------------------------------------------------------------------------------------


def values(models: list[Model]) -> list[tuple[float, ...]]:
    return [tuple(m.value(key) for key in m.keys()) for m in models]  # noqa: SIM118


def test_scatter_is_the_same_for_a_seed_and_another_for_another(everything: Model) -> None:
    spread = {"moving_mass": 0.05, "internal_leakage.coefficient": 0.5}
    first = scatter(everything, spread, 20, seed=7)
    assert values(first) == values(scatter(everything, spread, 20, seed=7))
    assert values(first) != values(scatter(everything, spread, 20, seed=8))
    assert values(scatter(everything, spread, 5, seed=7)) == values(first)[:5]
    unmoved = [key for key in everything.keys() if key not in spread]  # noqa: SIM118
    assert all(m.value(key) == everything.value(key) for m in first for key in unmoved)


def test_scatter_has_the_spread_and_stays_in_bounds(bare: Model) -> None:
    models = scatter(bare.with_effect("coulomb_friction"), {"moving_mass": 0.05, "coulomb_friction.level": 2.0}, 400, 1)
    masses = np.array([m.value("moving_mass") for m in models])
    assert np.mean(masses) == pytest.approx(500.0, rel=0.01)
    assert np.std(masses) == pytest.approx(25.0, rel=0.1)
    assert np.max(np.abs(masses - 500.0)) <= 75.0 * (1 + 1e-12)
    assert min(m.value("coulomb_friction.level") for m in models) == 0.0
    with pytest.raises(ModelError, match="no parameter 'mass'"):
        scatter(bare, {"mass": 0.1}, 1, 0)
    for wrong in (-0.1, float("nan")):
        with pytest.raises(ModelError, match="moving_mass: the relative deviation"):
            scatter(bare, {"moving_mass": wrong}, 1, 0)


# --- one run, four ways ---------------------------------------------------------------------------------------


@pytest.fixture(params=["bare", "everything"])
def plant(request: pytest.FixtureRequest) -> Plant:
    return Plant(request.getfixturevalue(request.param))


def test_a_run_in_two_parts_is_the_run(plant: Plant) -> None:
    u = drive(600)
    whole, first = plant.simulate(u, DT), plant.simulate(u[:250], DT)
    second = plant.simulate(u[250:], DT, first.final)
    for channel in CHANNELS:
        joined = np.concatenate([first[channel], second[channel]])
        assert joined == pytest.approx(whole[channel], rel=1e-9, abs=1e-12), channel
    assert second.time[0] == pytest.approx(whole.time[250])


def test_a_live_plant_does_what_a_simulation_does(plant: Plant) -> None:
    u = np.append(drive(400), [25.0, -25.0])
    start = plant.initial_state(position=0.1, drive=float(u[0]))
    run, live = plant.simulate(u, DT, start), LivePlant(plant, start)
    stepped = [live.step(float(volts), DT) for volts in u]
    for channel in (*CHANNELS[:7], "drive"):
        seen = np.array([getattr(sample, channel) for sample in stepped])
        assert seen == pytest.approx(run[channel], rel=1e-9, abs=1e-12), channel
    assert live.state.states == pytest.approx(run.final.states, rel=1e-9, abs=1e-9)
    assert stepped[-2].drive == 10.0 and stepped[-1].drive == -10.0


def test_a_live_plant_leaves_the_state_it_began_from_alone(plant: Plant) -> None:
    start = plant.initial_state()
    before = start.states.copy(), start.memory.copy()
    LivePlant(plant, start).step(5.0, DT)
    plant.simulate(drive(50), DT, start)
    assert np.array_equal(start.states, before[0]) and np.array_equal(start.memory, before[1])


def test_a_prediction_is_the_simulation_from_there(bare: Model, everything: Model) -> None:
    """From the state of a simulation, with the past of the drive known; sensors with a memory begin anew."""
    per_sample = [n for n in everything.effects if everything.library[n].slot == "position_sensor"]
    for name in (*per_sample, "valve_hysteresis"):
        everything = everything.without_effect(name)
    for plant in (Plant(bare), Plant(everything)):
        u = drive(500)
        live, states = LivePlant(plant, plant.initial_state(drive=float(u[0]))), []
        run = plant.simulate(u, DT)
        for volts in u:
            states.append(live.state.states)
            live.step(float(volts), DT)
        starts = np.array([0, 17, 300, 399])
        found = plant.predict(u, DT, starts, 100, np.array([states[k] for k in starts]))
        for row, k in enumerate(starts):
            for channel in ("position", "velocity", "pressure_a", "spool"):
                assert found[channel][row] == pytest.approx(run[channel][k : k + 101], rel=1e-6, abs=1e-9), (k, channel)


def test_a_prediction_that_leaves_the_record_is_refused(bare: Model) -> None:
    plant = Plant(bare)
    x = plant.initial_state().states
    with pytest.raises(SimulationError, match=r"starts 95…95 and a horizon of 5 leave the 100 samples"):
        plant.predict(np.zeros(100), DT, [95], 5, [x])
    with pytest.raises(SimulationError, match="starts -1"):
        plant.predict(np.zeros(100), DT, [-1], 5, [x])
    with pytest.raises(SimulationError, match=r"shape \(1, 3\); expected \(1, 13\)"):
        plant.predict(np.zeros(100), DT, [0], 5, [x[:3]])


def test_other_values_without_building_anew(everything: Model) -> None:
    """`with_parameters` is the plant of the changed model, up to what the integrator's step leaves."""
    u = drive(300)
    changed = {"moving_mass": 430.0, "spool_dynamics.frequency": 300.0, "backlash.frequency": 250.0}
    one = Plant(everything).with_parameters(changed).simulate(u, DT)
    other = Plant(everything.with_values(changed)).simulate(u, DT)
    assert np.max(np.abs(one.position - other.position)) < 2e-3 * np.ptp(other.position)
    assert Plant(everything).value("moving_mass") == 500.0
    with pytest.raises(ModelError, match="no parameter 'mass'"):
        Plant(everything).with_parameters({"mass": 1.0})
    same_step = Plant(everything).with_parameters({"moving_mass": 500.0 * (1 + 1e-6)})
    assert same_step.longest_step == Plant(everything).longest_step
