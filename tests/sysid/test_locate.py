"""Blame falls on the subsystem that is at fault, and on none where nothing is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.model import Entry, Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.diagnosis.locate import LocateError, locate

DT = 1e-3
NOISE = {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4, "spool": 5e-7, "pressure_supply": 1.5e4}
TONES = ((0.3, 1.8), (0.7, 1.2), (1.9, 0.9), (4.1, 0.6), (9.3, 0.5), (19.7, 0.4))
MEASURED = ("position", "pressure_a", "pressure_b")


def record_of(model: Model, seed: int, channels: tuple[str, ...] = MEASURED, seconds: float = 8.0) -> Record:
    """What a bench with this model's physics would have measured."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, DT)
    u = sum(a * np.sin(2 * np.pi * f * t + p) for (f, a), p in zip(TONES, rng.uniform(0, 2 * np.pi, 6), strict=True))
    run = Plant(model).simulate(u, DT)
    measured = {}
    for name in channels:
        factor = model.value("spool_travel") if name == "spool" else 1.0
        measured[name] = factor * run[name] + NOISE[name] * rng.standard_normal(t.size)
    return Record.sampled(f"tones{seed}", DT, {"drive": u, **measured})


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


@pytest.fixture(scope="module")
def exact(model: Model) -> dict[str, Any]:
    return locate(model, [record_of(model, 0), record_of(model, 1)])


def first(result: Mapping[str, Any]) -> dict[str, Any]:
    return result["attribution"][0]


def test_exact_model_is_at_its_noise_and_nobody_is_blamed(exact: dict[str, Any]) -> None:
    assert exact["verdict"]["level"] == "explained"
    assert {b["name"] for b in exact["balances"]} == {"force", "flow_a", "flow_b", "valve", "continuity"}
    for b in exact["balances"]:
        assert 0.85 < b["ratio"] < 1.15, b["name"]
    assert exact["misfit"]["refitted"] < 1.1 * exact["misfit"]["exact_model"]
    assert not [f for f in exact["findings"] if f["kind"] in ("attribution", "violated")]


def test_exact_model_is_white_within_the_bounds_of_n_samples(exact: dict[str, Any]) -> None:
    for name, w in exact["whiteness"].items():
        assert w["bound"] == pytest.approx(1.96 / np.sqrt(w["samples"]))
        assert w["autocorrelation"][0] == pytest.approx(1.0)
        assert w["outside"] < 0.25, name
        assert np.abs(w["autocorrelation"][1:]).max() < 0.1


FAULTS = {
    "stribeck_friction": ("force", {"rise": 400.0, "speed": 0.02}),
    "load_spring": ("force", {"stiffness": 3000.0}),
    "valve_deadband": ("valve", {"width": 0.02}),
    "command_delay": ("valve", {"delay": 4e-3}),
    "external_leakage": ("flow", {"coefficient": 1e-12}),
    "hose_compliance": ("fluid", {"capacity": 3e-12}),
    "supply_droop": ("supply", {"resistance": 1e9}),
    "sensor_nonlinearity": ("sensor", {"cubic": 0.5}),
    "sensor_lag": ("sensor", {"time": 6e-3}),
}


THOROUGH = ("stribeck_friction", "command_delay", "sensor_lag", "hose_compliance")  # like ones are always looked for


@pytest.mark.parametrize(
    "effect", [pytest.param(e, marks=pytest.mark.thorough) if e in THOROUGH else e for e in FAULTS]
)
def test_subsystem_of_a_missing_effect_is_found(model: Model, effect: str) -> None:
    subsystem, values = FAULTS[effect]
    plant = model.with_effect(effect, values)
    result = locate(model, [record_of(plant, seed, seconds=5.0) for seed in (2, 3)])
    assert result["verdict"]["level"] != "explained"
    assert first(result)["name"] == subsystem, [(s["name"], s["alone"]) for s in result["attribution"]]
    assert first(result)["share"] > 0.5


def test_wrong_free_parameter_is_no_fault_of_a_subsystem(model: Model) -> None:
    """The mass is off by a tenth: the force balance shows it, and no subsystem is blamed for it."""
    plant = model.with_values({"moving_mass": 550.0, "viscous_friction.coefficient": 180.0})
    result = locate(model, [record_of(plant, 4), record_of(plant, 5)])
    assert result["misfit"]["model"] > 1.2 * result["misfit"]["refitted"]
    assert result["verdict"]["level"] == "explained"


