"""What is so small that a noise estimated from the residual has it in it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.search_state import SearchState
from hydraulic_sysid.diagnosis.search.worth import borrowed
from hydraulic_sysid.estimation.fit import FitSettings

DT, SECONDS = 1e-3, 12.0
RISE = 14.0  # N


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


def search(model: Model, plant: Model, steps: bool = False, step: float = 0.0) -> Search:
    """On a record of ``plant``: slow sines or steps, with noise of 3 µm and 2 kPa, perhaps read in a ``step``."""
    rng = np.random.default_rng(11)
    t = DT * np.arange(round(SECONDS / DT))
    drive = 1.2 * np.sin(2.0 * np.pi * 0.4 * t) + 0.8 * np.sin(2.0 * np.pi * 1.3 * t)
    if steps:
        drive = np.repeat(rng.uniform(-4.0, 4.0, t.size // 300), 300)
    run = Plant(plant).simulate(drive, DT)
    noise = {"position": 3e-6, "pressure_a": 2e3, "pressure_b": 2e3}
    channels = {c: np.asarray(getattr(run, c)) + rng.normal(0.0, s, t.size) for c, s in noise.items()}
    if step:
        channels["position"] = step * np.round(channels["position"] / step)
    return Search.of(model, [Record("sines", t, DT, {"drive": drive, **channels})], [], FitSettings(), lambda _: None)


@pytest.mark.parametrize(("hidden", "nothing"), [({}, True), ({"stribeck_friction": {"rise": RISE}}, False)])
def test_what_passes_for_noise_is_still_promised_by_its_effect(model: Model, hidden: dict, nothing: bool) -> None:
    plant = model
    for name, values in hidden.items():
        plant = plant.with_effect(name, values)
    looked = search(model, plant)
    base = looked.judged(looked.state(looked.given))
    assert base.misfit.variance - 1.0 < CRITERIA.nothing_left, "by the noise alone nothing is left of either"
    assert looked.nothing_left(base) is nothing
    looked.quick = True
    assert looked.nothing_left(base) is nothing, "a quick diagnosis looks for it, too"


def test_a_load_that_the_file_does_not_know_is_found_beyond_its_bound(model: Model) -> None:
    """From the bound on every step is uphill: a resonance that is a little off is as wrong as one that is far off."""
    heavy = 1.85 * model.value("moving_mass")
    looked = search(model, model.with_values({"moving_mass": heavy}), steps=True)
    assert model.entry("moving_mass").bounds[1] < 0.7 * heavy
    base = looked.begin()
    # While the areas may move, too, records hold what forces and flows are to each other.
    area = base.model.value("piston_area_a") / model.value("piston_area_a")
    assert base.model.value("moving_mass") == pytest.approx(area * heavy, rel=0.01)
    assert base.misfit.little


@pytest.mark.parametrize(
    ("effect", "values", "own"),
    [
        ("valve_deadband", {"width": 0.02}, True),
        ("backlash", {"mass": 1e-4, "gap": 2e-5, "frequency": 250.0}, False),
    ],
)
def test_what_is_left_where_an_effect_vanishes_says_whether_its_gain_is_its_own(
    model: Model, effect: str, values: dict, own: bool
) -> None:
    """A tenth of a gram behind a stiff contact changes nothing but the steps of the integrator."""
    looked = search(model, model.with_effect("valve_deadband", {"width": 0.02}) if own else model)
    after = looked.as_it_is(model.with_effect(effect, values))
    cost = looked.state(model).linearisation.point.cost if own else after.linearisation.point.cost + 50.0
    before = SimpleNamespace(linearisation=SimpleNamespace(point=SimpleNamespace(cost=cost)))
    assert borrowed(cast(SearchState, before), after, effect) is not own


def test_beside_rounding_the_gain_of_an_effect_is_its_own(model: Model) -> None:
    """Where the noise is that beside steps of the sensor, a model without them leaves the steps, whatever it has."""
    step, narrow = 1e-4, {"width": 0.0005}
    plant = model.with_effect("valve_deadband", narrow)
    looked = search(model, plant, step=step)
    rounded = model.with_effect("sensor_quantisation", {"step": step})
    full = rounded.with_effect("valve_deadband", narrow)
    looked.judged(looked.state(full))
    before, after = looked.state(rounded), looked.state(full)
    gained = before.misfit.total - after.misfit.total
    assert gained > CRITERIA.promises * before.misfit.least
    smooth = before.linearisation.point.cost - after.linearisation.point.cost
    assert smooth < CRITERIA.most_of * gained, "it shows less beside the steps"
    assert not borrowed(before, after, "valve_deadband")
