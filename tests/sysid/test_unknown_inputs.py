"""Where something unknown acts is said by what any course there would explain, whatever law it follows."""

from __future__ import annotations

from dataclasses import replace
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
from hydraulic_sysid.diagnosis.search.unknown_inputs import UnknownInput, unknown_inputs
from hydraulic_sysid.diagnosis.search.whereabouts import Whereabouts

DT, SECONDS = 1e-3, 4.0
PLACES = ("unknown_force", "unknown_leakage", "unknown_opening", "unknown_reading", "unknown_supply")
NOISE = {"position": 1e-5, "pressure_a": 1e4, "pressure_b": 1e4}  # m, Pa


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


@pytest.mark.parametrize(
    ("place", "height", "subsystem"),
    [
        ("unknown_force", 400.0, "force"),
        ("unknown_supply", 8e5, "supply"),
        ("unknown_reading", 3e-4, "sensor"),
    ],
)
def test_an_input_that_follows_no_law_is_found_where_it_acts(
    model: Model, monkeypatch: pytest.MonkeyPatch, place: str, height: float, subsystem: str
) -> None:
    """It comes and goes every 0.19 s, which is no function of the motion."""
    some = tuple(f for f in FILES if f.stem in PLACES)  # each is compiled
    monkeypatch.setattr(nonparametric_curves, "FILES", some)
    extended = replace(model, user_effects=some, lean=True)
    over = extended.library[place].kernel.__globals__["VARIABLES"].index("time")
    course = {"over": float(over), "centre": 0.06, "width": 0.05, "period": 0.19, "height": height}
    t, rng = DT * np.arange(round(SECONDS / DT)), np.random.default_rng(4)
    drive = 2.5 * np.sin(2.0 * np.pi * (0.4 + 0.6 * t) * t)
    run = Plant(extended.with_effect(place, course)).simulate(drive, DT)
    channels = {c: np.asarray(getattr(run, c)) + rng.normal(0.0, s, t.size) for c, s in NOISE.items()}
    record = Record("disturbed", t, DT, {"drive": drive, **channels})
    found = unknown_inputs(Linearisation.of(model, split([record], [], model, 0.5)), lambda _: None)
    best = found[0]
    assert (best.subsystem, best.share > 0.9) == (subsystem, True), found


def test_of_the_position_alone_its_reading_explains_no_more_than_what_else_explains_most(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(nonparametric_curves, "FILES", tuple(f for f in FILES if f.stem in PLACES))
    t, rng = DT * np.arange(round(SECONDS / DT)), np.random.default_rng(4)
    drive = 2.5 * np.sin(2.0 * np.pi * (0.4 + 0.6 * t) * t)
    error = 3e-4 * np.sign(np.sin(2.0 * np.pi * 21.0 * t))
    position = np.asarray(Plant(model).simulate(drive, DT).position) + error + rng.normal(0.0, 1e-5, t.size)
    record = Record("alone", t, DT, {"drive": drive, "position": position})
    found = unknown_inputs(Linearisation.of(model, split([record], [], model, 0.5)), lambda _: None)
    shares = {u.place: u.share for u in found}
    assert shares["unknown_reading"] <= max(share for place, share in shares.items() if place != "unknown_reading")


def curve(place: str, subsystem: str, share: float) -> Any:
    summary = f"{place} of any shape"
    return SimpleNamespace(place=place, subsystem=subsystem, share=share, summary=summary, variable="time")


FORCE, READING, FLOW = curve("force", "force", 0.6), curve("reading", "sensor", 0.55), curve("flow", "flow", 0.35)


@pytest.mark.parametrize(
    ("bounds", "subsystem"),
    [
        ((0.9, 0.9, 0.9), "force"),  # anything may be anywhere: the best curve
        ((0.85, 0.95, 0.9), "sensor"),  # of those that explain nearly as much the one whose place may explain more
        ((0.5, 0.6, 0.95), "flow"),  # whatever acts at the other places, it leaves much
        ((), "force"),
    ],
)
def test_a_curve_is_believed_where_anything_may_explain_nearly_the_most(
    bounds: tuple[float, ...], subsystem: str
) -> None:
    curves = [FORCE, READING, FLOW]
    inputs = [UnknownInput(c.place, c.subsystem, c.summary, b) for c, b in zip(curves, bounds, strict=False)]
    where = Whereabouts.of(cast(Any, curves), sorted(inputs, key=lambda u: -u.share))
    assert where.subsystem == subsystem and len(where.curves) == 3
    assert {c.subsystem for c in where.as_likely(where.curves[0])} <= {"force", "sensor"} - {subsystem}


def test_among_curves_that_are_no_law_the_place_decides() -> None:
    curves = [curve("force", "force", 0.4), curve("reading", "sensor", 0.3), curve("flow", "flow", 0.1)]
    bounds = {"reading": 0.99, "flow": 0.98, "force": 0.93}
    inputs = [UnknownInput(place, place, place, bound) for place, bound in bounds.items()]
    assert Whereabouts.of(cast(Any, curves), inputs).subsystem == "sensor"


@pytest.mark.parametrize(
    ("share", "subsystem", "said"),
    [
        (0.97, "supply", "; a supply, of any course in time, would explain 97 %"),
        (0.3, "supply", "; a supply, of any course in time, would explain 30 %"),
        (0.1, "sensor", ": it may be in how the motion is read."),
    ],
)
def test_without_a_curve_any_course_says_where(share: float, subsystem: str, said: str) -> None:
    supply = UnknownInput("supply", "supply", "a supply of any shape", share)
    inputs = [supply, UnknownInput("force", "force", "a force of any shape", 0.05)]
    where = Whereabouts.of(cast(Any, [curve("force", "force", 0.05)]), inputs)
    assert where.subsystem == subsystem
    assert where.sentence(None).startswith(f"No curve at any place of the plant would explain 12 % of it{said}")
