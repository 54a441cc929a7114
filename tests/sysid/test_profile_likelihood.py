"""Intervals by what it costs to hold a parameter off its fitted value, beside those of a normal distribution."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA
from hydraulic_sysid.diagnosis.search.linearisation import Linearisation
from hydraulic_sysid.diagnosis.search.profile_likelihood import with_profiles
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.uncertainty import law_share, parameter_errors
from hydraulic_sysid.estimation.fit import FitSettings, fit_from, fit_segments

DT, NOISE = 1e-3, {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}
LEAKAGE, FREQUENCY = "internal_leakage.coefficient", "spool_dynamics.frequency"
FREE = ("bulk_modulus", "viscous_friction.coefficient", LEAKAGE)
LIMIT = (3.0 * CRITERIA.shared**2, 7.0 * CRITERIA.shared**2)  # about the 3.84 of one degree of freedom, and shared


def fitted(built: Model, free: tuple[str, ...], seed: int = 3, louder: float = 1.0) -> Linearisation:
    """A plant's own record, and what of it is free fitted from the true values, between next to nothing and a lot."""
    time, draw = DT * np.arange(6000), np.random.default_rng(seed)
    drive = 3.0 * np.sin(2.0 * np.pi * (0.2 * time + 0.5 * time**2))
    run = Plant(built).simulate(drive, DT)
    seen = {c: np.asarray(getattr(run, c)) + louder * std * draw.standard_normal(time.size) for c, std in NOISE.items()}
    for key in {*built.movable_keys(), *free}:
        built = built.with_entry(key, free=key in free, bounds=built.parameter(key).bounds)
    record = Record.sampled("sweep", DT, {"drive": drive, **seen})
    return Search.of(built, [record], [], FitSettings(), lambda _: None).state(built).linearisation


def costs(at: Linearisation) -> Callable[[str, float], float]:
    """By how much the sum of squares of the segments for fitting is larger with a parameter held."""
    settings = FitSettings()
    least = fit_segments(Plant.for_fits(at.model), at.split.to_fit, at.model.movable_keys(), settings).point.cost

    def cost(key: str, value: float) -> float:
        model = at.model.with_entry(key, value=value, free=False)
        try:
            done = fit_segments(Plant.for_fits(model), at.split.to_fit, model.movable_keys(), settings)
        except SimulationError:
            return math.inf
        return done.point.cost - least

    return cost


@pytest.fixture(scope="module")
def bench() -> Model:
    return load_model("sample_bench")


@pytest.mark.parametrize("times", [0.7, 1.5])
def test_a_fit_beside_a_parameter_that_is_held_begins_where_the_others_are_and_ends_where_one_from_nowhere_does(
    bench: Model, times: float
) -> None:
    at = fitted(bench, FREE)
    key, value = LEAKAGE, times * at.model.value(LEAKAGE)
    anew = costs(at)(key, value)
    known = at.point.with_columns_kept().subset(at.split.fit)
    begin = known.holding(key, value)
    assert key not in begin.parameters.keys and begin.plant.value(key) == value
    # To first order the others are there already, initial states as well.
    assert begin.cost - known.cost < anew + 1.0
    done = fit_from(begin, FitSettings())
    assert done.cost - known.cost == pytest.approx(anew, abs=0.5, rel=0.05)
    assert done.iterations <= 3


@pytest.mark.parametrize("named", [(), (LEAKAGE,)], ids=["by sensitivities", "by fits"])
def test_of_a_parameter_at_its_bound_the_interval_ends_where_the_records_contradict_it(
    bench: Model, named: tuple[str, ...]
) -> None:
    at = fitted(bench.with_values({LEAKAGE: 0.0}), FREE)
    at = at_bound(at)
    known = parameter_errors(at)[LEAKAGE]
    assert known.at_bound == "lowest" and not math.isfinite(known.half_width)
    cost = costs(at)
    low, high = with_profiles(at, parameter_errors(at), named, cost)[LEAKAGE].interval(0.0)
    assert low == 0.0 < high < 5.0 * bench.value(LEAKAGE)
    assert LIMIT[0] < cost(LEAKAGE, high / (1.0 + 2.0 * law_share(at.model, LEAKAGE))) < LIMIT[1]


def at_bound(at: Linearisation) -> Linearisation:
    """The same, the leakage at its bound, where half of all noise has it."""
    for seed in range(3, 9):
        if LEAKAGE in at.parameters.at_bound:
            return at
        at = fitted(at.model.with_values({LEAKAGE: 0.0}), FREE, seed + 1)
    pytest.fail("in none of six records the leakage ends at its bound")


def test_of_a_parameter_that_is_well_known_it_is_that_of_a_normal_distribution(bench: Model) -> None:
    at = fitted(bench, FREE)
    key = "bulk_modulus"
    known = parameter_errors(at)
    vague = {**known, key: replace(known[key], standard_error=math.inf)}
    low, high = with_profiles(at, vague, [key], costs(at))[key].interval(at.model.value(key))
    np.testing.assert_allclose([low, high], known[key].interval(at.model.value(key)), rtol=0.01)
    assert with_profiles(at, known, [key], costs(at))[key] == known[key]  # and not sought


def test_no_interval_goes_where_no_fit_may(bench: Model) -> None:
    at = fitted(bench, FREE)
    key, (low, high) = LEAKAGE, bench.parameter(LEAKAGE).bounds
    unknown = replace(parameter_errors(at)[key], standard_error=math.inf, half_width=math.inf)
    none = {**parameter_errors(at), key: unknown}
    found = with_profiles(at, none, (), costs(at), {})[key].interval(at.model.value(key))
    assert low <= found[0] < at.model.value(key) < found[1] <= high


def test_a_parameter_that_is_hardly_known_may_be_further_off_one_way(bench: Model) -> None:
    """A spool that is fast may be much faster, and not much slower."""
    built = bench.with_effect("spool_dynamics", {"frequency": 350.0, "damping": 0.8})
    at = fitted(built, (*FREE, FREQUENCY), louder=20.0)
    value, cost = at.model.value(FREQUENCY), costs(at)
    known = parameter_errors(at)
    low, high = with_profiles(at, {**known, FREQUENCY: replace(known[FREQUENCY], standard_error=math.inf)},
                              [FREQUENCY], cost)[FREQUENCY].interval(value)  # fmt: skip
    assert low < 350.0 < high and high - value > 1.3 * (value - low)
    share = 2.0 * law_share(at.model, FREQUENCY)
    assert LIMIT[0] < cost(FREQUENCY, low + share * value) < LIMIT[1]
