"""The plant against closed forms of the textbooks, effect by effect."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trajectory import PlantState

Array = np.ndarray

DT = 1e-3


@pytest.fixture
def free(bare: Model) -> Callable[..., Plant]:
    """`free(coulomb_friction={"level": 450.0}, …)`: a mass of 500 kg without oil, pushed by 100 N/V."""

    def build(longest_step: float = 5e-4, **effects: dict[str, float]) -> Plant:
        model = replace(bare, kind="mechanical").with_values({"drive_force": 100.0, "stroke": 50.0})
        for name, values in effects.items():
            model = model.with_effect(name, values)
        return Plant(model, longest_step=longest_step)

    return build


@pytest.fixture
def hydraulic(bare: Model) -> Callable[..., Plant]:
    """The same for the bare hydraulic bench."""

    def build(values: dict[str, float] | None = None, **effects: dict[str, float]) -> Plant:
        model = bare.with_values(values or {})
        for name, given in effects.items():
            model = model.with_effect(name, given)
        return Plant(model)

    return build


Build = Callable[..., Plant]


def jacobian(plant: Plant, state: Array, names: tuple[str, ...], drive: float = 0.0) -> Array:
    """d(rates)/d(states) of the named states by central differences."""
    places = [plant.layout.states[name] for name in names]
    scales = [plant.layout.state_records[name].scale for name in names]
    columns = []
    for place, scale in zip(places, scales, strict=True):
        up, down = state.copy(), state.copy()
        up[place] += 1e-4 * scale
        down[place] -= 1e-4 * scale
        difference = plant.derivative(up, drive)[0] - plant.derivative(down, drive)[0]
        columns.append(difference[places] / (2e-4 * scale))
    return np.array(columns).T


# --- oil and mass ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [0.0, 0.5])
def test_the_hydraulic_natural_frequency(hydraulic: Build, x: float) -> None:
    """ω = A·√(β·(1/V_A + 1/V_B)/M), in mid stroke A·√(2·β/(V·M)); Merritt (1967), ch. 6."""
    plant = hydraulic()
    area, beta, mass = (plant.value(k) for k in ("piston_area_a", "bulk_modulus", "moving_mass"))
    dead, half = plant.value("dead_volume_a"), 0.5 * plant.value("stroke")
    volumes = dead + area * (half + x), dead + area * (half - x)
    omega = area * math.sqrt(beta * (1.0 / volumes[0] + 1.0 / volumes[1]) / mass)
    if x == 0.0:
        assert omega == pytest.approx(area * math.sqrt(2.0 * beta / ((dead + area * half) * mass)))
    start = plant.initial_state(position=x)
    poles = np.linalg.eigvals(jacobian(plant, start.states, ("velocity", "pressure_a", "pressure_b")))
    assert np.max(np.abs(poles.imag)) == pytest.approx(omega, rel=1e-6)
    assert np.max(np.abs(poles.real)) < 1e-6 * omega
    # and in time: the period of the ringing after a release, and no damping of the integrator's own
    start.states[2] += 2e4
    run = plant.simulate(np.zeros(4000), 1e-4, start)
    v, t = run.velocity, run.time
    rising = np.flatnonzero((v[:-1] < 0.0) & (v[1:] >= 0.0))
    crossings = t[rising] - v[rising] * 1e-4 / (v[rising + 1] - v[rising])
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert period == pytest.approx(2.0 * math.pi / omega, rel=2e-4)
    assert np.max(v[-600:]) == pytest.approx(np.max(v[:600]), rel=2e-3)


def test_steady_speed_under_viscous_friction(hydraulic: Build) -> None:
    """A·v = Q·o·√((p_S − p_T − p_L)/(2·Δp_r)), p_L = b·v/A; Merritt (1967), ch. 5."""
    plant = hydraulic({"tank_pressure": 0.0}, viscous_friction={"coefficient": 3e4})
    area, flow, rated, supply = (
        plant.value(k) for k in ("piston_area_a", "valve_flow", "valve_drop", "supply_pressure")
    )
    opening, b = 0.5, 3e4
    k = (opening * flow / area) ** 2 / (2.0 * rated)
    expected = (-k * b / area + math.sqrt((k * b / area) ** 2 + 4.0 * k * supply)) / 2.0
    run = plant.simulate(np.full(1000, 5.0), DT, plant.initial_state(position=-0.5))
    assert run.velocity[-1] == pytest.approx(expected, rel=2e-3)
    assert run.pressure_a[-1] - run.pressure_b[-1] == pytest.approx(b * expected / area, rel=1e-2)


def test_a_constant_load_and_a_spring_are_held_by_the_load_pressure(hydraulic: Build) -> None:
    for effects, x, force in (
        ({"constant_load": {"load": 5000.0}}, 0.3, 5000.0),
        ({"load_spring": {"stiffness": 2e4}}, 0.3, -6000.0),
    ):
        plant = hydraulic(viscous_friction={"coefficient": 2e4}, **effects)
        run = plant.simulate(np.zeros(3000), DT, plant.initial_state(position=x))
        assert (run.pressure_a[-1] - run.pressure_b[-1]) * plant.value("piston_area_a") == pytest.approx(
            -force, rel=1e-2
        )
        assert run.force[-1] == pytest.approx(-force, rel=1e-2)


def test_the_end_stop_yields_by_force_over_stiffness(hydraulic: Build) -> None:
    plant = hydraulic(viscous_friction={"coefficient": 2e5})
    run = plant.simulate(np.full(3000, 10.0), DT, plant.initial_state(position=0.7))
    depth = run.true_position[-1] - 0.5 * plant.value("stroke")
    assert depth == pytest.approx(run.force[-1] / plant.value("end_stop.stiffness"), rel=1e-6)
    assert run.force[-1] == pytest.approx(13.7e6 * plant.value("piston_area_a"), rel=1e-2)


# --- leakage and fluid ----------------------------------------------------------------------------------------


def drift(plant: Plant) -> float:
    run = plant.simulate(np.zeros(2000), DT)
    return float(run.velocity[-1])


def test_internal_leakage_lets_a_load_sink(hydraulic: Build) -> None:
    """v = C·F/A² / (1 + C·b/A²): flow C·p_L past the piston, force p_L·A = F − b·v."""
    c, load, b = 5e-12, 20e3, 2e4
    plant = hydraulic(
        constant_load={"load": load}, internal_leakage={"coefficient": c}, viscous_friction={"coefficient": b}
    )
    area = plant.value("piston_area_a")
    assert drift(plant) == pytest.approx(c * load / area**2 / (1.0 + c * b / area**2), rel=1e-4)


def test_turbulent_leakage_lets_a_load_sink_with_its_root(hydraulic: Build) -> None:
    c, b, speeds = 5e-9, 2e4, []
    for load in (10e3, 40e3):
        plant = hydraulic(
            constant_load={"load": load}, turbulent_leakage={"coefficient": c}, viscous_friction={"coefficient": b}
        )
        area = plant.value("piston_area_a")
        speeds.append(drift(plant))
        assert speeds[-1] == pytest.approx(c * math.sqrt(load / area) / area, rel=1e-2)
    assert speeds[1] / speeds[0] == pytest.approx(2.0, rel=1e-2)


def test_external_leakage_empties_both_chambers_exponentially(hydraulic: Build) -> None:
    plant = hydraulic(external_leakage={"coefficient": 1e-11})
    volume = plant.value("dead_volume_a") + 0.5 * plant.value("piston_area_a") * plant.value("stroke")
    run = plant.simulate(np.zeros(1500), DT)
    expected = run.pressure_a[0] * np.exp(-1e-11 * plant.value("bulk_modulus") / volume * run.time)
    assert run.pressure_a == pytest.approx(expected, rel=1e-9)
    assert run.pressure_b == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("pressure", [2e5, 1e6, 7e6, 2e7])
@pytest.mark.parametrize(("fraction", "exponent"), [(0.01, 1.4), (0.05, 1.0)])
def test_entrained_air_softens_the_oil_as_its_volume_says(
    hydraulic: Build, pressure: float, fraction: float, exponent: float
) -> None:
    """β_e = −V/(dV/dp) of a mixture whose oil follows e^(−p/β) and whose air follows p·V^n = const."""
    leak = 1e-11
    plant = hydraulic(
        external_leakage={"coefficient": leak}, entrained_air={"fraction": fraction, "exponent": exponent}
    )
    beta, p0 = plant.value("bulk_modulus"), 101325.0

    def mixture(p: float) -> float:
        return (1.0 - fraction) * math.exp(-(p - p0) / beta) + fraction * (p0 / p) ** (1.0 / exponent)

    h = 1e-4 * pressure
    modulus = -mixture(pressure) * 2.0 * h / (mixture(pressure + h) - mixture(pressure - h))
    slope, inner = plant.derivative(plant.initial_state(pressure_a=pressure, pressure_b=pressure).states, 0.0)
    volume = plant.value("dead_volume_a") + 0.5 * plant.value("piston_area_a") * plant.value("stroke")
    assert inner["flow_a"] == pytest.approx(-leak * pressure)
    assert slope[2] * volume / inner["flow_a"] == pytest.approx(modulus, rel=1e-6)


def test_a_hose_softens_both_chambers_alike_at_any_pressure(hydraulic: Build) -> None:
    plant = hydraulic(external_leakage={"coefficient": 1e-11}, hose_compliance={"capacity": 3e-12})
    volume = plant.value("dead_volume_a") + 0.5 * plant.value("piston_area_a") * plant.value("stroke")
    for pressure in (1e5, 1e7):
        slope, inner = plant.derivative(plant.initial_state(pressure_a=pressure, pressure_b=pressure).states, 0.0)
        capacity = volume / plant.value("bulk_modulus") + 3e-12
        assert slope[2:4] == pytest.approx(np.full(2, inner["flow_a"] / capacity), rel=1e-12)


def test_viscosity_scales_friction_and_leakage_over_time(hydraulic: Build) -> None:
    plant = hydraulic(
        viscosity_drift={"change": -0.4, "time": 20.0},
        viscous_friction={"coefficient": 100.0},
        internal_leakage={"coefficient": 1e-11},
    )
    state = plant.initial_state(velocity=0.5, pressure_a=8e6, pressure_b=6e6).states
    for t in (0.0, 20.0, 1e4):
        factor = 1.0 - 0.4 * (1.0 - math.exp(-t / 20.0))
        inner = plant.derivative(state, 0.0, time=t)[1]
        assert inner["force"] == pytest.approx(-50.0 * factor)
        assert inner["flow_a"] == pytest.approx(-2e-5 / factor)


# --- valve and supply -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("frequency", "damping"), [(60.0, 0.5), (100.0, 0.3)])
def test_the_step_response_of_the_spool(hydraulic: Build, frequency: float, damping: float) -> None:
    """Overshoot e^(−π·ζ/√(1−ζ²)) at the time π/(ω·√(1−ζ²))."""
    plant = hydraulic(spool_dynamics={"frequency": frequency, "damping": damping})
    h = 1e-4
    run = plant.simulate(np.full(600, 5.0), h, plant.initial_state(drive=0.0))
    peak = int(np.argmax(run.spool))
    # the peak lies between samples: a parabola through the three highest
    below, top, above = run.spool[peak - 1 : peak + 2]
    shift = 0.5 * (below - above) / (below - 2.0 * top + above)
    root = math.sqrt(1.0 - damping**2)
    assert (top - 0.25 * (below - above) * shift) / 0.5 - 1.0 == pytest.approx(
        math.exp(-math.pi * damping / root), rel=1e-4
    )
    assert (peak + shift) * h == pytest.approx(math.pi / (2.0 * math.pi * frequency * root), rel=1e-3)


def test_a_step_of_the_spool_under_its_rate_limit_is_a_ramp(hydraulic: Build) -> None:
    plant = hydraulic(spool_rate_limit={"rate": 40.0})
    drive = np.concatenate([np.zeros(5), np.full(40, 8.0), np.full(40, -8.0)])
    spool = plant.simulate(drive, DT).spool
    ramp = np.minimum(0.04 * np.arange(0.5, 20.0), 0.8)
    assert spool[5:25] == pytest.approx(ramp)
    assert spool[40] == 0.8
    assert spool[45:80] == pytest.approx(0.8 - 0.04 * np.arange(0.5, 35.0))
    slow = plant.simulate(8.0 * np.sin(np.arange(500) * 2e-2), DT).spool
    assert np.max(np.abs(np.diff(slow))) < 0.04


OPENINGS: dict[str, tuple[dict[str, float], Callable[[float], float]]] = {
    "valve_deadband": ({"width": 0.1}, lambda s: math.copysign(max(abs(s) - 0.1, 0.0), s)),
    "valve_null_bias": ({"bias": -0.05}, lambda s: s - 0.05),
    "valve_flow_saturation": ({"limit": 0.6, "rounding": 0.0}, lambda s: min(max(s, -0.6), 0.6)),
    "valve_gain_asymmetry": ({"asymmetry": 0.2}, lambda s: s * (1.2 if s > 0.0 else 0.8)),
    "valve_gain_curve": ({"progression": 0.3}, lambda s: 0.7 * s + 0.3 * s * abs(s)),
}


@pytest.mark.parametrize("name", OPENINGS)
def test_the_opening_over_the_drive(hydraulic: Build, name: str) -> None:
    values, curve = OPENINGS[name]
    plant = hydraulic(**{name: values})
    drive = np.linspace(-12.0, 12.0, 49)
    run = plant.simulate(drive, DT)
    assert run.opening == pytest.approx([curve(min(max(u / 10.0, -1.0), 1.0)) for u in drive], abs=1e-15)


def test_a_round_corner_is_that_of_two_orifices_in_series(hydraulic: Build) -> None:
    """Two of areas s and 1 in series act as s/√(1 + s²)."""
    plant = hydraulic(valve_flow_saturation={"limit": 0.604, "rounding": 1.249})
    drive = np.linspace(-10.0, 10.0, 41)
    wide = drive / 10.0
    assert 1.267 * plant.simulate(drive, DT).opening == pytest.approx(wide / np.hypot(1.0, wide), abs=2e-3)


def test_an_underlapped_valve_passes_oil_through_its_centre(hydraulic: Build) -> None:
    """Each of four lands K·δ·√(p_S/2); the flow gain doubles within the underlap."""
    width = 0.05
    plant = hydraulic({"tank_pressure": 0.0}, valve_underlap={"width": width})
    land = plant.value("valve_flow") * math.sqrt(0.5 * plant.value("supply_pressure") / plant.value("valve_drop"))
    rest = plant.initial_state().states
    inner = plant.derivative(rest, 0.0)[1]
    assert inner["flow_supply"] == pytest.approx(2.0 * width * land, rel=1e-3)
    assert inner["flow_a"] == pytest.approx(0.0, abs=1e-12)
    small = 0.01
    assert plant.derivative(rest, small * 10.0)[1]["flow_a"] == pytest.approx(2.0 * small * land, rel=1e-3)
    assert plant.derivative(rest, 5.0)[1]["flow_a"] == pytest.approx((0.5 + width) * land, rel=1e-3)


def test_the_supply_droops_by_resistance_times_flow(hydraulic: Build) -> None:
    plant = hydraulic(supply_droop={"resistance": 2e9, "time": 0.02}, viscous_friction={"coefficient": 2e4})
    run = plant.simulate(np.full(600, 6.0), DT, plant.initial_state(position=-0.5))
    inner = plant.derivative(run.final.states, 6.0)[1]
    assert inner["flow_supply"] > 1e-3
    drop = 2e9 * inner["flow_supply"]
    assert inner["pressure_supply"] == pytest.approx(plant.value("supply_pressure") - drop, rel=1e-4)


def test_a_drooping_supply_recovers_with_its_time_constant(hydraulic: Build) -> None:
    plant = hydraulic(supply_droop={"resistance": 2e9, "time": 0.05})
    start = plant.initial_state()
    start.states[plant.layout.states["supply_droop.line_pressure"]] = 10e6
    run = plant.simulate(np.zeros(300), DT, start)
    assert run.pressure_supply == pytest.approx(14e6 - 4e6 * np.exp(-run.time / 0.05), rel=1e-12)


def test_the_return_line_rises_with_the_square_of_flow(hydraulic: Build) -> None:
    plant = hydraulic(return_back_pressure={"resistance": 2e11}, viscous_friction={"coefficient": 2e4})
    for volts in (4.0, -8.0):
        run = plant.simulate(np.full(600, volts), DT, plant.initial_state(position=-math.copysign(0.5, volts)))
        inner = plant.derivative(run.final.states, volts)[1]
        flow_tank = inner["flow_supply"] - inner["flow_a"] - inner["flow_b"]
        assert flow_tank > 5e-4
        assert inner["pressure_tank"] == pytest.approx(plant.value("tank_pressure") + 2e11 * flow_tank**2, rel=1e-3)


def test_pump_ripple_is_its_sine(hydraulic: Build) -> None:
    plant = hydraulic(pump_ripple={"amplitude": 3e5, "frequency": 120.0, "phase": 0.7})
    run = plant.simulate(np.zeros(500), DT)
    assert run.pressure_supply == pytest.approx(14e6 + 3e5 * np.sin(2.0 * math.pi * 120.0 * run.time + 0.7))


# --- dead time and play ---------------------------------------------------------------------------------------


def noise(n: int, seed: int = 1) -> Array:
    return np.random.default_rng(seed).uniform(-9.0, 9.0, n)


@pytest.mark.parametrize("samples", [1, 4, 20])
def test_a_delay_of_whole_samples_is_a_shift(hydraulic: Build, samples: int) -> None:
    drive = noise(200)
    run = hydraulic(command_delay={"delay": samples * DT}).simulate(drive, DT)
    assert run.spool[samples:] == pytest.approx(drive[:-samples] / 10.0, abs=1e-12)
    assert run.spool[:samples] == pytest.approx(np.full(samples, drive[0] / 10.0))
    read = hydraulic(sensor_delay={"delay": samples * DT}).simulate(drive, DT)
    assert read.position[samples:] == pytest.approx(read.true_position[:-samples], abs=1e-15)


@pytest.mark.parametrize("delay", [6e-3, 6.25e-3, 6.75e-3])
def test_a_delay_does_not_depend_on_the_sampling(hydraulic: Build, delay: float) -> None:
    """The same drive, held over 1 ms, sampled at 1 ms and at 0.25 ms; the delay may end within a sample."""
    model = hydraulic(command_delay={"delay": delay}, sensor_delay={"delay": 3e-3}).model
    plant, drive = Plant(model, longest_step=2.5e-4), noise(150)
    coarse, fine = plant.simulate(drive, DT), plant.simulate(np.repeat(drive, 4), DT / 4)
    assert fine.position[::4] == pytest.approx(coarse.position, abs=1e-12)
    assert fine.spool[::4] == pytest.approx(coarse.spool, abs=1e-12)
    assert coarse.spool[7:] == pytest.approx(drive[:-7] / 10.0 if delay > 6e-3 else drive[1:-6] / 10.0, abs=1e-12)


def test_what_comes_behind_a_delay_goes_on_within_a_sample(hydraulic: Build) -> None:
    """A play follows every value, a limited rate goes on for as long as each value holds."""
    behind = {"valve_hysteresis": {"half_width": 0.05}, "spool_rate_limit": {"rate": 200.0}}
    plant, drive = Plant(hydraulic(command_delay={"delay": 2.5 * DT}, **behind).model, longest_step=2.5e-4), noise(150)
    coarse, fine = plant.simulate(drive, DT), plant.simulate(np.repeat(drive, 2), DT / 2)
    assert fine.position[::2] == pytest.approx(coarse.position, abs=1e-12)


def test_memories_are_primed_over_delays_that_end_within_a_sample(hydraulic: Build) -> None:
    behind = {"valve_hysteresis": {"half_width": 0.05}}
    plant, drive = hydraulic(command_delay={"delay": 2.5 * DT}, **behind), noise(150)
    whole = plant.simulate(drive, DT)
    at = 60
    states = plant.initial_state().states
    states[:4] = [whole[name][at] for name in ("true_position", "velocity", "true_pressure_a", "true_pressure_b")]
    part = plant.predict(drive, DT, [at], 50, states[None])["position"][0]
    assert part == pytest.approx(whole.position[at : at + 51], abs=1e-9)


@pytest.mark.parametrize("effect", ["command_delay", "sensor_delay"])
def test_a_delay_longer_than_its_memory_is_refused(hydraulic: Build, effect: str) -> None:
    plant = hydraulic(**{effect: {"delay": 0.04}})
    plant.simulate(np.zeros(3), 2e-4)
    with pytest.raises(SimulationError, match=r"sampling interval is 0\.0001 s; .*delay needs at least 0\.00015"):
        plant.simulate(np.zeros(3), 1e-4)
    with pytest.raises(SimulationError, match="delay needs"):
        LivePlant(plant).step(0.0, 1e-4)
    plant.with_parameters({f"{effect}.delay": 0.02}).simulate(np.zeros(3), 1e-4)


PLAYS = {
    "valve_hysteresis": ("half_width", 0.06, lambda run: (run.drive / 10.0, run.spool)),
    "sensor_backlash": ("half_gap", 2e-3, lambda run: (run.true_position, run.position)),
}


@pytest.mark.parametrize("name", PLAYS)
def test_play_has_a_loop_of_its_width_whatever_the_rate(hydraulic: Build, name: str) -> None:
    parameter, half, look = PLAYS[name]
    plant = hydraulic(**{name: {parameter: half}})
    t = np.arange(3000) * DT
    came, left = look(plant.simulate(3.0 * np.sin(2.0 * math.pi * t), DT))
    lag = came - left
    assert np.max(np.abs(lag)) <= half * (1.0 + 1e-9)
    moving = np.flatnonzero(np.abs(np.diff(left)) > 0.0) + 1
    assert np.abs(lag[moving]) == pytest.approx(np.full(len(moving), half), rel=1e-6), "moves at the edge only"
    assert np.sign(lag[moving]) == pytest.approx(np.sign(np.diff(left)[moving - 1]))
    settled = slice(1000, None)
    assert np.ptp(left[settled]) == pytest.approx(np.ptp(came[settled]) - 2.0 * half, rel=1e-3)


def test_hysteresis_does_not_depend_on_the_rate(hydraulic: Build) -> None:
    plant = hydraulic(valve_hysteresis={"half_width": 0.05})
    path = 4.0 * np.sin(np.linspace(0.0, 20.0, 800)) * np.linspace(1.0, 0.1, 800)
    assert np.array_equal(plant.simulate(np.repeat(path, 3), DT).spool[::3], plant.simulate(path, DT).spool)


def test_a_small_loop_leaves_no_trace(hydraulic: Build) -> None:
    """Wiping out: after a loop that a larger one encloses, the large one goes on as if it had not been."""
    plant = hydraulic(valve_hysteresis={"half_width": 0.05})
    up, loop = np.linspace(0.0, 5.0, 51), np.linspace(5.0, 3.0, 21)
    straight = plant.simulate(np.concatenate([up, np.linspace(5.1, 8.0, 30)]), DT).spool
    looped = plant.simulate(np.concatenate([up, loop, loop[::-1], np.linspace(5.1, 8.0, 30)]), DT).spool
    assert looped[-30:] == pytest.approx(straight[-30:], abs=1e-15)


# --- dry friction ---------------------------------------------------------------------------------------------


def test_a_mass_on_dry_friction_slows_down_evenly_and_stays(free: Build) -> None:
    """v = v₀ − Fc/M·t, at rest after v₀²·M/(2·Fc), and no creep afterwards."""
    plant = free(coulomb_friction={"level": 450.0})
    run = plant.simulate(np.zeros(1500), DT, plant.initial_state(velocity=0.5))
    deceleration = 450.0 / 500.0
    moving = run.time < 0.5 / deceleration - 0.01
    assert run.velocity[moving] == pytest.approx(0.5 - deceleration * run.time[moving], abs=1e-4)
    assert run.true_position[-1] == pytest.approx(0.5**2 / (2.0 * deceleration), rel=2e-4)
    rest = run.time > 0.5 / deceleration + 0.1
    assert np.max(np.abs(run.velocity[rest])) < 1e-6
    assert np.ptp(run.true_position[rest]) < 1e-8


@pytest.mark.parametrize("share", [0.5, 0.9, -0.95])
def test_below_its_level_dry_friction_holds_for_good(free: Build, share: float) -> None:
    plant = free(coulomb_friction={"level": 450.0})
    drive = np.concatenate([np.linspace(0.0, 4.5 * share, 500), np.full(4500, 4.5 * share)])
    run = plant.simulate(drive, DT)
    assert abs(run.true_position[-1]) < 2.5e-5
    assert np.max(np.abs(run.velocity[-1000:])) < 1e-9


def broken_away(plant: Plant, newtons_per_second: float, seconds: float) -> float:
    """The force [N] at which a mass on a slow ramp of force leaves."""
    drive = np.arange(round(seconds / DT)) * DT * newtons_per_second / plant.value("drive_force")
    run = plant.simulate(drive, DT)
    gone = np.flatnonzero(run.true_position > 1e-3)
    assert len(gone), "it never left"
    # the last moment at which it was slower than anything that slides
    leave = np.flatnonzero(run.velocity[: gone[0]] < 1e-4)[-1]
    return float(drive[leave] * plant.value("drive_force"))


def test_break_away_force_is_that_of_stribeck(free: Build) -> None:
    coulomb = {"level": 300.0}
    assert broken_away(free(coulomb_friction=coulomb), 100.0, 6.0) == pytest.approx(300.0, rel=0.02)
    for rise in (100.0, 250.0):
        plant = free(coulomb_friction=coulomb, stribeck_friction={"rise": rise, "speed": 5e-3})
        assert broken_away(plant, 100.0, 8.0) == pytest.approx(300.0 + rise, rel=0.02)


def test_sliding_friction_follows_the_stribeck_curve(free: Build) -> None:
    plant = free(coulomb_friction={"level": 300.0}, stribeck_friction={"rise": 200.0, "speed": 0.01})
    for v in (1e-3, 5e-3, 0.02, -0.01, -0.3):
        state = plant.initial_state(velocity=v).states
        state[plant.layout.states["stick"]] = np.sign(v)
        expected = -np.sign(v) * (300.0 + 200.0 * math.exp(-((v / 0.01) ** 2)))
        assert plant.derivative(state, 0.0)[1]["force"] == pytest.approx(expected)


def test_presliding_is_dahls_spring(free: Build) -> None:
    """Loading from rest, F = Fc·(1 − e^(−x/δ)); on the way back dF/dx = Fc/δ·(1 + F/Fc), stiffer than it came."""
    delta, level = 2e-4, 400.0
    plant = free(coulomb_friction={"level": level}, presliding={"length": delta, "time": 5e-3})
    up, hold, back = np.linspace(0.0, 3.0, 6000), np.full(1000, 3.0), np.linspace(3.0, 2.6, 1000)
    run = plant.simulate(np.concatenate([up, hold, back]), DT)
    force = run.drive * plant.value("drive_force")
    loading = slice(1000, 6000)
    assert run.true_position[loading] == pytest.approx(-delta * np.log(1.0 - force[loading] / level), rel=1e-2)
    returned = run.true_position[6999] - run.true_position[-1]
    assert returned == pytest.approx(delta * math.log((level + 300.0) / (level + 260.0)), rel=0.01)


def test_friction_asymmetry_moves_the_levels_apart_and_vanishes_at_rest(free: Build) -> None:
    plant = free(coulomb_friction={"level": 400.0}, friction_asymmetry={"difference": 100.0})
    run = plant.simulate(np.zeros(400), DT, plant.initial_state(velocity=1.0))
    back = plant.simulate(np.zeros(400), DT, plant.initial_state(velocity=-1.0))
    assert -np.polyfit(run.time[5:], run.velocity[5:], 1)[0] * 500.0 == pytest.approx(500.0, rel=1e-3)
    assert np.polyfit(back.time[5:], back.velocity[5:], 1)[0] * 500.0 == pytest.approx(300.0, rel=1e-3)
    assert plant.derivative(plant.initial_state().states, 0.0)[1]["force"] == 0.0


def test_position_dependent_friction_grows_with_the_square_of_position(free: Build) -> None:
    plant = free(coulomb_friction={"level": 100.0}, position_dependent_friction={"growth": 800.0})
    for x in (0.0, 0.5, -1.0):
        state = plant.initial_state(position=x, velocity=0.1).states
        state[plant.layout.states["stick"]] = 1.0
        assert plant.derivative(state, 0.0)[1]["force"] == pytest.approx(-(100.0 + 800.0 * x * x))


# --- other forces ---------------------------------------------------------------------------------------------


def test_terminal_speed_and_time_constant_of_viscous_friction(free: Build) -> None:
    plant = free(viscous_friction={"coefficient": 2000.0})
    run = plant.simulate(np.full(1000, 5.0), DT)
    assert run.velocity == pytest.approx(0.25 * (1.0 - np.exp(-run.time * 4.0)), abs=1e-10)
    skewed = free(viscous_friction={"coefficient": 2000.0}, viscous_asymmetry={"difference": 500.0})
    assert skewed.simulate(np.full(5000, 5.0), DT).velocity[-1] == pytest.approx(500.0 / 2500.0, rel=1e-6)
    assert skewed.simulate(np.full(5000, -5.0), DT).velocity[-1] == pytest.approx(-500.0 / 1500.0, rel=1e-5)


def test_a_mass_on_a_spring_swings_for_ever(free: Build) -> None:
    plant = free(load_spring={"stiffness": 2e4})
    run = plant.simulate(np.zeros(3000), DT, plant.initial_state(position=0.1))
    omega = math.sqrt(2e4 / 500.0)
    assert run.true_position == pytest.approx(0.1 * np.cos(omega * run.time), abs=1e-10)


def test_two_masses_on_a_spring_swing_faster_than_either(free: Build) -> None:
    """ω·√(1 + m/M) of a free pair, ζ·√(1 + m/M); nothing but the spring holds them."""
    plant = free(structural_flexibility={"mass": 125.0, "frequency": 20.0, "damping": 0.04})
    names = ("velocity", "structural_flexibility.deflection", "structural_flexibility.deflection_rate")
    poles = np.linalg.eigvals(jacobian(plant, plant.initial_state().states, names))
    swinging = poles[np.abs(poles.imag) > 1.0][0]
    assert abs(swinging) == pytest.approx(2.0 * math.pi * 20.0 * math.sqrt(1.25), rel=1e-6)
    assert -swinging.real / abs(swinging) == pytest.approx(0.04 * math.sqrt(1.25), rel=1e-6)


def test_momentum_is_kept_by_a_second_mass_and_across_a_gap(free: Build) -> None:
    for effect, values in (
        ("structural_flexibility", {"mass": 200.0, "frequency": 10.0, "damping": 0.1}),
        ("backlash", {"mass": 200.0, "gap": 0.01, "frequency": 40.0, "damping": 0.2}),
    ):
        plant = free(**{effect: values})
        states = plant.layout.states
        rate = next(i for name, i in states.items() if name.startswith(effect) and name.endswith("_rate"))
        start = plant.initial_state(velocity=0.4)
        start.states[rate] = -0.4  # the second mass rests at first
        live = LivePlant(plant, start)
        for _ in range(3000):
            live.step(0.0, DT)
            x = live.state.states
            assert 500.0 * x[1] + 200.0 * (x[1] + x[rate]) == pytest.approx(500.0 * 0.4, rel=1e-9)
        assert x[1] == pytest.approx(0.4 * 500.0 / 700.0, rel=0.15), "they travel together in the end"


def test_nothing_is_felt_of_the_load_within_the_gap(free: Build) -> None:
    plant = free(backlash={"mass": 200.0, "gap": 0.02})
    start = plant.initial_state(velocity=0.1)
    start.states[plant.layout.states["backlash.lead_rate"]] = -0.1
    run = plant.simulate(np.zeros(400), DT, start)
    touch = 0.01 / 0.1
    assert run.velocity[run.time < touch - 2e-3] == pytest.approx(0.1, abs=1e-15)
    assert np.min(run.velocity[run.time > touch + 5e-3]) < 0.099


def test_a_cushion_takes_speed_by_the_square_and_only_inwards(free: Build) -> None:
    """M·dv/dx = −c·v·r², r = depth/length: v = v₀·exp(−c·d³/(3·l²·M))."""
    plant = free(end_cushion={"coefficient": 2e4, "length": 0.2})
    start = plant.initial_state(position=24.8, velocity=1.0)
    run = plant.simulate(np.zeros(250), DT, start)
    inside = run.true_position < 25.0
    depth = run.true_position[inside] - 24.8
    assert run.velocity[inside] == pytest.approx(np.exp(-2e4 * depth**3 / (3.0 * 0.2**2 * 500.0)), rel=1e-6)
    assert depth[-1] > 0.15
    leaving = plant.simulate(np.zeros(100), DT, plant.initial_state(position=24.95, velocity=-1.0))
    assert np.array_equal(leaving.velocity, np.full(100, -1.0))


def test_a_cushion_longer_than_half_the_stroke_begins_in_the_middle(free: Build) -> None:
    plant = Plant(free(end_cushion={"length": 1.0}).model.with_values({"stroke": 0.5}))
    near, far = plant.initial_state(velocity=1.0).states, plant.initial_state(position=0.25, velocity=1.0).states
    assert plant.derivative(near, 0.0)[1]["force"] == 0.0
    assert plant.derivative(far, 0.0)[1]["force"] == pytest.approx(-2e5 * 0.25**2)


# --- sensors --------------------------------------------------------------------------------------------------


def coast(plant: Plant, v: float = 0.2, n: int = 300) -> Any:
    """A free mass at constant speed, from 0.1 m on."""
    start: PlantState = plant.initial_state(position=0.1, velocity=v)
    return plant.simulate(np.zeros(n), DT, start)


@pytest.mark.parametrize("tau", [2e-4, 5e-3, 0.05])
def test_a_lagging_sensor_trails_a_ramp_by_slope_times_lag(free: Build, tau: float) -> None:
    run = coast(free(sensor_lag={"time": tau}))  # which begins as if it had always moved like this
    assert run.position == pytest.approx(run.true_position - 0.2 * tau, abs=1e-13)


@pytest.mark.parametrize("tau", [2e-4, 5e-3, 0.05])
def test_a_lagging_sensor_closes_in_exponentially_on_a_stop(free: Build, tau: float) -> None:
    plant = free(sensor_lag={"time": tau})
    kernel = plant.model.library["sensor_lag"].kernel
    memory = np.zeros(3)
    kernel(0.0, memory, DT, 0.0, tau)
    risen = np.array([kernel(1e-3 * min(k, 1), memory, DT, 0.0, tau) for k in range(1, 40)])
    ramp = 1e-3 - 1e-3 * tau / DT * (1.0 - np.exp(-DT / tau))  # one sample of ramp, then standing still
    assert risen == pytest.approx(1e-3 - (1e-3 - ramp) * np.exp(-DT * np.arange(39) / tau), abs=1e-15)


@pytest.mark.parametrize("effect", [{"sensor_delay": {"delay": 7e-3}}, {"sensor_backlash": {"half_gap": 1e-3}}])
def test_a_sensor_begins_as_if_it_had_always_moved_like_this(free: Build, effect: Any) -> None:
    behind = 0.2 * 7e-3 if "sensor_delay" in effect else 1e-3
    run = coast(free(**effect))
    assert run.position == pytest.approx(run.true_position - behind, abs=1e-13)


def test_static_sensor_errors(free: Build) -> None:
    x = coast(free()).position
    assert coast(free(sensor_offset={"offset": 0.01})).position == pytest.approx(x + 0.01)
    assert coast(free(sensor_scale={"scale": 1.05})).position == pytest.approx(1.05 * x)
    assert coast(free(sensor_nonlinearity={"cubic": 0.5})).position == pytest.approx(x + 0.5 * x**3)
    assert coast(free()).true_position == pytest.approx(0.1 + 0.2 * np.arange(300) * DT)


@pytest.mark.parametrize("step", [1e-5, 7.3e-4])
def test_quantisation_rounds_to_the_nearest_step(free: Build, step: float) -> None:
    for v in (0.02, -0.9):
        run = coast(free(sensor_quantisation={"step": step}), v)
        counts = run.position / step
        assert counts == pytest.approx(np.round(counts), abs=1e-6)
        assert np.max(np.abs(run.position - run.true_position)) <= 0.5 * step * (1.0 + 1e-9)


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.5, 0.9])
def test_a_noisy_reading_in_steps_is_the_mean_of_many(free: Build, noise: float) -> None:
    step = 1e-3
    run = coast(free(sensor_quantisation={"step": step, "noise": noise * step}), 0.02)
    added = np.random.default_rng(1).normal(scale=noise * step, size=(20000, 1))
    mean = (step * np.round((run.true_position[:25] + added) / step)).mean(axis=0)
    assert np.abs(run.position[:25] - mean).max() < 5.0 * step * (0.5 + noise) / math.sqrt(20000)


def test_pressure_offsets_are_read_but_not_felt(hydraulic: Build) -> None:
    drive = noise(200)
    plain = hydraulic().simulate(drive, DT)
    read = hydraulic(pressure_offset={"offset_a": 1e5, "offset_b": -2e5}).simulate(drive, DT)
    assert np.array_equal(read.true_pressure_a, plain.pressure_a) and np.array_equal(read.position, plain.position)
    assert read.pressure_a == pytest.approx(plain.pressure_a + 1e5)
    assert read.pressure_b == pytest.approx(plain.pressure_b - 2e5)
    assert read.force == pytest.approx(plain.force + 3e5 * 8.0645e-3)
