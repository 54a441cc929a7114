"""A simulation that leaves the numbers, or that its step does not follow, says so."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trajectory import PlantState

DT = 1e-3
NUMBER = r"-?[\d.]+(?:e[+-]?\d+)?"


def test_a_state_that_is_not_finite_stops_the_run_and_is_shown(bare: Model) -> None:
    plant = Plant(bare)
    start = plant.initial_state()
    start.states[plant.layout.states["velocity"]] = np.nan
    with pytest.raises(SimulationError) as caught:
        plant.simulate(np.full(10, 3.0), DT, start)
    text = str(caught.value)
    assert re.search(rf"no longer finite at t = {NUMBER} s \(sample 0\); drive 3 V, before it 3 V", text)
    assert "velocity=nan" in text and "pressure_a=" in text


def test_the_last_good_sample_is_told_of_a_run_that_bursts(bare: Model) -> None:
    """A spring that pushes: the piston leaves the bench ever faster, until the numbers end."""
    plant = Plant(bare.with_effect("load_spring")).with_parameters(
        {"load_spring.stiffness": -1e9, "end_stop.stiffness": 1e3, "bulk_modulus": 1e7}
    )
    with pytest.raises(SimulationError, match=r"no longer finite at t = .*drive 2 V, before it 2 V; at the sample: "
                                              r"position=-?\d") as caught:  # fmt: skip
        plant.simulate(np.full(5000, 2.0), DT, plant.initial_state(position=0.01))
    where = int(re.search(r"sample (\d+)", str(caught.value))[1])  # type: ignore[index]
    assert where > 5
    good = plant.simulate(np.full(where, 2.0), DT, plant.initial_state(position=0.01))
    assert np.all(np.isfinite(good.position))


@pytest.mark.parametrize("volts", [np.nan, np.inf, -np.inf])
def test_a_drive_that_is_no_number_moves_nothing(bare: Model, volts: float) -> None:
    plant = Plant(bare)
    drive = np.zeros(20)
    drive[10] = volts
    with pytest.raises(SimulationError, match="finite volts"):
        plant.simulate(drive, DT)
    live = LivePlant(plant)
    if np.isnan(volts):
        with pytest.raises(SimulationError, match=r"drive nan V"):
            live.step(volts, DT)
        with pytest.raises(SimulationError, match="run from sample 5 failed"):
            plant.predict(drive, DT, [5], 10, [plant.initial_state().states])
    else:
        assert live.step(volts, DT).drive == np.sign(volts) * 10.0


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, np.inf])
def test_a_sampling_interval_must_be_positive(bare: Model, dt: float) -> None:
    with pytest.raises(SimulationError, match="sampling interval is .* must be positive"):
        Plant(bare).simulate(np.zeros(3), dt)
    with pytest.raises(SimulationError, match="must be positive"):
        Plant(bare).predict(np.zeros(3), dt, [0], 1, [Plant(bare).initial_state().states])
    with pytest.raises(SimulationError, match="one-dimensional"):
        Plant(bare).simulate(np.zeros((3, 2)), DT)


def test_a_state_of_another_length_is_refused(bare: Model) -> None:
    plant = Plant(bare)
    good = plant.initial_state()
    for wrong in (PlantState(good.states[:4], good.memory), PlantState(good.states, good.memory[:-1])):
        for call in (lambda w: plant.simulate(np.zeros(3), DT, w), lambda w: LivePlant(plant, w)):
            with pytest.raises(SimulationError, match="does not fit 'sample_bench'"):
                call(wrong)
    with pytest.raises(SimulationError, match="does not fit"):
        plant.derivative(good.states[:4], 0.0)


# --- stiffness ------------------------------------------------------------------------------------------------


def forced(model: Model) -> Plant:
    """A plant with a step ten times as long as it takes of its own accord."""
    plant = Plant(model)
    plant.longest_step = 5e-3
    return plant


def steps() -> np.ndarray:
    return np.repeat([0.0, 4.0, -6.0, 2.0], 100)


def test_physics_beyond_any_step_is_called_too_stiff(bare: Model) -> None:
    plant = Plant(bare.with_effect("viscous_friction", {"coefficient": 1e6}).with_values({"moving_mass": 1e-3}))
    with pytest.raises(SimulationError, match=r"too stiff: more than \d+ substeps in one sample at t = .*drive"):
        plant.simulate(steps(), DT)


def test_a_long_sample_is_not_taken_for_stiffness(bare: Model) -> None:
    run = Plant(bare).simulate([1.0, 1.0, -1.0], 2.0)
    assert np.all(np.isfinite(run.position))
    assert Plant(bare).simulate(np.full(2000, 1.0), DT).final.states[0] == pytest.approx(run.position[1], rel=1e-6)


def test_the_step_follows_the_base_plant(bare: Model) -> None:
    error = Plant(bare).step_error(steps(), DT)
    assert set(error) == {"position", "velocity", "pressure_a", "pressure_b"}
    assert max(error.values()) < 1e-4


def test_a_step_that_is_far_too_long_is_found(bare: Model) -> None:
    """The oil's resonance is at 240 rad/s, and 500 rad/s near the stops."""
    plant, drive = Plant(bare), np.full(300, -3.0)
    start = plant.initial_state(position=0.72)
    assert max(plant.step_error(drive, DT, start).values()) < 2e-3
    assert max(forced(bare).step_error(drive[::5], 5e-3, start).values()) > 0.02
    assert Plant(bare, longest_step=5e-3).longest_step < 1e-3, "a plant of its own accord takes no such step"


