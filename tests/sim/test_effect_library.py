"""What every effect of the library has to say about itself."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hydraulic_sim import base, effects, slots
from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.model import Model
from hydraulic_sim.registry import library
from hydraulic_sim.units import conversion

# The names are an interface: they stand in model files and reports. This is the one place that lists them.
VOCABULARY = (
    "viscous_friction", "viscous_asymmetry", "coulomb_friction", "stribeck_friction", "friction_asymmetry",
    "position_dependent_friction", "presliding", "constant_load", "load_spring", "structural_flexibility",
    "end_cushion", "end_stop", "backlash", "internal_leakage", "turbulent_leakage", "external_leakage",
    "entrained_air", "hose_compliance", "viscosity_drift", "valve_deadband", "valve_underlap", "valve_null_bias",
    "valve_hysteresis", "valve_gain_asymmetry", "valve_gain_curve", "valve_flow_saturation", "spool_dynamics",
    "spool_rate_limit", "command_delay", "supply_droop", "return_back_pressure", "pump_ripple", "sensor_offset",
    "sensor_scale", "sensor_nonlinearity", "sensor_lag", "sensor_delay", "sensor_backlash", "sensor_quantisation",
    "pressure_offset", "position_loop", "motor_damping", "supply_sag", "force_limit", "load_dependent_friction",
    "gravity_pendulum", "payload",
)  # fmt: skip

EVERY = pytest.mark.parametrize("effect", library().values(), ids=list(library()))
PARAMETERS = [(e.name, p) for e in library().values() for p in e.parameters] + [("base", p) for p in base.PARAMETERS]


def test_the_library_speaks_the_vocabulary() -> None:
    assert sorted(library()) == sorted(VOCABULARY)


def test_every_file_of_the_folder_is_an_effect() -> None:
    files = {file.stem for file in Path(next(iter(effects.__path__))).glob("*.py")} - {"__init__"}
    assert files == set(library())


@EVERY
def test_an_effect_is_one_short_file_named_after_it(effect: Effect) -> None:
    file = library().source_file(effect.name)
    assert file.stem == effect.name
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 100


@EVERY
def test_the_file_states_equation_and_source(effect: Effect) -> None:
    text = library().source_file(effect.name).read_text(encoding="utf-8")
    docstring = text.split('"""')[1]
    assert "Source:" in docstring, "the docstring names no source"
    assert set("=≤") & set(docstring), "the docstring has no equation"
    assert effect.equation and effect.source and effect.summary
    assert any(character.isdigit() for character in effect.source), "a source without a year or chapter"


@EVERY
def test_confusions_are_effects_and_not_the_effect_itself(effect: Effect) -> None:
    assert set(effect.confused_with) <= set(library())
    assert effect.name not in effect.confused_with
    assert effect.always_on or effect.confused_with, "nothing it could be confused with"


@EVERY
def test_slot_and_subsystem_exist(effect: Effect) -> None:
    assert slots.SLOTS[effect.slot].subsystem in {"force", "flow", "fluid", "valve", "supply", "sensor"}


@pytest.mark.parametrize(("owner", "parameter"), PARAMETERS, ids=[f"{o}.{p.name}" for o, p in PARAMETERS])
def test_a_parameter_has_unit_source_and_usable_bounds(owner: str, parameter: Parameter) -> None:
    assert conversion(parameter.unit, parameter.unit) == (1.0, 0.0)
    assert parameter.description and parameter.source
    low, high = parameter.bounds
    assert math.isfinite(low) and math.isfinite(high) and low <= parameter.default <= high


@EVERY
def test_an_effect_that_is_on_by_default_values_is_not_null(effect: Effect) -> None:
    if effect.always_on:
        return
    assert any(p.null is not None and p.default != p.null for p in effect.parameters)


@EVERY
def test_states_have_units_and_starts(effect: Effect) -> None:
    named = {p.name for p in base.PARAMETERS} | {"command"}
    for state in effect.states:
        assert conversion(state.unit, state.unit) == (1.0, 0.0)
        assert state.scale > 0.0
        assert not isinstance(state.initial, str) or state.initial in named


def test_keys_of_a_model_are_those_of_its_effects(bare: Model, everything: Model) -> None:
    always = {f"{e.name}.{p.name}" for e in library().values() if e.always_on for p in e.parameters}
    expected = {p.name for p in base.PARAMETERS} | always
    assert set(bare.keys()) == expected
    on = (library()[name] for name in everything.effects)
    assert set(everything.keys()) == expected | {f"{e.name}.{p.name}" for e in on for p in e.parameters}
