"""What an effect brings is as large as the plant: the library's defaults are those of one bench."""

from __future__ import annotations

import pytest

from hydraulic_sim.effect import Parameter
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.typical import OF_LOADS, UNITS, sized, typical


@pytest.fixture(scope="module")
def bench() -> Model:
    return load_model("moog_mcr_m_1002_bench")


def every(model: Model) -> list[Parameter]:
    return [p for effect in model.library.values() for p in effect.parameters]


def test_on_the_bench_of_the_defaults_they_are_the_defaults(bench: Model) -> None:
    for parameter in every(bench):
        assert typical(bench, parameter) == pytest.approx(parameter.default, rel=1e-3)


def test_each_quantity_grows_with_what_it_is_made_of(bench: Model) -> None:
    twice = bench.with_values({key: 2.0 * bench.value(key) for key in ("stroke", "dead_volume_a", "dead_volume_b")})
    longer = {"m": 2.0, "1/m^2": 0.25, "N/m": 0.5, "N/m^2": 0.25, "m^3/Pa": 2.0, "N": 1.0, "kg": 1.0, "Pa": 1.0}
    grown = {p.unit: typical(twice, p) / p.default for p in every(twice) if p.default and not p.null}
    for unit, factor in longer.items():
        assert grown[unit] == pytest.approx(factor, rel=1e-3), unit
    heavier = bench.with_values({"moving_mass": 3.0 * bench.value("moving_mass")})
    grown = {p.unit: typical(heavier, p) / p.default for p in every(heavier) if p.default and not p.null}
    assert grown["kg"] == pytest.approx(3.0) and grown["N*s/m"] == pytest.approx(1.0, rel=1e-3)


def test_what_devices_have_is_left_and_bounds_hold(bench: Model) -> None:
    tiny = bench.with_values({"stroke": 1e-3 * bench.value("stroke"), "moving_mass": 0.5})
    for effect in tiny.library.values():
        for before, after in zip(effect.parameters, sized(tiny, effect).parameters, strict=True):
            low, high = before.bounds
            assert low <= after.default <= high
            swings = effect.slot == "force" and before.unit in OF_LOADS
            if before.null or before.unit not in UNITS and not swings:
                assert after.default == before.default


def test_what_swings_with_the_load_is_as_fast_as_the_oil(bench: Model) -> None:
    heavier = bench.with_values({"moving_mass": 9.0 * bench.value("moving_mass")})
    structure, spool = (sized(heavier, bench.library[name]) for name in ("structural_flexibility", "spool_dynamics"))
    (swing,), (device,) = ([p.default for p in e.parameters if p.unit == "Hz"] for e in (structure, spool))
    assert swing == pytest.approx(bench.library.parameter("structural_flexibility.frequency").default / 3.0, rel=1e-3)
    assert device == bench.library.parameter("spool_dynamics.frequency").default
