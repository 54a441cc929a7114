"""The independent plant against closed forms, another solver, and measured-like example records."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hidden_effects import experiments, laws, parameters, plant

ROOT = Path(__file__).resolve().parents[2]
P = parameters.PLAIN
VOLUME = P["dead_volume"] + P["area"] * P["stroke"] / 2
STIFFNESS = 2 * P["bulk_modulus"] * P["area"] ** 2 / VOLUME  # of the oil with the valve shut, N/m
SHUT = {"leakage": 0.0, "viscous": 0.0}
FREE = SHUT | {"coulomb": 1e-3}  # bristles too soft to slide
MIDDLE = 7.15e6


def still(seconds: float) -> np.ndarray:
    return np.zeros(int(seconds * experiments.RATE))


def test_shut_in_oil_swings_at_its_resonance_and_keeps_its_energy():
    _, seen = plant.run(FREE, still(4.0), centring=0.0, start=(0.0, 0.0, MIDDLE + 1e6, MIDDLE - 1e6))
    amplitude = 2e6 * P["area"] / STIFFNESS
    x = seen["position"] - amplitude  # rest is where the pressures are equal again
    crossings = np.flatnonzero(np.diff(np.sign(x)) > 0) + 1.0
    fraction = x[crossings.astype(int) - 1] / (x[crossings.astype(int) - 1] - x[crossings.astype(int)])
    period = np.diff(crossings + fraction).mean() / experiments.RATE
    assert period == pytest.approx(2 * math.pi * math.sqrt(P["mass"] / STIFFNESS), rel=2e-4)
    speed = seen["velocity"]
    assert abs(speed[-500:]).max() / abs(speed[:500]).max() == pytest.approx(1.0, abs=3e-4)


def test_shut_in_oil_conserves_mass():
    _, seen = plant.run(FREE, still(1.0), centring=0.0, start=(0.1, 0.0, MIDDLE + 2e6, MIDDLE - 2e6))
    for side, pressure in ((1.0, seen["pressure_a"]), (-1.0, seen["pressure_b"])):
        volume = P["dead_volume"] + P["area"] * (P["stroke"] / 2 + side * seen["position"])
        mass = pressure / P["bulk_modulus"] + np.log(volume)
        assert np.ptp(mass) < 1e-9


def test_coulomb_friction_takes_four_levels_over_stiffness_per_cycle():
    level = 300.0
    start = (0.0, 0.0, MIDDLE + 1e6, MIDDLE - 1e6)
    _, seen = plant.run(SHUT | {"coulomb": level, "bristle": 1e-6}, still(0.3), centring=0.0, start=start)
    x = seen["position"]
    peaks = x[1:-1][(x[1:-1] > x[:-2]) & (x[1:-1] >= x[2:])]
    assert len(peaks) >= 5
    assert -np.diff(peaks).mean() == pytest.approx(4 * level / STIFFNESS, rel=0.03)


def test_a_stuck_piston_does_not_creep_and_slides_beyond_friction():
    stuck = plant.run(SHUT | {"coulomb": 500.0, "load": 300.0}, still(5.0), centring=0.0)[1]
    assert abs(stuck["position"][-1] - stuck["position"][2500]) < 1e-7
    assert abs(stuck["pressure_a"][-1] - stuck["pressure_b"][-1]) * P["area"] < 300.0
    slid = plant.run(SHUT | {"coulomb": 500.0, "load": 900.0}, still(5.0), centring=0.0)[1]
    oil = (slid["pressure_a"] - slid["pressure_b"])[-1] * P["area"]
    assert abs(900.0 + oil) < 500.0
    assert slid["position"][-1] == pytest.approx(-oil / STIFFNESS, rel=5e-3)
    assert slid["position"][-1] > 400.0 / STIFFNESS


@pytest.mark.parametrize("drive", [-6.0, 2.0, 5.0])
def test_steady_speed_follows_the_orifice_equation(drive):
    _, seen = plant.run({"leakage": 0.0}, np.full(900, drive), centring=0.0)
    opening = abs(drive) / P["drive_limit"]
    speed = abs(seen["velocity"][-100:].mean())
    friction = P["coulomb"] + P["viscous"] * speed
    drop = (P["supply"] - P["tank"] - friction / P["area"]) / 2  # over each land: equal flows
    assert speed == pytest.approx(P["valve_flow"] * opening * math.sqrt(drop / P["valve_drop"]) / P["area"], rel=2e-3)
    load = abs((seen["pressure_a"] - seen["pressure_b"])[-100:].mean()) * P["area"]
    assert load == pytest.approx(friction, rel=1e-2)


UNEQUAL = {"area": 5e-3, "area_b": 3e-3, "dead_volume": 3e-4, "dead_volume_b": 5e-4}


def test_unequal_areas_swing_at_the_resonance_of_both_chambers():
    volumes = [UNEQUAL["dead_volume" + s] + UNEQUAL["area" + s] * P["stroke"] / 2 for s in ("", "_b")]
    stiffness = P["bulk_modulus"] * (UNEQUAL["area"] ** 2 / volumes[0] + UNEQUAL["area_b"] ** 2 / volumes[1])
    balance = UNEQUAL["area_b"] / UNEQUAL["area"] * MIDDLE
    _, seen = plant.run(FREE | UNEQUAL, still(2.0), centring=0.0, start=(0.0, 1e-3, balance, MIDDLE))
    x = seen["position"]
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    period = np.diff(i + x[i] / (x[i] - x[i + 1])).mean() / experiments.RATE
    assert period == pytest.approx(2 * math.pi * math.sqrt(P["mass"] / stiffness), rel=5e-4)


@pytest.mark.parametrize("drive", [-5.0, 5.0])
def test_unequal_areas_move_at_unequal_speeds(drive):
    load = 2000.0
    _, seen = plant.run(UNEQUAL | {"leakage": 0.0, "load": load}, np.full(600, drive), centring=0.0)
    speed = seen["velocity"][-100:].mean()
    push = math.copysign(1.0, drive) * load - P["coulomb"] - P["viscous"] * abs(speed)
    a, b = UNEQUAL["area"], UNEQUAL["area_b"]
    first, second = (a, b) if drive > 0.0 else (b, a)
    square = (P["supply"] * first - P["tank"] * second + push) / (a**3 + b**3) / P["valve_drop"]
    assert abs(speed) == pytest.approx(P["valve_flow"] * abs(drive) / P["drive_limit"] * math.sqrt(square), rel=2e-3)


def test_end_stops_hold():
    _, seen = plant.run({}, np.full(6000, 8.0), centring=0.0)
    pressed = (seen["pressure_a"][-1] - seen["pressure_b"][-1]) * P["area"] / P["stop_stiffness"]
    assert seen["position"][-1] == pytest.approx(P["stroke"] / 2 + pressed, abs=1e-5)


def test_a_stiff_solver_agrees():
    """The plain plant's equations written once more, for SciPy's Radau."""
    feed = np.repeat([0.0, 3.0, -5.0, 1.0], 100)

    def slope(_, y, opening):
        x, v, pa, pb, z = y
        level = P["coulomb"]
        stiff = level / P["bristle"]
        dz = v - stiff * abs(v) * z / level
        bristles = stiff * (z + P["bristle_time"] * math.exp(-((v / 0.01) ** 2)) * dz)
        root = lambda drop: drop / (drop * drop + laws.BLEND**2) ** 0.25  # noqa: E731
        gain = P["valve_flow"] / math.sqrt(P["valve_drop"])
        up, down = max(opening, 0.0), max(-opening, 0.0)
        drop = pa - pb
        leak = 2 * P["leakage"] * drop / (1 + math.sqrt(1 + 8e-8 * abs(drop)))
        qa = gain * (up * root(P["supply"] - pa) - down * root(pa - P["tank"])) - leak - P["area"] * v
        qb = gain * (down * root(P["supply"] - pb) - up * root(pb - P["tank"])) + leak + P["area"] * v
        half = P["area"] * P["stroke"] / 2 + P["dead_volume"]
        force = drop * P["area"] - P["viscous"] * v - bristles
        return [v, force / P["mass"], qa * P["bulk_modulus"] / (half + P["area"] * x),
                qb * P["bulk_modulus"] / (half - P["area"] * x), dz]  # fmt: skip

    state = [0.0, 0.0, MIDDLE, MIDDLE, 0.0]
    states = [state]
    for i in range(0, len(feed), 100):
        times = np.arange(101) / experiments.RATE
        opening = feed[i] / P["drive_limit"]
        done = solve_ivp(
            slope,
            (0, times[-1]),
            state,
            "Radau",
            times,
            args=(opening,),
            rtol=1e-8,
            atol=[1e-10, 1e-8, 1.0, 1.0, 1e-11],
        )
        state = done.y[:, -1]
        states.extend(done.y[:, 1:].T)
    other = np.array(states)[:-1]
    _, seen = plant.run({}, feed, centring=0.0)
    assert abs(seen["position"] - other[:, 0]).max() < 2e-6
    assert abs(seen["pressure_a"] - other[:, 2]).max() < 2e3
    assert abs(seen["pressure_b"] - other[:, 3]).max() < 2e3


def test_noise_and_quantisation_are_those_of_the_example_records():
    shown = {}
    for name in ("triangle", "steps"):
        with gzip.open(ROOT / "examples" / "sample_bench" / f"{name}.csv.gz", "rt") as file:
            example = np.loadtxt(file, delimiter=",", skiprows=1)
        rng = np.random.default_rng(7)
        made = np.stack(list(plant.run({}, experiments.drive(name, rng), rng)[0].values()), axis=1)[: len(example)]
        shown[name] = (made, example)
    made, example = shown["triangle"]
    for column in (2, 3, 4):  # what differs between samples is noise there
        assert np.diff(made[:, column], 2).std() == pytest.approx(np.diff(example[:, column], 2).std(), rel=0.05)
    for table in (made, example):
        codes = table[:, 2] / 2.4e-5
        assert abs(codes - codes.round()).max() < 0.03
    feed = [t[:, 1] + experiments.CENTRING * t[:, 2] for t in (made, example)]
    assert abs(feed[0] - feed[1]).max() < 5e-4
    made, example = shown["steps"]
    assert abs(made[:, 1]).max() == pytest.approx(abs(example[:, 1]).max(), rel=0.35)


def test_a_stranger_among_the_parameters_is_named():
    with pytest.raises(KeyError, match="gravity"):
        plant.run({"gravity": 9.81}, still(0.1))
