"""The integrator against an implicit solver of another make, on the same right-hand side."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydraulic_sim.compiled import compiled
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.registry import library

Array = np.ndarray

DT = 1e-3
STATES = ("true_position", "velocity", "true_pressure_a", "true_pressure_b")


def chirp(n: int, high: float = 15.0) -> Array:
    t = np.arange(n) * DT
    return 6.0 * np.sin(2.0 * np.pi * (0.5 + 0.5 * (high - 0.5) * t / (n * DT)) * t)


def radau(plant: Plant, drive: Array, start: Array) -> Array:
    """States (n, n_states) at every sample by Radau IIA, begun anew at each, as the drive jumps there."""
    scales = np.array([record.scale for record in plant.layout.state_records.values()])
    x, states = start.copy(), [start.copy()]
    for k, volts in enumerate(drive[:-1]):

        def rate(t: float, z: Array, volts: float = float(volts)) -> Array:
            return plant.derivative(z * scales, volts, t)[0] / scales

        done = solve_ivp(rate, (k * DT, (k + 1) * DT), x / scales, method="Radau", rtol=1e-9, atol=1e-10)
        assert done.success
        x = done.y[:, -1] * scales
        states.append(x)
    return np.array(states)


def error(plant: Plant, n: int, **start: float) -> float:
    """The largest deviation of any state over a chirp, relative to the state's range."""
    drive = chirp(n)
    begin = plant.initial_state(**start)
    run, reference = plant.simulate(drive, DT, begin), radau(plant, drive, begin.states)
    return max(
        float(np.max(np.abs(run[name] - reference[:, i])) / np.ptp(reference[:, i])) for i, name in enumerate(STATES)
    )


def test_the_base_plant_agrees_to_one_in_a_hundred_thousand(bare: Model) -> None:
    assert error(Plant(bare), 300) < 1e-5


CASES = {
    "states that relax, a law for supply and tank": (("supply_droop", "return_back_pressure"), 1e-5),
    "states with rates": (("spool_dynamics", "structural_flexibility"), 5e-5),
    "dry friction through standstill": (("coulomb_friction", "stribeck_friction", "presliding"), 1e-5),
    "dry friction with the shortest bristles": (("coulomb_friction",), 2e-5),
    "kinks of the valve, soft oil, a cushion": (
        ("valve_deadband", "valve_underlap", "valve_gain_asymmetry", "entrained_air", "end_cushion"), 5e-5),
    "time itself": (("pump_ripple", "viscosity_drift", "viscous_friction"), 1e-5),
    "bouncing in a gap": (("backlash",), 3e-4),
}  # fmt: skip


@pytest.mark.parametrize(("effects", "tolerance"), CASES.values(), ids=list(CASES))
def test_effects_agree_to_the_stated_tolerance(bare: Model, effects: tuple[str, ...], tolerance: float) -> None:
    model = bare
    for name in effects:
        model = model.with_effect(name)
    assert error(Plant(model), 120, position=0.7 if "end_cushion" in effects else 0.0) < tolerance


def test_the_error_falls_with_the_fourth_power_of_the_step(bare: Model) -> None:
    """On a smooth stretch: a drive that is held, away from the stops and from zero drops over the lands."""
    drive = np.full(40, 4.0)
    start = Plant(bare).initial_state(velocity=0.1, drive=4.0)
    finest = Plant(bare, longest_step=1e-3 / 64).simulate(drive, 2e-3, start)

    def deviation(step: float) -> float:
        return float(np.max(np.abs(Plant(bare, longest_step=step).simulate(drive, 2e-3, start).velocity
                                   - finest.velocity)))  # fmt: skip

    assert deviation(5e-4) / deviation(2.5e-4) == pytest.approx(16.0, rel=0.35)


def test_what_relaxes_does_so_exponentially_within_a_step_and_to_the_end_beyond() -> None:
    relax = compiled(library()).module.relax
    z = np.concatenate((np.linspace(0.0, 0.5, 51), np.geomspace(0.6, 1e6, 200)))
    left = np.array([relax(1.0, rate, 0.0, 1.0) for rate in z])
    assert np.abs(left - np.exp(-z))[z <= 0.3].max() < 1e-7, "a step of 0.3 of its time"
    assert np.abs(left - np.exp(-z)).max() < 0.0025
    assert np.all(left > 0.0) and np.all(np.diff(left) < 0.0) and left[-1] < 1e-12
    assert relax(2.0, 0.0, 5.0, 1.0) == 2.0
    growing = np.array([relax(1.0, -rate, 0.0, 1.0) for rate in z[:51]])
    assert np.all(growing >= 1.0), "a fit may try a time below 0"
