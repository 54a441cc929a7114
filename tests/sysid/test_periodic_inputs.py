"""What goes on whatever the drive does is told from what follows the motion."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search import nonparametric_curves
from hydraulic_sysid.diagnosis.search.holdout import split
from hydraulic_sysid.diagnosis.search.linearisation import Linearisation
from hydraulic_sysid.diagnosis.search.nonparametric import FILES
from hydraulic_sysid.diagnosis.search.periodic_inputs import PeriodicInput, periodic_inputs
from hydraulic_sysid.diagnosis.search.whereabouts import Whereabouts

DT, SECONDS = 1e-3, 6.0
PLACES = ("unknown_force", "unknown_leakage", "unknown_reading", "unknown_supply")
NOISE = {"position": 1e-5, "pressure_a": 1e4, "pressure_b": 1e4}  # m, Pa


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


def found(true: dict[float, Model], model: Model, monkeypatch: pytest.MonkeyPatch) -> list[PeriodicInput]:
    """Of one record per true model, whose key is what the drive begins with [Hz]."""
    monkeypatch.setattr(nonparametric_curves, "FILES", tuple(f for f in FILES if f.stem in PLACES))
    t, rng, records = DT * np.arange(round(SECONDS / DT)), np.random.default_rng(4), list[Record]()
    for begins, real in true.items():
        drive = 2.5 * np.sin(2.0 * np.pi * (begins + 0.3 * t) * t)
        run = Plant(real).simulate(drive, DT)
        channels = {c: np.asarray(getattr(run, c)) + rng.normal(0.0, s, t.size) for c, s in NOISE.items()}
        records.append(Record(f"from {begins} Hz", t, DT, {"drive": drive, **channels}))
    return periodic_inputs(Linearisation.of(model, split(records, [], model, 0.5)), lambda _: None)


def test_a_swing_is_found_with_its_place_frequency_and_size(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every record with a phase of its own."""
    swing = {"amplitude": 8e5, "frequency": 2.3}
    real = {f: model.with_effect("pump_ripple", swing | {"phase": phase}) for f, phase in ((0.4, 1.0), (0.7, -2.0))}
    best = found(real, model, monkeypatch)[0]
    assert best.subsystem == "supply" and best.share > 0.8
    assert best.frequency == pytest.approx(2.3, rel=0.02) and best.amplitude == pytest.approx(8e5, rel=0.15)


def test_what_follows_the_motion_does_not_swing_of_itself(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    real = dict.fromkeys((0.4, 0.7), model.with_effect("load_spring", {"stiffness": 2e4}))
    assert max(f.share for f in found(real, model, monkeypatch)) < 0.4


def swing(subsystem: str, share: float) -> PeriodicInput:
    return PeriodicInput(f"unknown_{subsystem}", subsystem, f"a {subsystem} of any shape", 1.75, 620.0, "N", share)


@pytest.mark.parametrize(("share", "curve", "swings"), [(0.9, 0.7, True), (0.4, 0.3, False), (0.6, 0.7, False)])
def test_a_swing_is_believed_where_it_explains_the_most_and_more_than_a_curve(
    share: float, curve: float, swings: bool
) -> None:
    curves = [SimpleNamespace(place="f", subsystem="flow", share=curve, summary="a leak of any shape", variable="time")]
    where = Whereabouts.of(cast(Any, curves), (), [swing("force", share), swing("supply", 0.95 * share)])
    assert where.subsystem == ("force" if swings else "flow")
    said = where.sentence(cast(Any, where.curves[0]))
    assert said.startswith("It looks like a force that swings at 1.75 Hz by about 0.62 kN, whatever") == swings
    assert ("; nearly as much: a supply (" in said) == swings
