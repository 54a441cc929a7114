"""An effect that no library has, written as a file: its law, its text, and what may not happen to files."""

from __future__ import annotations

import inspect
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.effect import Effect
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model_file import load_model
from hydraulic_sim.registry import Library, library, load_effect
from hydraulic_sysid.data.display import UNITS
from hydraulic_sysid.diagnosis.proposed_effect import proposal
from hydraulic_sysid.diagnosis.proposed_effect.effect_file import effect_text, per
from hydraulic_sysid.diagnosis.proposed_effect.laws import (
    FINE,
    PERIODIC,
    SHORT,
    CurveEquations,
    FittedLaw,
    best_law,
    spline,
)
from hydraulic_sysid.diagnosis.search.diagnosis import Remaining
from hydraulic_sysid.diagnosis.search.nonparametric import FILES, WITH_MEMORY
from hydraulic_sysid.diagnosis.search.nonparametric_curves import Place, curve_normal
from hydraulic_sysid.diagnosis.search.unknown_inputs import UnknownInput
from hydraulic_sysid.diagnosis.search.whereabouts import Whereabouts
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations
from hydraulic_sysid.estimation.parameters import Parameters

SIGNALS = {
    "position": 0.13, "velocity": -0.07, "pressure_a": 6e6, "pressure_b": 4.5e6, "pressure_difference": 1.5e6,
    "opening": 0.3, "t": 4.0, "direction": -1.0, "reading": 0.131, "reading_a": 6.01e6, "reading_b": 4.52e6,
    "lagged_velocity": -0.04,
}  # fmt: skip
PLACES = [
    (file, number, variable)
    for file in (*FILES, *WITH_MEMORY)
    for number, variable in enumerate(load_effect(file).effect.kernel.__globals__["VARIABLES"])
]


def place(hat: Effect, variable: str, number: int = 0, **shape: float) -> Place:
    """Without a plant."""
    plant: Any = None
    return Place(plant, hat, number, variable, np.zeros(0), shape)


def call(kernel, **parameters):
    return kernel(**{name: (SIGNALS | parameters)[name] for name in inspect.signature(kernel).parameters})


@pytest.mark.parametrize(("file", "number", "variable"), PLACES, ids=lambda x: getattr(x, "stem", str(x)))
def test_a_file_does_at_its_place_what_the_curve_did(file: Path, number: int, variable: str, tmp_path: Path) -> None:
    hat = load_effect(file).effect
    names = {"time": "t", "mean_pressure": "pressure_a", "size_of_opening": "opening"}
    z = SIGNALS.get(names.get(variable, variable.removeprefix("size_of_")), 0.07)
    knots = np.linspace(z - 3.3 * abs(z), z + 3.7 * abs(z), 17)
    step, height = float(knots[1] - knots[0]), 0.37 * hat.parameters[0].default
    for middle in (7, 8):
        heights = np.zeros(17)
        heights[middle] = height
        own = FittedLaw(spline(17), heights, (), 1.0, -1.0, knots)
        lag = {"lag": 0.004} if file in WITH_MEMORY else {}
        at, extent = place(hat, variable, number, **lag), (float(knots[0]), float(knots[-1]))
        text = effect_text(at, own, extent, "Evidence.", ["a"])
        path = tmp_path / f"written_{middle}.py"
        path.write_text(text)
        written = load_effect(path).effect
        defaults = {p.name: p.default for p in written.parameters}
        centre = float(knots[middle])
        usual = {p.name: p.default for p in hat.parameters}
        hats = {"over": float(number), "centre": centre, "width": step, "height": height}
        expected = call(hat.kernel, **usual | hats)
        assert call(written.kernel, **defaults) == pytest.approx(expected, rel=1e-3), text
        assert (variable in UNITS) is (variable not in ("opening", "size_of_opening")), "a unit, or a pure number"
        assert {p.name: p.default for p in written.parameters if p.unit == "s"} == lag
        assert written.states == hat.states and (hat.dynamics is None or written.dynamics(0.3, 0.004) == (250.0, 0.3))
        assert max(map(len, text.splitlines())) <= 120
    assert Library([*(library().file(n) for n in library()), load_effect(path)])  # slot, signals and names are in order


