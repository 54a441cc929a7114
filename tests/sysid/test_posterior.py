"""How probable explanations are, by what they leave and what was set against them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.diagnosis.search.competing_models import CompetingModel
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA
from hydraulic_sysid.diagnosis.search.data_sheet import Deviation
from hydraulic_sysid.diagnosis.search.drift import Drift
from hydraulic_sysid.diagnosis.search.holdout import Split
from hydraulic_sysid.diagnosis.search.misfit import Misfit
from hydraulic_sysid.diagnosis.search.posterior import explanations, probability, sentence
from hydraulic_sysid.diagnosis.search.remainder import Remainder
from hydraulic_sysid.diagnosis.search.search_state import SearchResult, SearchState
from hydraulic_sysid.diagnosis.search.unknown_law import probability_of_unknown
from hydraulic_sysid.diagnosis.search.verdict import (
    COMPLETE,
    DATA_SHEET,
    INDISTINGUISHABLE,
    MISSING,
    OUTSIDE,
    UNDECIDED,
    Verdict,
    kind_of,
)
from hydraulic_sysid.estimation.fit import FitSettings


def left(mean_square: float) -> Misfit:
    return Misfit(2000.0 * mean_square, 1000.0 * mean_square, 2000, 1000, typical=mean_square)


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


def result(model: Model, before: float, after: float, *added: str) -> SearchResult:
    def state(mean_square: float) -> SearchState:
        return SearchState(model, cast(Any, SimpleNamespace(split=Split([], []))), left(mean_square), [])

    final = state(after)
    return SearchResult(
        model, Split([], []), FitSettings(), state(before), final, dict.fromkeys(added, final.misfit), {}
    )


def rival(model: Model, name: str, odds: float) -> CompetingModel:
    return CompetingModel(name, model, left(1.0), 0.0, odds, 1.0)


def verdict(kind: str, *added: str, family: tuple[str, ...] = (), rivals: tuple[CompetingModel, ...] = ()) -> Verdict:
    return Verdict(kind, added, {added[0]: rivals} if added else {}, {added[0]: family} if family else {})


def test_nothing_left_and_no_rival_is_twenty_to_one(model: Model) -> None:
    found = explanations(result(model, 4.0, 1.0, "valve_deadband"), verdict(MISSING, "valve_deadband"))
    named, unknown = found
    assert (named.effects, named.named, named.library) == (("valve_deadband",), True, True)
    assert unknown.effects == () and not unknown.named and not unknown.library
    assert named.probability / unknown.probability == pytest.approx(CRITERIA.odds)
    assert probability(found) == pytest.approx(CRITERIA.odds / (1.0 + CRITERIA.odds))
    assert sentence(found) == "The probability of this verdict is 95 %."


def test_what_is_left_speaks_for_a_law_that_the_library_lacks() -> None:
    levels = [probability_of_unknown(left(4.0), left(after)) for after in (0.98, 1.0, 1.05, 1.5, 3.9)]
    assert levels[0] == levels[1] == 1.0 / (1.0 + CRITERIA.odds)
    assert levels[1:] == sorted(levels[1:]) and levels[-1] > 0.9
    # Beside an effect that explains a hundred times as much, its own law leaves some of that.
    assert probability_of_unknown(left(400.0), left(1.05)) < probability_of_unknown(left(4.0), left(1.05))
    at = replace(CRITERIA, odds=1.0, noise_missed=0.5, unknown_laws=0.0)
    assert probability_of_unknown(left(2.0), left(1.5), at) == pytest.approx(2.0 / 3.0)


def test_rivals_take_their_share(model: Model) -> None:
    near, far = rival(model, "valve_gain_curve", 40.0), rival(model, "stribeck_friction", 8000.0)
    found = explanations(
        result(model, 4.0, 1.0, "valve_deadband"), verdict(MISSING, "valve_deadband", rivals=(near, far))
    )
    by_name = {e.effects: e.probability for e in found if e.library}
    assert by_name["valve_deadband",] / by_name["valve_gain_curve",] == pytest.approx(40.0)
    assert sum(e.probability for e in found) == pytest.approx(1.0)
    assert [e.probability for e in found] == sorted((e.probability for e in found), reverse=True)
    assert probability(found) == pytest.approx(by_name["valve_deadband",])


def test_a_tie_is_right_where_one_of_its_names_is(model: Model) -> None:
    said = verdict(INDISTINGUISHABLE, "sensor_lag", family=("command_delay",), rivals=(rival(model, "backlash", 1e3),))
    found = explanations(result(model, 4.0, 1.0, "sensor_lag"), said)
    named = [e for e in found if e.named]
    assert {e.effects for e in named} == {("sensor_lag",), ("command_delay",)}
    assert named[0].probability == named[1].probability
    assert 0.94 < cast(float, probability(found)) < CRITERIA.odds / (1.0 + CRITERIA.odds)


def test_of_two_effects_one_is_exchanged_at_a_time(model: Model) -> None:
    said = Verdict(MISSING, ["sensor_lag", "valve_deadband"], {"valve_deadband": [rival(model, "backlash", 100.0)]}, {})
    found = explanations(result(model, 9.0, 1.0, "sensor_lag", "valve_deadband"), said)
    assert ("sensor_lag", "backlash") in {e.effects for e in found}


def test_numbers_that_say_the_same_are_named_together(model: Model) -> None:
    other = Deviation("tank_pressure", 5e5, 6e5, 1e3, 100.0)
    moved = Deviation("supply_pressure", 14e6, 13.5e6, 1e4, 500.0, instead=("pressure_offset",), alternatives=(other,))
    found = explanations(replace(result(model, 4.0, 1.0), moved=(moved,)), verdict(DATA_SHEET))
    assert {(e.effects, e.numbers) for e in found if e.named} == {
        ((), ("supply_pressure",)), ((), ("tank_pressure",)), (("pressure_offset",), ())
    }  # fmt: skip
    assert probability(found) == pytest.approx(CRITERIA.odds / (1.0 + CRITERIA.odds))


def test_outside_the_library_is_that_none_of_these_is_right(model: Model) -> None:
    found = explanations(result(model, 60.0, 59.0, "constant_load"), verdict(OUTSIDE, "constant_load"))
    assert found[0].named and not found[0].library and not any(e.named for e in found[1:])
    assert sentence(found) == "The probability of this verdict is over 99 %."
    little = result(model, 1.2, 1.0)
    assert probability(explanations(little, verdict(OUTSIDE, "constant_load"))) == 0.5, "a law bent to its limits"
    drifting = replace(little, drift=Drift("viscous_friction.coefficient", 300.0, 100.0, 5.0, 0.3, 60.0))
    said = cast(float, probability(explanations(drifting, verdict(OUTSIDE))))
    assert said == pytest.approx(CRITERIA.odds / (1.0 + CRITERIA.odds))


@pytest.mark.parametrize(
    ("kind", "after"), [(UNDECIDED, 1.0), (COMPLETE, 2.0)], ids=["ended early", "more than noise, nothing to anybody"]
)
def test_no_probability_is_stated_where_it_says_nothing(model: Model, kind: str, after: float) -> None:
    ended = result(model, after, after)
    ended.__dict__["remainders"] = [Remainder("position", 1e-6, 1e-6, 1.0)]
    found = explanations(ended, verdict(kind))
    assert found == [] and probability(found) is None and sentence(found) == ""


def test_numbers_have_no_law_that_may_be_off(model: Model) -> None:
    """What they leave beyond the noise is missing, however much they explain; unless it is nothing to anybody."""
    number = Deviation("supply_pressure", 14e6, 13.5e6, 1e4, 500.0)

    def ended(after: float, beyond: float) -> SearchResult:
        found = replace(result(model, 100.0, after), moved=(number,))
        found.__dict__["remainders"] = [Remainder("position", beyond, 1e-4, 1.0)]
        return found

    much, unnoticed, nothing = ended(2.5, 0.1), ended(1.15, 0.002), ended(1.0, 0.0)
    assert [kind_of(found, tied=False) for found in (much, unnoticed, nothing)] == [OUTSIDE, DATA_SHEET, DATA_SHEET]
    assert cast(float, probability(explanations(much, verdict(DATA_SHEET)))) < 0.5
    assert cast(float, probability(explanations(nothing, verdict(DATA_SHEET)))) > 0.8
