"""A force that answers late, which no library has: proposed from records of an own simulation, joined, and tested."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_sim import registry
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.proposed_effect import propose
from hydraulic_sysid.diagnosis.search import add
from hydraulic_sysid.diagnosis.search.diagnosis import Remaining
from hydraulic_sysid.diagnosis.search.force_curves import Forces
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.estimation.fit import FitPoint, FitSettings, evaluate
from hydraulic_sysid.estimation.parameters import Parameters

MODEL = """format: hydraulic-model-1
name: late
description: a mass on viscous friction
plant: mechanical
parameters:
  moving_mass: {value: 5 kg, source: guess, bounds: [2 kg, 20 kg]}
  drive_force: {value: 1000 N/V, source: a force cell, fit: fixed}
  drive_limit: {value: 5 V, source: beyond the forces}
  stroke: {value: 1000 mm, source: longer than the motion}
effects:
  viscous_friction: {coefficient: {value: 3000 N*s/m, source: guess, bounds: [100 N*s/m, 2.0e+4 N*s/m]}}
history: []
"""
DT, SUBSTEPS = 1e-3, 50
MASS, VISCOUS, LEVEL, BEND, LAG = 8.0, 2500.0, 900.0, 0.1, 0.012
NOISE = 1e-6  # m
LIBRARY = ("end_stop", "viscous_friction", "position_loop", "command_delay")
SETTINGS = FitSettings(length=0.2)


def record(name: str, amplitude: float, hertz: float, seed: int, seconds: float = 3.0) -> Record:
    """m·ẍ = u − c·ẋ − L·tanh(z/b), ż = (ẋ − z)/τ, by small steps of Heun's method."""
    t = np.arange(0.0, seconds, DT)
    drive = amplitude * np.sin(2.0 * np.pi * hertz * t) * np.minimum(4.0 * t, 1.0)

    def rates(state, force):
        _, v, z = state
        return np.array([v, (force - VISCOUS * v - LEVEL * np.tanh(z / BEND)) / MASS, (v - z) / LAG])

    state, h, seen = np.zeros(3), DT / SUBSTEPS, np.empty(len(t))
    for k, force in enumerate(1e3 * drive):
        seen[k] = state[0]
        for _ in range(SUBSTEPS):
            first = rates(state, force)
            state = state + 0.5 * h * (first + rates(state + h * first, force))
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(t))
    return Record(name, t, DT, {"drive": drive, "position": seen + noise})


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return [record("slow", 1.4, 2.0, 1), record("fast", 1.9, 5.0, 2)]


@pytest.fixture(scope="module", autouse=True)
def small_library() -> Iterator[None]:
    """Compiled in a fraction of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "_BUILTIN", [registry.Library([registry.library().file(n) for n in LIBRARY])])
        yield


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    path = tmp_path_factory.mktemp("late") / "model.yaml"
    path.write_text(MODEL)
    return load_model(path)


@pytest.mark.thorough
@pytest.mark.timeout(300)
def test_a_force_that_answers_late_is_proposed_with_its_lag(model: Model, records: list[Record], tmp_path: Path):
    search = Search.of(model, records, (), SETTINGS, lambda _: None)
    found = propose(Remaining.of(search.begin().linearisation), "late", ["slow", "fast"])
    assert found is not None and (found.place, found.variable) == ("unknown_lagging_force", "lagged_velocity")
    assert found.share > 0.9
    shown = found.row  # as the page draws it
    assert shown["lag"] == pytest.approx(LAG, rel=0.1) and shown["unit"] == "N"
    assert np.ptp(shown["value"]) == pytest.approx(2.0 * LEVEL, rel=0.1)
    file = tmp_path / "late.py"
    file.write_text(found.text)
    test = [record("test", 2.4, 3.0, 3)]
    joined = add(model.with_effect_file(file), "late", records, test, settings=SETTINGS)
    residual = joined.result["residual"]
    assert residual["after"]["validation"] < 0.25 * residual["before"]["validation"], residual
    assert joined.model.value("late.lag") == pytest.approx(LAG, rel=0.1)


@pytest.mark.thorough
def test_forces_ask_for_the_values_beside_a_law(model: Model, records: list[Record], tmp_path: Path) -> None:
    """Friction without the law is far from what it is beside it, and nothing is simulated to see that."""
    file = tmp_path / "known.py"
    file.write_text(
        f'''"""The law that the records were made with."""
import math
from hydraulic_sim.effect import Effect, Parameter, State

def add(late, level):
    return -level * math.tanh(late / {BEND})

def follow(velocity):
    return 1.0 / {LAG}, velocity

EFFECT = Effect(
    slot="force", summary="late", kernel=add, dynamics=follow, states=(State("late", "m/s", kind="relaxation"),),
    parameters=(Parameter("level", "N", {LEVEL}, (0.0, 1e4), "level", "test", null=0.0),), equation="-", source="test",
    excited_by="-", confused_with=(), distinguished_by="-",
)
'''
    )
    segments = Search.of(model, records, (), SETTINGS, lambda _: None).split.segments
    free = Parameters.of(model, model.free_keys())
    bare = Forces.of(model, free, segments)
    beside = Forces.of(model.with_effect_file(file).with_effect("known"), free, segments)
    assert bare is not None and beside is not None
    assert beside.values["viscous_friction.coefficient"] == pytest.approx(VISCOUS, rel=0.03)
    assert bare.values["viscous_friction.coefficient"] > 1.5 * VISCOUS


def test_no_forces_where_the_model_does_not_run(
    model: Model, records: list[Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    def track(*_: Any) -> None:
        raise SimulationError("propagation along the record failed")

    segments = Search.of(model, records, (), SETTINGS, lambda _: None).split.segments
    monkeypatch.setattr(Plant, "track", track)
    assert Forces.of(model, Parameters.of(model, model.free_keys()), segments) is None


def test_a_fit_says_that_a_run_leaves_all_bounds(
    model: Model, records: list[Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FitPoint, "cost", np.inf)
    with pytest.raises(SimulationError, match="'late' leaves all bounds from where the records show its states"):
        evaluate(model, records, SETTINGS)


@pytest.mark.parametrize("effect", ["position_loop", "command_delay"])
def test_no_forces_where_the_drive_is_none(effect: str, model: Model, records: list[Record]) -> None:
    segments = Search.of(model, records, (), SETTINGS, lambda _: None).split.segments
    other = model.with_effect(effect)
    assert Forces.of(other, Parameters.of(model, model.free_keys()), segments) is None