def curve_equations(true: np.ndarray, knots: np.ndarray, weight: float = 1e6) -> CurveEquations:
    """Of a curve seen through noise: its sum of squares is least at the true one, and neighbours go together."""
    size = float(np.abs(true).max())
    near = np.exp(-np.abs(np.subtract.outer(np.arange(len(knots)), np.arange(len(knots)))) / 0.7)
    information = weight / size**2 / len(knots) * near
    noise = np.linalg.cholesky(information) @ np.random.default_rng(5).standard_normal(len(knots))
    normal = NormalEquations(information, ((noise - information @ true)[None],))
    return CurveEquations(normal, knots, (float(knots[0]), float(knots[-1])), 0.0, 50_000)


TRUE = {
    "kink": (lambda z: 2e4 * np.maximum(z - 0.1, 0.0), (-0.3, 0.4)),
    "dead zone": (lambda z: np.sign(z) * np.maximum(np.abs(z) - 0.12, 0.0), (-0.3, 0.4)),
    "bump": (lambda z: -3.0 * np.exp(-(((z + 0.1) / 0.08) ** 2)), (-0.3, 0.4)),
    "square law": (lambda z: 5e3 * z * np.abs(z), (-0.3, 0.4)),
    "approach": (lambda z: 2.0 * (1.0 - np.exp(-z / 4.0)), (0.0, 20.0)),
    "spline": (lambda z: np.where(z < 0.0, np.cos(9.0 * z), 1.0 - 4.0 * z), (-0.3, 0.4)),
}


@pytest.mark.parametrize("name", TRUE)
def test_a_short_law_is_taken_where_it_explains_as_much_as_a_spline(name: str) -> None:
    true, extent = TRUE[name]
    knots = np.linspace(*extent, FINE)
    found = best_law(curve_equations(true(knots), knots))
    assert found is not None and found.law.name == name, found
    # Sixteen intervals are as fine as a spline is made.
    assert np.allclose(found.values(knots), true(knots), atol=0.05 * np.abs(true(knots)).max())


def test_what_goes_round_is_periodic() -> None:
    knots = np.linspace(-0.6, 0.6, PERIODIC)
    true = 400.0 * np.sin(2.0 * np.pi * knots / 0.03 + 0.4)
    found = best_law(curve_equations(true, knots))
    assert found is not None and found.law.name == "periodic" and len(found.coefficients) == 2
    assert found.shape[0] == pytest.approx(0.03, rel=1e-3)


def test_no_law_explains_noise() -> None:
    knots = np.linspace(-0.3, 0.4, FINE)
    assert best_law(curve_equations(1e-9 * np.ones(FINE), knots, weight=1.0)) is None


@pytest.mark.parametrize("law", [*SHORT, spline(5)], ids=lambda law: f"{law.name} {len(law.coefficients)}")
def test_the_text_of_a_law_is_its_basis(law, tmp_path: Path) -> None:
    hat = load_effect(next(f for f in FILES if f.stem == "unknown_force")).effect
    coefficients = np.linspace(1.0, 2.0, len(law.coefficients))
    shape = tuple(0.3 + 0.1 * i for i in range(len(law.shapes)))
    knots = np.linspace(-1.0, 1.0, 5) if law.name == "spline" else None
    fitted = FittedLaw(law, coefficients, shape, 1.0, -1.0, knots)
    path = tmp_path / "written.py"
    path.write_text(effect_text(place(hat, "position"), fitted, (-1.0, 1.0), "Evidence.", ["a"]))
    written = load_effect(path).effect
    defaults = {p.name: p.default for p in written.parameters}
    for z in (-0.9, -0.35, 0.0, 0.2, 0.77):
        (value,) = fitted.values(np.array([z]))
        assert written.kernel(
            z, *(defaults[n] for n in inspect.signature(written.kernel).parameters if n in defaults)
        ) == (pytest.approx(-value, rel=1e-3, abs=1e-12))
    assert all(math.isfinite(b) for p in written.parameters for b in p.bounds)


@pytest.mark.parametrize(
    ("unit", "other", "power", "expected"),
    [
        ("N", "m", 1, "N/m"),
        ("N", "m/s", 2, "N*s^2/m^2"),
        ("m^3/(s*Pa)", "m", 0, "m^3/(s*Pa)"),
        ("m^3/Pa", "Pa", 1, "m^3/Pa^2"),
        ("m", "m", 1, "1"),
        ("1", "Pa", 1, "1/Pa"),
        ("N", "1", 3, "N"),
    ],
)
def test_the_unit_of_a_coefficient(unit: str, other: str, power: int, expected: str) -> None:
    assert per(unit, other, power) == expected