def test_parameter_stays_within_its_bounds(model: Model) -> None:
    """A leakage ten times that of the data sheet is beyond the model's bounds, and leakage is blamed."""
    plant = model.with_values({"internal_leakage.coefficient": 2e-11})
    result = locate(model, [record_of(plant, 6), record_of(plant, 7)])
    assert first(result)["name"] == "flow"


def test_fault_that_no_effect_of_the_library_makes(model: Model) -> None:
    """A position reading with a ripple over the stroke, as a damaged scale makes it."""
    records = []
    for seed in (8, 9):
        r = record_of(model, seed)
        ripple = 1.5e-3 * np.sin(2 * np.pi * r["position"] / 0.1)
        records.append(replace(r, channels={**r.channels, "position": r["position"] + ripple}))
    result = locate(model, records)
    assert first(result)["name"] == "sensor"
    assert next(iter(first(result)["variables"])) == "position"
    continuity = next(b for b in result["balances"] if b["name"] == "continuity")
    assert continuity["ratio"] > 5.0


@pytest.mark.thorough
def test_measured_spool_and_supply_have_balances_of_their_own(model: Model) -> None:
    plant = model.with_effect("spool_dynamics", {"frequency": 40.0})
    records = [record_of(plant, seed, (*MEASURED, "spool", "pressure_supply")) for seed in (10, 11)]
    ratio = {b["name"]: b["ratio"] for b in locate(model, records)["balances"]}
    assert ratio["spool"] > 20.0
    assert ratio["flow_a"] < 6.0 and ratio["supply"] == pytest.approx(1.0, abs=0.15)
    without = [record_of(plant, seed) for seed in (10, 11)]
    assert {b["name"]: b["ratio"] for b in locate(model, without)["balances"]}["flow_a"] > 20.0


def test_fewer_channels_allow_fewer_balances_and_say_so(model: Model) -> None:
    plant = model.with_effect("valve_deadband", {"width": 0.02})
    one = locate(model, [record_of(plant, 12, ("position", "pressure_a"))])
    assert [b["name"] for b in one["balances"]] == ["flow_a"]
    assert first(one)["name"] == "valve"
    missing = {m["name"]: m["why"] for m in one["not_formed"]}
    assert "pressure_b" in missing["force"] and set(missing) == {"force", "flow_b", "spool", "supply"}
    none = locate(model, [record_of(plant, 12, ("position",))])
    assert none["balances"] == [] and none["attribution"] == [] and none["misfit"] is None
    assert "pressures" in none["verdict"]["text"]


def test_mechanical_axis_has_a_force_balance() -> None:
    entries = {"moving_mass": Entry(95.0, bounds=(80.0, 110.0)), "drive_force": Entry(35.0), "stroke": Entry(10.0)}
    axis = Model("axis", entries, ("viscous_friction", "coulomb_friction"), "mechanical")
    axis = axis.with_values({"viscous_friction.coefficient": 200.0, "coulomb_friction.level": 20.0})
    plant = axis.with_effect("friction_asymmetry", {"difference": 8.0})

    def record(physics: Model, seed: int) -> Record:
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 8.0, DT)
        held = np.repeat(rng.uniform(-6.0, 6.0, t.size // 400), 400)
        u = held + np.sin(2 * np.pi * 2.3 * t)
        x = Plant(physics).simulate(u, DT).position + 2e-6 * rng.standard_normal(t.size)
        return Record.sampled(f"axis{seed}", DT, {"drive": u, "position": x})

    good = locate(axis, [record(axis, 1), record(axis, 2)])
    assert good["verdict"]["level"] == "explained"
    result = locate(axis, [record(plant, 1), record(plant, 2)])
    assert [b["name"] for b in result["balances"]] == ["force"] and result["balances"][0]["ratio"] > 3.0
    assert first(result)["name"] == "force"
    assert result["not_formed"] == []


def test_what_allows_no_balance_is_named(model: Model) -> None:
    r = record_of(model, 0)
    with pytest.raises(LocateError, match="no record"):
        locate(model, [])
    with pytest.raises(LocateError, match="no channel 'position'"):
        locate(model, [replace(r, channels={"drive": r["drive"]})])
    with pytest.raises(LocateError, match="1 s long"):
        locate(model, [r.window(0.0, 1.0)])


def test_document_is_plain_data(exact: dict[str, Any]) -> None:
    document = plain(exact)
    assert document["schema"] == "hydraulic_sysid.locate/2"
    assert {"balances", "attribution", "whiteness", "misfit", "findings", "verdict"} <= set(document)
    for b in document["balances"]:
        assert set(b["error_maps"]) <= {"velocity", "opening", "load_pressure", "position", "time", "direction"}
        assert len(b["spectrum"]["frequency"]) == len(b["spectrum"]["exact"])
