"""The linearised plant against the closed forms, the paper's numbers and the nonlinear plant itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.linear import closed_form, linearise, operating_point, velocity_gain
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

PRESETS = ("moog_mcr_m_1002_bench", "moog_mcr_m_1002_paper")


def test_natural_frequency_is_the_papers_formula_with_its_printed_values():
    area, beta, mass = 12.5 * 0.0254**2, 22e4 * 6894.757293168, 500.0
    volume = area * 60 * 0.0254 + 2 * 3.048e-4
    for name in PRESETS:
        assert closed_form(load_model(name)).natural_frequency == pytest.approx(
            area * math.sqrt(4 * beta / (volume * mass)), rel=1e-9
        )


@pytest.mark.parametrize("name", PRESETS)
def test_poles_and_velocity_gain_meet_the_closed_form(name):
    model = load_model(name)
    form, system = closed_form(model), linearise(model)
    poles = system.poles()
    resonant = poles[np.argmin(np.abs(np.abs(poles) - form.natural_frequency))]
    assert abs(resonant) == pytest.approx(form.natural_frequency, rel=1e-4)
    assert -resonant.real / abs(resonant) == pytest.approx(form.damping, rel=0.02)
    slow = 1.0  # rad/s: far below the resonance the piston moves at K_v times the drive
    assert abs(system(1j * slow)[0][0]) * slow == pytest.approx(form.velocity_gain, rel=0.01)


def test_it_predicts_a_small_motion_of_the_nonlinear_plant():
    model = load_model("moog_mcr_m_1002_bench").without_effect("coulomb_friction")
    plant, point = Plant(model), operating_point(model, drive=2.0)
    assert point.velocity == pytest.approx(2.0 * closed_form(model).velocity_gain, rel=0.01)
    start = plant.initial_state(0.0, point.velocity, point.pressure_a, point.pressure_b, 2.0)
    step = 0.02
    moved = (
        plant.simulate(np.full(200, 2.0 + step), 1e-3, start).velocity
        - plant.simulate(np.full(200, 2.0), 1e-3, start).velocity
    )
    system = linearise(model, drive=2.0)
    from scipy.linalg import expm

    n = system.nstates
    both = expm(np.block([[system.A, system.B], [np.zeros((1, n + 1))]]) * 1e-3)
    state, expected = np.zeros(n), []
    for _ in range(200):
        expected.append(state[system.state_labels.index("velocity")])
        state = both[:n, :n] @ state + both[:n, n] * step
    assert np.max(np.abs(moved - expected)) < 0.03 * np.max(np.abs(expected))


def test_unequal_areas_have_no_closed_form():
    model = load_model("moog_mcr_m_1002_bench").with_values({"piston_area_b": 5e-3})
    with pytest.raises(SimulationError, match="equal piston areas"):
        closed_form(model)


@pytest.mark.parametrize("area", [8.0645e-3, 5e-3, 1.2e-2])
def test_velocity_gain_is_the_speed_of_a_piston_of_any_areas(area):
    model = load_model("moog_mcr_m_1002_bench").with_values({"piston_area_b": area, "valve_leakage": 0.0})
    for effect in ("internal_leakage", "viscous_friction"):
        model = model.without_effect(effect) if effect in model.effects else model
    speeds = [abs(operating_point(model, drive=drive).velocity) for drive in (2.0, -2.0)]
    assert velocity_gain(model) == pytest.approx(np.mean(speeds) / 2.0, rel=2e-3)


def test_velocity_gain_of_an_axis_without_oil_is_that_of_its_drag(tmp_path):
    known = {"moving_mass": "100 kg", "stroke": "1 m", "drive_limit": "10 V", "drive_force": "50 N/V"}
    numbers = ", ".join(f"{name}: {{value: {value}}}" for name, value in known.items())
    file = tmp_path / "axis.yaml"
    file.write_text(f"format: hydraulic-model-1\nname: axis\nplant: mechanical\nparameters: {{{numbers}}}\n")
    axis = load_model(file)
    with pytest.raises(SimulationError, match="without viscous friction"):
        velocity_gain(axis)
    assert velocity_gain(axis.with_effect("viscous_friction", {"coefficient": 200.0})) == pytest.approx(0.25)