def test_a_spline_is_constant_where_the_variable_seldom_is() -> None:
    knots = np.linspace(-1.0, 1.0, FINE)
    true = np.where(np.abs(knots) < 0.5, np.cos(9.0 * knots), np.sign(knots) * 40.0)
    every = curve_equations(true, knots)
    weight = np.where(np.abs(knots) < 0.5, 1.0, 1e-4)
    information = every.normal.information * np.outer(weight, weight)
    seldom = NormalEquations(information, (-(information @ true)[None],))
    found = best_law(replace(every, normal=seldom, usual=(-0.5, 0.5)), short=False)
    assert found is not None and found.knots is not None and np.abs(found.knots).max() == 0.5
    assert np.abs(found.values(np.array([-1.0, 1.0]))).max() < 2.0


@pytest.mark.parametrize(
    ("costs", "expected"), [({0.3: 7.0, 0.1: 5.0}, 0.1), ({1.0: 9.0, 0.3: 7.0, 0.1: 8.0}, 0.3), ({}, None)]
)
def test_a_curve_begins_with_the_part_of_it_that_leaves_least(costs, expected, monkeypatch: pytest.MonkeyPatch) -> None:
    """To first order a curve may be many times what it is, and then the plant may not even run."""
    key = "constant_load.load"
    model = load_model("sample_bench").with_effect("constant_load", {"load": 50.0})

    def begin(plant, *_, **__):
        share = round(plant.value(key) / 50.0, 9)
        if share not in costs:
            raise SimulationError(f"does not run with {share}")
        return SimpleNamespace(cost=costs[share])

    monkeypatch.setattr(proposal, "FitPoint", SimpleNamespace(begin=begin))
    part: Any = SimpleNamespace(split=SimpleNamespace(segments=[]))
    if expected is None:
        with pytest.raises(SimulationError, match="does not run with 0.1"):
            proposal.begun(part, model, [key], [key], {})
    else:
        assert proposal.begun(part, model, [key], [key], {}).value(key) == pytest.approx(50.0 * expected)


def test_no_leak_flows_uphill(tmp_path: Path) -> None:
    """Where a bounded leakage of the model is all that holds a uniform one, a fit would go anywhere."""
    hat = load_effect(next(f for f in FILES if f.stem == "unknown_conductance")).effect
    fitted = FittedLaw(spline(3), np.array([-6e-11, 0.0, 2e-11]), (), 1.0, -1.0, np.array([0.0, 1.0, 2.0]))
    path = tmp_path / "written.py"
    path.write_text(effect_text(place(hat, "position"), fitted, (0.0, 2.0), "Evidence.", ["a"]))
    heights = load_effect(path).effect.parameters
    assert [p.default for p in heights] == [0.0, 0.0, 2e-11]
    assert all(p.bounds[0] == 0.0 < p.bounds[1] for p in heights)