def test_a_step_that_the_lands_shorten_is_doubted_as_well(bare: Model) -> None:
    """Near the stop the oil flows off so fast that the step hardly depends on the longest one."""
    plant = forced(bare)
    start, drive = plant.initial_state(position=0.72), np.full(60, -3.0)
    reference = Plant(bare, longest_step=2e-6).simulate(drive, 5e-3, start)
    deviation = np.max(np.abs(plant.simulate(drive, 5e-3, start).pressure_a - reference.pressure_a))
    told = plant.step_error(drive, 5e-3, start)["pressure_a"] * np.ptp(reference.pressure_a)
    assert told == pytest.approx(deviation, rel=0.3)


def test_a_plant_at_rest_is_followed(everything: Model) -> None:
    plant = Plant(everything.without_effect("pump_ripple"))
    assert np.isfinite(max(plant.step_error(np.zeros(200), DT).values()))
    quiet = Plant(everything.with_values({"constant_load.load": 0.0}).without_effect("valve_null_bias"))
    assert quiet.following(np.zeros(100), DT, tolerance=0.5).longest_step <= quiet.longest_step


def test_following_shortens_the_step_or_says_that_none_follows(bare: Model) -> None:
    coarse = forced(bare)
    drive = np.repeat(steps()[::5], 5)
    fine = coarse.following(drive, 5e-3)
    assert fine.longest_step < 5e-3
    assert max(fine.step_error(drive, 5e-3).values()) <= 1e-3
    with pytest.raises(SimulationError, match=r"no step down to .* s follows the physics; .* changes \w+ by"):
        coarse.following(drive, 5e-3, tolerance=1e-14)


@pytest.mark.parametrize("mass", [500.0, 20.0, 1.0])
def test_a_light_piston_on_stiff_oil_is_followed(bare: Model, mass: float) -> None:
    """With soft stops nothing but the oil itself tells how short the step must be."""
    plant = Plant(bare.with_values({"moving_mass": mass, "end_stop.stiffness": 1e5}))
    run = plant.simulate(np.full(400, -2.0), DT, plant.initial_state(position=0.74))
    assert np.max(np.abs(run.velocity)) < 0.5
    assert plant.step_error(np.full(400, -2.0), DT, plant.initial_state(position=0.74))["position"] < 1e-3


@pytest.mark.parametrize(("resistance", "time"), [(2.5e9, 1e-3), (4e8, 1e-3), (7e8, 0.02)])
def test_a_fast_droop_is_followed_in_steps_that_are_not_too_short(bare: Model, resistance: float, time: float) -> None:
    """What drops below 1 bar over the lands add to its rate is a hundredth of a sensor's noise (2·10⁴ Pa) at most."""
    droop = bare.with_effect("supply_droop", {"resistance": resistance, "time": time})
    model = droop.with_values({"orifice_transition": 100.0})
    fine = Plant(model, longest_step=1e-5)
    assert fine.longest_step < 0.5 * Plant(model).longest_step < Plant.for_fits(model).longest_step
    exact = fine.simulate(steps(), DT)
    for plant, close in ((Plant(model), 40.0), (Plant.for_fits(model), 300.0)):
        assert np.sqrt(np.mean((plant.simulate(steps(), DT).pressure_a - exact.pressure_a) ** 2)) < close


def test_a_fit_that_makes_the_physics_faster_keeps_the_step_with_it(bare: Model) -> None:
    plant = Plant(bare.with_effect("spool_dynamics", {"frequency": 40.0}))
    fast = plant.with_parameters({"spool_dynamics.frequency": 990.0, "spool_dynamics.damping": 1.8})
    run = fast.simulate(steps(), DT)
    assert np.max(np.abs(run.spool)) < 1.0
    assert fast.step_error(steps(), DT)["position"] < 1e-3