@pytest.mark.parametrize(("low", "high", "left"), [(0.9, 1.1, 300.0), (-np.inf, np.inf, 0.0)])
def test_no_curve_does_what_a_bounded_parameter_could_undo(low: float, high: float, left: float) -> None:
    """A uniform curve and a parameter that do the same: only where that may be anything nothing is known of the curve.

    Between its bounds it has a variance of a twelfth of their distance squared.
    """
    one = np.ones(1)
    none, unlimited = 0.0 * one, np.inf * one
    parameters = Parameters(("level",), one, one, low * one, high * one, none, unlimited, unlimited, none)
    every = np.full((4, 4), 1e9)  # of the parameter and, alike, of three heights together
    normal = NormalEquations(every, (np.zeros((1, 4)),))
    at: Any = SimpleNamespace(changes=lambda plants: [], bordered=lambda columns: normal, parameters=parameters)
    hat = load_effect(next(f for f in FILES if f.stem == "unknown_force")).effect
    plant: Any = SimpleNamespace(with_parameters=lambda values: None)
    found = curve_normal(at, Place(plant, hat, 0, "velocity", np.zeros(0)), np.array([0.0, 1.0, 2.0]))
    assert found is not None and found.information == pytest.approx(np.full((3, 3), left), rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(("cost", "holds"), [(140.0, True), (160.0, False), (None, False)])
def test_a_law_must_explain_what_its_curve_does(
    cost: float | None, holds: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the 1000 that were left the curve leaves 50: nine tenths of what it explains are 855."""
    model = load_model("sample_bench")
    hat = load_effect(next(f for f in FILES if f.stem == "unknown_force")).effect

    def begin(*_: Any, **__: Any) -> SimpleNamespace:
        if cost is None:
            raise SimulationError("does not run")
        return SimpleNamespace(cost=cost)

    monkeypatch.setattr(proposal, "FitPoint", SimpleNamespace(begin=begin))
    monkeypatch.setattr(proposal, "Plant", SimpleNamespace(for_fits=lambda model: model))
    part: Any = SimpleNamespace(
        model=model, parameters=Parameters.of(model, ["moving_mass"]), costs=[np.array([600.0, 400.0])],
        split=SimpleNamespace(segments=[]),
    )  # fmt: skip
    at = replace(place(hat, "position"), values=np.array([-0.2, 0.2]))
    law = proposal.Candidate(at, np.zeros(0), FittedLaw(SHORT[0], np.array([100.0]), (), 1.0, -1.0))
    fit: Any = SimpleNamespace(at=SimpleNamespace(model=model), cost=50.0)
    assert proposal.holds(part, fit, law, tmp_path / "law" / "own_effect.py", ["a"]) is holds


def test_the_name_of_a_record_runs_nothing(tmp_path: Path) -> None:
    hat = load_effect(FILES[0]).effect
    variable = hat.kernel.__globals__["VARIABLES"][0]
    fitted = FittedLaw(spline(3), np.ones(3), (), 1.0, -1.0, np.array([0.0, 1.0, 2.0]))
    hostile = ['"""\nraise SystemExit\n"""', "a\\", 'b"; import os #', "{0}", "\x00\r\n"]
    path = tmp_path / "written.py"
    path.write_text(effect_text(place(hat, variable), fitted, (0.0, 2.0), "Evidence.", hostile))
    assert "import os" in load_effect(path).effect.source


@pytest.mark.parametrize(
    ("known", "fitted"),
    [
        (0.95, ["leak speed", "leak position", "leak time"]),  # the place is known: all that it may follow, and
        (0.6, ["leak speed", "leak time"]),  # a curve over the time, which says nothing of other records, last
    ],
)
def test_what_is_fitted_is_what_may_be_the_law(
    monkeypatch: pytest.MonkeyPatch, known: float, fitted: list[str]
) -> None:
    shares = {("leak", "time"): 0.5, ("leak", "speed"): 0.48, ("leak", "position"): 0.2, ("force", "speed"): 0.3}

    def at(key: tuple[str, str]) -> Any:
        return SimpleNamespace(key=key, effect=SimpleNamespace(name=key[0]), variable=key[1])

    def candidate(_part: object, place: Any, _number: int) -> Any:
        law = SimpleNamespace(reduction=shares[place.key], law=SimpleNamespace(name="spline"))
        return SimpleNamespace(place=place, fitted=law, words=" ".join(place.key), over_time=place.variable == "time")

    tried = list[str]()

    def fit(_part: object, found: Any, *_: object) -> None:
        tried.append(found.words)
        raise SimulationError("it does not run")

    for name, one in {
        "places": lambda *_: map(at, shares), "_candidate": candidate, "_fitted": fit, "PERIODIC_PLACES": (),
        "drives_by_force": lambda _: False, "_with_memory": lambda *_: None,
    }.items():  # fmt: skip
        monkeypatch.setattr(f"hydraulic_sysid.diagnosis.proposed_effect.proposal.{name}", one)
    curves: Any = [SimpleNamespace(place=p, variable=v, subsystem=p, share=s) for (p, v), s in shares.items()]
    inputs = [UnknownInput("leak", "flow", "a leak", known), UnknownInput("force", "force", "a force", 0.3)]
    part: Any = SimpleNamespace(model=None)
    assert proposal.propose(Remaining(part, Whereabouts(curves, inputs)), "own", ["a"]) is None
    assert tried == fitted
