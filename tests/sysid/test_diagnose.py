"""The parts of the diagnosis that can be tested apart; what it finds is tested in tests/hidden_effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.records.channels import CHAMBERS
from hydraulic_sysid.diagnosis.search import DiagnosisError, add, diagnose, uncertainty, verdict, worth
from hydraulic_sysid.diagnosis.search.candidate_fits import CandidateFits, varied
from hydraulic_sysid.diagnosis.search.candidates import RecordFeatures, between, candidates, inverse, probes
from hydraulic_sysid.diagnosis.search.competing_models import CompetingModel
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA
from hydraulic_sysid.diagnosis.search.data_sheet import Deviation, HeldNumbers, as_filed, relaxed
from hydraulic_sysid.diagnosis.search.drift import Drift
from hydraulic_sysid.diagnosis.search.drive_faults import BETWEEN_SAMPLES
from hydraulic_sysid.diagnosis.search.fitting import Fitting
from hydraulic_sysid.diagnosis.search.frozen_jacobian import Refit
from hydraulic_sysid.diagnosis.search.holdout import Split, split
from hydraulic_sysid.diagnosis.search.misfit import Misfit, explained, material, reduction
from hydraulic_sysid.diagnosis.search.nonparametric import FILES
from hydraulic_sysid.diagnosis.search.posterior import explanations, probability
from hydraulic_sysid.diagnosis.search.progress import OutOfTimeError, Progress
from hydraulic_sysid.diagnosis.search.recording_faults import HYPOTHESES, RecordingFault
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.search_state import CandidateRefit, SearchResult, SearchState, Together
from hydraulic_sysid.diagnosis.search.spectral_lines import spectral_lines
from hydraulic_sysid.diagnosis.search.uncertainty import Known, parameter_errors
from hydraulic_sysid.diagnosis.search.whereabouts import Whereabouts
from hydraulic_sysid.diagnosis.search.worth import (
    absorbs_discrepancy,
    decisive,
    near_competitors,
    nothing_gained,
    without_competitor,
)
from hydraulic_sysid.estimation.fit import FitSettings
from hydraulic_sysid.estimation.noise import code_step
from hydraulic_sysid.estimation.parameters import Parameters, bounded, scale
from hydraulic_sysid.estimation.segments import cut, segment_length

DT = 1e-3


def standing(seconds: float, name: str = "r") -> Record:
    """Nothing but noise."""
    n = round(seconds / DT)
    draw = np.random.default_rng(3)
    return Record.sampled(
        name,
        DT,
        {
            "drive": np.zeros(n),
            "position": 2e-5 * draw.standard_normal(n),
            "pressure_a": 7.15e6 + 1.5e4 * draw.standard_normal(n),
            "pressure_b": 7.15e6 + 1.5e4 * draw.standard_normal(n),
        },
    )


@pytest.fixture(scope="module")
def model():
    return load_model("sample_bench")


def test_every_third_block_validates_shifting_between_records(model) -> None:
    parts = split([standing(20.0, "a"), standing(20.0, "b")], [], model, 0.5)
    shares = [float(f.mean()) for f in parts.fit]
    assert all(0.6 <= s <= 0.72 for s in shares)
    assert not np.array_equal(parts.fit[0], parts.fit[1])
    assert [len(s) for s in parts.to_fit] == [int(f.sum()) for f in parts.fit]
    assert [r.name for r in parts.records()] == ["a", "b"] and parts.records(validation=True) == []


def test_named_records_are_for_validation_whole(model) -> None:
    parts = split([standing(5.0, "a")], [standing(5.0, "b")], model, 0.5)
    assert parts.fit[0].all() and not parts.fit[1].any()
    assert [s.record.name for s in parts.to_fit] == ["a"] == [r.name for r in parts.records()]
    assert [r.name for r in parts.records(validation=True)] == ["b"]


def test_candidates_are_the_library_without_what_is_on_or_cannot_act(model) -> None:
    names = {e.name for e in candidates(model)}
    acting = {e.name for e in model.library.values() if "hydraulic" in e.kinds and e.searched and not e.always_on}
    assert names == acting - set(model.effects)
    assert "load_dependent_friction" not in names and "payload" not in names
    assert not {"supply_droop"} & {e.name for e in candidates(model.with_effect("supply_droop"))}


def test_every_candidate_has_a_probe_off_its_null_value_within_bounds(model) -> None:
    for effect in candidates(model):
        groups = list(probes(effect, RecordFeatures(lines=(33.0,), resolution=1e-4)))
        assert groups, effect.name
        for group in groups:
            for probe in group:
                assert probe.values[probe.moved] != probe.null, effect.name
                for key, value in probe.values.items():
                    low, high = model.with_effect(effect.name).entry(key).bounds
                    assert low <= value <= high, key


def test_lines_are_tried_where_a_shape_is_a_frequency(model) -> None:
    ripple = model.library["pump_ripple"]
    tried = {p.values["pump_ripple.frequency"] for g in probes(ripple, RecordFeatures(lines=(33.0,))) for p in g}
    assert 33.0 in tried
    assert 33.0 not in {p.values["pump_ripple.frequency"] for g in probes(ripple, RecordFeatures()) for p in g}


def test_a_resonance_is_looked_for_much_damped_at_several_frequencies(model) -> None:
    for name, gaps in (("structural_flexibility", 1), ("backlash", 4)):
        effect = model.library[name]
        given = {p.name: p.default for p in effect.parameters}
        tried = [g[0].values for g in probes(effect, RecordFeatures())]
        wide = [v for v in tried if v[f"{name}.damping"] == pytest.approx(8.0 * given["damping"])]
        shares = {round(v[f"{name}.frequency"] / given["frequency"], 9) for v in wide}
        assert {0.25, 0.5, 1.0, 2.0, 4.0} <= shares
        assert len({v.get(f"{name}.gap") for v in wide}) == gaps


@pytest.mark.parametrize(
    ("name", "size", "unusual"),
    [
        ("position", -0.7e-3, True), ("position", -0.5e-3, False), ("drive", -1e-3, True),
        ("pressures", 0.7e-3, False), ("pressures", 1e-3, True), ("pressure_a_gain", 0.02, True),
    ],
)  # fmt: skip
def test_what_no_filter_makes_early_is_a_fault_sooner(name: str, size: float, unusual: bool) -> None:
    hypothesis = next(h for h in HYPOTHESES if h.name == name)
    assert RecordingFault(hypothesis, size, 1e-5, 100.0).unusual(1e-3) is unusual


@pytest.mark.parametrize("stroke", [0.1, 0.6, 1.5])
def test_lengths_are_tried_within_the_stroke(model, stroke: float) -> None:
    """Cushions that meet in the middle differ in nothing but their strength: from there no fit finds shorter ones."""
    key = "end_cushion.length"
    lengths = [g[0].values[key] for g in probes(model.library["end_cushion"], RecordFeatures(stroke=stroke))]
    assert max(lengths) < 0.5 * stroke
    assert len(set(lengths)) >= 2


@pytest.mark.parametrize("line", [7.0, 32.414, 180.3])
@pytest.mark.parametrize("reversals", [0.1, 0.46, 1.3])
def test_a_line_that_the_valve_modulates_is_found_between_side_bands(line: float, reversals: float) -> None:
    time = DT * np.arange(20001)
    drive = np.sign(np.sin(2.0 * np.pi * reversals * time))
    seen = drive * np.sin(2.0 * np.pi * line * time + 0.7) + np.random.default_rng(5).standard_normal(time.size)
    record = Record.sampled("r", DT, {"drive": drive, "position": np.zeros(time.size)})
    (segments,) = cut([record], "mechanical", 0.5)
    index = segments.first[:, None] + np.arange(segments.samples)
    residual = np.concatenate([seen[index], np.zeros((len(segments), 2))], axis=1)
    assert spectral_lines([segments], [residual])[0] == pytest.approx(line, abs=0.01)


def test_a_line_too_weak_in_each_record_shows_in_all_together() -> None:
    time, noise = DT * np.arange(10001), np.random.default_rng(5)
    every = []
    for _ in range(6):
        seen = 0.06 * np.sin(2.0 * np.pi * 167.7 * time) + noise.standard_normal(time.size)
        record = Record.sampled("r", DT, {"drive": np.ones(time.size), "position": np.zeros(time.size)})
        (segments,) = cut([record], "mechanical", 0.5)
        index = segments.first[:, None] + np.arange(segments.samples)
        every.append((segments, np.concatenate([seen[index], np.zeros((len(segments), 2))], axis=1)))
    assert not any(spectral_lines([segments], [residual]) for segments, residual in every)
    assert spectral_lines(*map(list, zip(*every, strict=True))) == pytest.approx((167.7,), abs=0.03)


def test_an_angle_is_tried_with_every_frequency(model) -> None:
    tried = [group[0].values for group in probes(model.library["pump_ripple"], RecordFeatures(lines=(31.0,)))]
    angles = {v["pump_ripple.phase"] for v in tried if v["pump_ripple.frequency"] == 31.0}
    assert len(angles) == 4 and max(angles) == pytest.approx(1.5 * np.pi)


def test_a_parameter_whose_value_and_default_are_zero_has_a_scale(model) -> None:
    with_ripple = model.with_effect("pump_ripple")
    assert scale(with_ripple, "pump_ripple.phase") == pytest.approx(0.14)
    assert scale(with_ripple, "pump_ripple.amplitude") == with_ripple.value("pump_ripple.amplitude")


def state(model, total: float, refits: dict[str, float]) -> SearchState:
    """A state with that sum of squares, and those of its refits."""
    found = [CandidateRefit(name, None, at(left)) for name, left in refits.items()]  # type: ignore[arg-type]
    nowhere = SimpleNamespace(split=Split([], []), parameters=Parameters.unbounded(np.zeros(0)), model=model)
    return SearchState(model, nowhere, at(total), [], found)  # type: ignore[arg-type]


def noisy(noise: float) -> Split:
    """A record whose one channel has that noise."""
    return Split([SimpleNamespace(noise=[SimpleNamespace(innovation=noise)], loudness=np.ones((3, 1)))], [])  # type: ignore[list-item]


def as_recorded(model, total: float, noise: float | None = None) -> SearchState:
    """A state with that sum of squares over that noise (None: of no record at all)."""
    judged = Split([], []) if noise is None else noisy(noise)
    return replace(state(model, total, {}), linearisation=SimpleNamespace(split=judged))  # type: ignore[arg-type]


def at(total: float) -> Misfit:
    return Misfit(2.0 * total / 3.0, total / 3.0, 2000, 1000, typical=total / 3000)


@pytest.mark.parametrize(("variance", "promised"), [(3.9, 0.5), (4.1, 0.0)])
def test_a_first_effect_need_not_show_in_a_quick_refit_where_the_model_is_far_off(
    model, variance: float, promised: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a strong offset of the position the best of six refits explained 5 %, and a fit nearly all."""
    search = Search.__new__(Search)
    monkeypatch.setattr(search, "_first_effect", (None, None), raising=False)
    monkeypatch.setattr(search, "finish", lambda base, enough, promised: promised, raising=False)
    assert search.first_effect(state(model, variance * 3000, {})) == promised


class SameSplit(list):
    """A split that is judged by nothing new."""

    def judged(self, *_: Any) -> SameSplit:
        return self


@pytest.mark.parametrize(
    ("left", "fits"), [([2.05, 1.99, 1.92, 1.99, 1.9], 3), ([1.5, 1.4, 1.3, 1.2, 1.1, 1.0, 0.9], 6)]
)
def test_delays_are_asked_again_while_that_lowers_what_is_left(
    left: list[float], fits: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where an effect is missing they go to and fro, and what is left with them."""
    point = SimpleNamespace(point=None, columns=[])
    begin, *states = [
        SimpleNamespace(misfit=SimpleNamespace(variance=v), linearisation=point, model=None) for v in left
    ]
    fitting, done = Fitting.__new__(Fitting), list[Any]()
    fitting.say, fitting.split = Progress(lambda _: None), SameSplit()
    stubs = {"_first": FitSettings(), "_last": FitSettings(), "_laws": lambda *_: []}
    for name, stub in {**stubs, "state": lambda *_: done.append(states[len(done)]) or done[-1]}.items():
        monkeypatch.setattr(fitting, name, stub, raising=False)
    place = "hydraulic_sysid.diagnosis.search.fitting"
    for name, answer in (("refined", []), ("ordinary", []), ("quieter", False), ("retimed", True)):
        monkeypatch.setattr(f"{place}.{name}", lambda *_, answer=answer: answer)
    fitting.judged(begin)
    assert len(done) == fits


@pytest.mark.parametrize(("share", "named"), [(0.3, 2), (0.5, 1)])
def test_a_further_effect_that_a_curve_beats_is_none(
    model, share: float, named: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second one explains 29 % of what the first leaves; a fault of the recording is asked for as much as it is."""
    first = model.with_effect("valve_deadband")
    one, two = state(first, 20000.0, {}), state(first.with_effect("load_spring"), 15000.0, {})
    found, asked = iter([two, None]), []
    search = Search.__new__(Search)
    search.say, search.split, search.given = Progress(lambda _: None), Split([], []), model
    search.settings, search.faults, search.as_recorded = FitSettings(), [], None
    stubs = {
        "shared_out": lambda state: False,
        "first_effect": lambda base: one,
        "finish": lambda base, enough: next(found),
        "fault_beside": lambda base, state, further, share: asked.append(share),
        "explore": lambda state, most: state,
        "reviewed": lambda base, final, added, competing: (final, added, competing),
        "finish_two": lambda *_: [],
        **{name: lambda *_: None for name in ("loose", "judged_anew", "leads_elsewhere", "nothing_left")},
    }
    for name, stub in {**stubs, "_curves": None, "_shared_beside": False}.items():
        monkeypatch.setattr(search, name, stub, raising=False)
    place, times = "hydraulic_sysid.diagnosis.search.search", list[str]()
    # A curve over the time is the shape of no law.
    curves = [SimpleNamespace(share=0.9, variable="time"), SimpleNamespace(share=share, variable="opening")]
    monkeypatch.setattr(f"{place}.borrowed", lambda *_: False)
    monkeypatch.setattr(f"{place}.nonparametric_curves", lambda *_: times.append("taken") or curves)
    done = search.forward(state(model, 60000.0, {}))
    assert done.added == ["valve_deadband", "load_spring"][:named]
    assert asked[0] == pytest.approx(CRITERIA.nearly * share)
    assert search.curves(one, lambda _: None) is curves and times == ["taken"], "those of a state are taken once"


@pytest.mark.parametrize(
    ("asked", "beside", "together", "named"),
    [
        ("alike in all segments", True, 4000.0, True),
        ("alike in all segments", False, 4000.0, False),
        ("alike in all segments", True, 20000.0, False),  # that is not nearly all
        ("a good part", True, 4000.0, True),
    ],
)
def test_two_effects_that_hide_each_other_are_named_if_each_is_more_than_chance_beside_the_other(
    model, asked: str, beside: bool, together: float, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Alone each explains a part, but not alike in all segments, or it explains too little."""
    one, other, both = ("valve_deadband",), ("load_spring",), ("valve_deadband", "load_spring")
    left = {(): 60000.0, one: 54000.0, other: 56000.0, both: together}

    def fitted(model: Model, *_: object) -> SearchState:
        return state(model, left[tuple(e for e in both if e in model.effects)], {})

    def tried(base: SearchState) -> list[CandidateRefit]:
        free = [e for e in both if e not in base.model.effects]
        fits = [(name, fitted(base.model.with_effect(name))) for name in free]
        return [CandidateRefit(name, Refit(s.model, []), s.misfit) for name, s in fits]

    def explored(base: SearchState, most: int = 0) -> SearchState:
        return replace(base, refits=tried(base))

    def better(before: SearchState, after: SearchState) -> bool:
        alone = not {*both} & {*before.model.effects}
        return asked == "a good part" if alone else beside or both[0] in before.model.effects

    def enough(name: str, after: Misfit, part: float) -> bool:
        return asked != "a good part" or after.total < 60000.0 - 10000.0 * part

    search = Search.__new__(Search)
    search.say, search.split, search.given, search.quick = Progress(lambda _: None), Split([], []), model, False
    search.settings, search.faults, search.as_recorded = FitSettings(), [], None
    stubs = {
        "state": fitted, "explore": explored, "better": better, "begun_anew": lambda state: state,
        "set_against_others": lambda base, near: near, "with_freedom": lambda state: state.misfit.total,
        "first_effect": lambda base: search.finish(base, enough), "share_of_a_curve": lambda *_: 0.0,
        "reviewed": lambda base, final, added, competing: (final, added, competing),
        **{name: lambda *_: None for name in ("loose", "judged_anew", "leads_elsewhere", "nothing_left")},
        "fault_beside": lambda *_: None, "_last": None, "shared_out": lambda state: False,
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(search, name, stub, raising=False)
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.search.borrowed", lambda *_: False)
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.search.enough_at_first", lambda base, *given: enough(*given))
    done = search.forward(explored(fitted(model)))
    assert done.added == (list(both) if named else [])
    assert list(done.misfits) == done.added
    search.quick = True
    assert search.forward(explored(fitted(model))).added == [], "a quick search leaves that out"


@pytest.mark.parametrize("first", [True, False])
def test_what_is_left_beside_an_effect_in_one_role_alone_is_shared_out_once(
    model, first: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That may be the second effect, or a first one beside which nearly all that is left was not fitted."""
    one, two = state(model.with_effect("valve_deadband"), 20000.0, {}), state(model, 9000.0, {})
    two = replace(two, model=one.model.with_effect("load_spring"))
    search, asked, again = Search.__new__(Search), list[SearchState](), list[object]()
    search.say, search.split, search.given = Progress(lambda _: None), Split([], []), model

    def shared_out(state: SearchState) -> bool:
        asked.append(state)
        return state is (one if first else two)

    anew = [state(m, 1.0, {}) for m in (model, one.model)]
    stubs = {
        "first_effect": lambda base: one, "finish": lambda base, enough: two, "explore": lambda state, most: state,
        "shared_out": shared_out, "_shared_beside": False, "_last": None, "_curves": None,
        "state": lambda model, settings: anew[0] if model is base.model else anew[1],
        "recorded": lambda state: again.append(state) or state,
        "onward": lambda base, model, known: again.append(known) or "onward",
        **{name: lambda *_: None for name in ("loose", "judged_anew", "leads_elsewhere", "nothing_left")},
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(search, name, stub, raising=False)
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.search.borrowed", lambda *_: False)
    base = state(model, 60000.0, {})
    assert search.forward(base) == "onward"
    assert again == [anew[1]], "what was found first stays, fitted anew"
    assert asked == ([one] if first else [one, two])
    asked.clear()

    def goes_on(*_: object) -> float:
        raise LookupError

    monkeypatch.setattr(search, "share_of_a_curve", goes_on, raising=False)
    with pytest.raises(LookupError):
        search.forward(base)
    assert asked == [], "once"


def test_roles_are_not_shared_out_anew_beside_an_effect_that_leaves_nothing(
    model, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, asked = Search.__new__(Search), list[SearchState]()
    one, base = state(model.with_effect("valve_deadband"), 9000.0, {}), state(model, 60000.0, {})
    monkeypatch.setattr(search, "_shared_beside", False, raising=False)
    monkeypatch.setattr(search, "shared_out", lambda state: asked.append(state))
    for left in (3012.0, 3024.0):
        two = replace(state(model, left, {}), model=one.model.with_effect("sensor_quantisation"))
        assert search.begun_elsewhere(base, one, two, True) is None
    assert [round(s.misfit.total) for s in asked] == [3024]


@pytest.mark.parametrize("lower", [True, False])
def test_a_model_that_a_fit_with_an_effect_led_out_of_a_local_minimum_is_searched_anew(
    model, lower: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is left where the effect vanishes is hardly more."""
    base, found = state(model, 99000.0, {}), iter([state(model.with_effect("entrained_air"), 62000.0, {}), None])
    plain = state(model, 63000.0 if lower else 98990.0, {})
    search = Search.__new__(Search)
    search.say, search.split, search.given = Progress(lambda _: None), Split([], []), model
    search.settings, search.faults, search.as_recorded = FitSettings(), [], None
    seen: list[SearchState] = []
    stubs = {
        "state": lambda *_: plain, "first_effect": lambda base: next(found), "finish_two": lambda *_: [],
        "recorded": lambda state: seen.append(state) or state, "leads_elsewhere": lambda *_: False, "_last": None,
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(search, name, stub, raising=False)
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.search.borrowed", lambda *_: True)
    done = search.forward(base)
    assert done.base is (plain if lower else base)
    assert seen == [plain] * lower
    assert done.added == []


def test_a_quick_search_tries_one_effect_in_the_place_of_several_numbers_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def concluded(found: SearchResult, others: bool = True) -> None:
        raise LookupError("with others" if others else "without")

    search = Search.__new__(Search)
    search.quick = True
    stubs = {"searched": lambda: None, "rivals_begun_anew": lambda found: found, "concluded": concluded}
    for name, stub in stubs.items():
        monkeypatch.setattr(search, name, stub, raising=False)
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.search.decisive", lambda found: found)
    with pytest.raises(LookupError, match="with others"):
        search.run()


@pytest.mark.parametrize(
    ("before", "left", "numbers", "sheet"),
    [
        (900000.0, 20000.0, 1, False),  # it leaves clearly less
        (900000.0, 40000.0, 3, True),
        (900000.0, 29900.0, 1, True),  # … or less by what laws are right to: one number is likelier than an effect
        (900000.0, 29900.0, 2, False),  # of one parameter, and two are not
        (900000.0, 30100.0, 2, False),
        (40000.0, 30200.0, 1, True),  # … or by less than what counts
        (40000.0, 30200.0, 2, False),
        (40000.0, 30300.0, 2, True),
    ],
)
def test_of_an_effect_and_other_numbers_that_leave_as_much_the_fewer_are_taken(
    model, before: float, left: float, numbers: int, sheet: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, loose = state(model, before, {}), state(model, 30000.0, {})
    asked: list[float] = []
    fits = object.__new__(Search)
    moved = [SimpleNamespace(key=str(i)) for i in range(numbers)]
    monkeypatch.setattr(Search, "fewest_moved", lambda self, *given: asked.append(given[2]) or (loose, moved))
    monkeypatch.setattr(fits, "_last", None, raising=False)
    monkeypatch.setattr(Search, "state", lambda self, *_: loose)
    assert fits.sheet_instead(base, state(model.with_effect("constant_load"), left, {}), loose) is sheet
    least = max(CRITERIA.law_elsewhere * (before - 30000.0), at(left).least)
    assert asked == [pytest.approx(least)] * (abs(left - 30000.0) < least)


@pytest.mark.parametrize(("again", "sheet"), [(29100.0, True), (29900.0, False)])
def test_other_numbers_that_are_a_little_behind_are_fitted_once_more(
    model, again: float, sheet: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All numbers of a sheet say much the same, and a fit along that goes on for long."""
    fits, base = object.__new__(Search), state(model, 900000.0, {})
    loose, better = state(model, 30000.0, {}), state(model.with_effect("constant_load"), 29000.0, {})
    monkeypatch.setattr(fits, "_last", None, raising=False)
    monkeypatch.setattr(Search, "state", lambda self, *_: state(model, again, {}))
    monkeypatch.setattr(Search, "fewest_moved", lambda self, final, *_: (final, [None]))
    assert fits.sheet_instead(base, better, loose) is sheet


@pytest.mark.parametrize("wrong", [True, False])
def test_other_numbers_are_tried_against_a_further_effect_that_leaves_nothing_too(
    model, wrong: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Records of the position alone have no other way to tell a load from wrong areas."""
    one, two = state(model.with_effect("valve_hysteresis"), 14000.0, {}), state(model, 1000.0, {})
    two, loose = replace(two, model=one.model.with_effect("constant_load")), state(one.model, 1000.0, {})
    search, found = Search.__new__(Search), iter([two, None])
    search.say, search.split, search.given = Progress(lambda _: None), Split([], []), model
    search.settings, search.faults, search.as_recorded, search.quick = FitSettings(), [], None, False
    stubs = {
        "first_effect": lambda base: one, "finish": lambda base, enough: next(found),
        "explore": lambda state, most: state, "loose": lambda state: loose, "judged": lambda state: state,
        "sheet_instead": lambda *given: given[1:] == (two, loose) and wrong,
        "onward": lambda base, model, known: known, "share_of_a_curve": lambda *_: 0.0,
        "nothing_left": lambda state: state is two, "reviewed": lambda base, final, added, known: (final, added, known),
        **{name: lambda *_: None for name in ("begun_elsewhere", "judged_anew", "fault_beside")},
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(search, name, stub, raising=False)
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.search.borrowed", lambda *_: False)
    done = search.forward(state(model, 60000.0, {}))
    assert done is loose if wrong else list(done.misfits) == ["valve_hysteresis", "constant_load"]


@pytest.mark.parametrize(
    ("name", "left", "absorbs"),
    [
        ("valve_underlap", 4000.0, True),  # of the valve's own, repairs a thousandth of all
        ("valve_underlap", 3000.0, False),  # … and three thousandths
        ("constant_load", 4500.0, False),  # elsewhere a thousandth is enough
        ("constant_load", 5300.0, True),
        ("constant_load", 3050.0, False),  # and most of what is left always is
    ],
)
def test_what_a_law_leaves_is_no_effect(model, name: str, left: float, absorbs: bool) -> None:
    base, before = state(model, 1.0e6, {}), state(model, 5500.0, {})
    assert absorbs_discrepancy(base, before, ["valve_deadband"], name, at(left)) is absorbs


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (1.39, 1.12, verdict.MISSING),  # near the noise a law may leave more …
        (1.39, 1.19, verdict.OUTSIDE),  # … but not all it likes
        (10.0, 3.3, verdict.OUTSIDE),
        (10.0, 2.5, verdict.OUTSIDE),
        (10.0, 1.7, verdict.OUTSIDE),  # more probably a law that the library lacks
        (10.0, 1.3, verdict.MISSING),
    ],
)
def test_what_an_effect_leaves_decides_whether_it_is_the_one(model, before: float, after: float, kind: str) -> None:
    with_it = model.with_effect("constant_load")
    base, final = state(model, 3000 * before, {}), state(with_it, 3000 * after, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    assert verdict.kind_of(found, tied=False) == kind


@pytest.mark.parametrize(
    ("share", "kind"),
    [
        (None, verdict.OUTSIDE),  # there are no curves: nothing is known of it
        (0.15, verdict.OUTSIDE),  # a law at some place explains part of what is left
        (0.05, verdict.MISSING),  # none does: the effect's law is not quite the bench's
    ],
)
def test_what_no_curve_explains_is_no_other_effect(model, share: float | None, kind: str) -> None:
    base, final = state(model, 30000.0, {}), state(model.with_effect("constant_load"), 12000.0, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    curves = [] if share is None else [SimpleNamespace(share=share)]
    assert verdict.kind_of(found, tied=False, where=Whereabouts(curves)) == kind


@pytest.mark.parametrize(
    ("before", "after", "share", "kind"),
    [
        (10.0, 1.3, 0.7, verdict.OUTSIDE),
        (10.0, 1.3, 0.3, verdict.MISSING),  # what follows the motion is no sine
        (10.0, 1.02, 0.9, verdict.MISSING),  # nothing is left
        (150.0, 1.1, 0.9, verdict.MISSING),  # … that is more than the laws of what was found leave
    ],
)
def test_what_swings_of_itself_is_outside_the_library(
    model, before: float, after: float, share: float, kind: str
) -> None:
    base, final = state(model, 3000 * before, {}), state(model.with_effect("constant_load"), 3000 * after, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    where = Whereabouts(sines=[SimpleNamespace(share=share)])
    assert verdict.kind_of(found, tied=False, where=where) == kind
    judged = verdict.reviewed(verdict.Verdict(verdict.COMPLETE, found.added, {}, {}), found, where)
    sure = probability(explanations(found, judged))
    assert judged.periodic == (kind == verdict.OUTSIDE)
    assert sure is not None and (not judged.periodic or sure > 0.94)


@pytest.mark.parametrize(
    ("share", "said"), [(0.34, "like a leak over time, which would explain 34 %"), (0.04, "No curve at any place")]
)
def test_a_curve_that_explains_nothing_is_not_what_it_looks_like(model, share: float, said: str) -> None:
    base = state(model, 30000.0, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, base, {}, {})
    curve = SimpleNamespace(summary="a leak", variable="time", share=share, subsystem="flow")
    outside = verdict.Verdict(verdict.OUTSIDE, [], {}, {})
    assert said in verdict.sentences(found, outside, Whereabouts([curve]))
    where = "flow" if share > 0.3 else "sensor"  # what acts in a plant is smoothed on its way to the position
    assert verdict.place(found, outside, Whereabouts([curve])) == where


@pytest.mark.parametrize(
    ("share", "said"), [(0.32, "; nearly as much: a valve over opening (32 %)."), (0.2, "of it. ")]
)
def test_other_places_that_explain_nearly_as_much_are_named(model, share: float, said: str) -> None:
    base = state(model, 30000.0, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, base, {}, {})
    flow = [SimpleNamespace(summary="a leak", variable=v, share=0.34, subsystem="flow") for v in ("time", "speed")]
    valve = SimpleNamespace(summary="a valve", variable="opening", share=share, subsystem="valve")
    text = verdict.sentences(found, verdict.Verdict(verdict.OUTSIDE, [], {}, {}), Whereabouts([*flow, valve])) + " "
    assert f"a leak over time, which would explain 34 % of it{said if said[0] == ';' else '. '}" in text


@pytest.mark.parametrize(("after", "said"), [(12000.0, "residual falls from"), (36000.0, "residual goes from")])
def test_what_rises_is_not_said_to_fall(model, after: float, said: str) -> None:
    base, final = state(model, 30000.0, {}), state(model.with_effect("constant_load"), after, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    judged = verdict.Verdict(verdict.OUTSIDE, ["constant_load"], {}, {})
    assert said in verdict.sentences(found, judged, Whereabouts())


@pytest.mark.parametrize(
    ("after", "share", "kind"),
    [
        (20.0, 0.6, verdict.OUTSIDE),  # far more than noise, most of which a law at some place explains
        (20.0, 0.4, verdict.MISSING),
        (5.0, 0.6, verdict.MISSING),  # so much the laws of effects that are there leave
    ],
)
def test_an_effect_that_explains_nearly_all_may_leave_another(model, after: float, share: float, kind: str) -> None:
    base, final = state(model, 3000 * 5000.0, {}), state(model.with_effect("constant_load"), 3000 * after, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    assert verdict.kind_of(found, tied=False) == verdict.MISSING
    assert verdict.kind_of(found, tied=False, where=Whereabouts([SimpleNamespace(share=share)])) == kind


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (23.0, 2.3, verdict.RECORDING),
        (1.25, 1.18, verdict.OUTSIDE),  # disturbances of a drive take up a part of anything
        (30.0, 9.0, verdict.OUTSIDE),  # and what is far off is not theirs
    ],
)
def test_an_unknown_drive_is_blamed_for_what_it_explains(model, before: float, after: float, kind: str) -> None:
    base = state(model, 3000 * after, {})
    fault = RecordingFault(BETWEEN_SAMPLES, 1e-3, 0.0, 1000.0)
    found = SearchResult(
        model, Split([], []), FitSettings(), base, base, {}, {}, faults=[fault],
        as_recorded=state(model, 3000 * before, {}),
    )  # fmt: skip
    assert verdict.kind_of(found, tied=False) == kind


@pytest.mark.parametrize(
    ("share", "left", "explained", "begins"),
    [
        (0.05, 3000.0, 60.0, "Missing: "),
        (0.3, 3000.0, 60.0, "Outside the library: coulomb_friction"),
        (0.3, 6000.0, 1000.0, "Outside the library: coulomb_friction"),
        (0.3, 6000.0, 500.0, "Outside the library: no effect of it explains what is left"),
    ],
    ids=["small", "all that is left", "a third of what is left", "little of what is left"],
)
def test_beside_an_effect_a_change_that_is_small_or_explains_little_is_a_detail(
    model, share: float, left: float, explained: float, begins: str
) -> None:
    base, final = state(model, 12000.0, {}), state(model.with_effect("constant_load"), left, {})
    found = SearchResult(
        model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {},
        drift=Drift("coulomb_friction.level", 450.0, 450.0 * share, 2.0, share, explained),
    )  # fmt: skip
    judged = verdict.judge(found)
    said = verdict.sentences(found, judged, Whereabouts())
    assert said.startswith(begins)
    assert said.count("coulomb_friction.level changes along the records") == 1
    assert verdict.place(found, judged, Whereabouts()) == (None if explained == 500.0 else "force")


@pytest.mark.parametrize(
    ("best", "own", "place"),
    [
        (0.98, 0.67, "sensor"),  # its zero drifts, which friction follows as far as it can
        (0.98, 0.95, "force"),  # either may be
        (0.4, 0.1, "force"),  # the curves know little
    ],
)
def test_what_drifts_is_where_a_curve_explains_it_better(model, best: float, own: float, place: str) -> None:
    base = state(model, 6000.0, {})
    drift = Drift("coulomb_friction.level", 450.0, 135.0, 2.0, 0.3, 2000.0)
    found = SearchResult(model, Split([], []), FitSettings(), base, base, {}, {}, drift=drift)
    curves = [
        SimpleNamespace(summary="an error of the position sensor", subsystem="sensor", variable="time", share=best),
        SimpleNamespace(summary="dry friction", subsystem="force", variable="time", share=own),
    ]
    judged = verdict.judge(found)
    assert judged.kind == verdict.OUTSIDE and verdict.place(found, judged, Whereabouts(curves)) == place
    looks = "It looks more like an error of the position sensor over time, which would explain 98 % of it."
    assert (looks in verdict.sentences(found, judged, Whereabouts(curves))) == (place == "sensor")


@pytest.mark.parametrize(
    ("damping", "tied", "kind"),
    [
        (0.2, False, verdict.MISSING),
        (1.0, False, verdict.OUTSIDE),  # nothing swings: a law of another kind is imitated
        (1.0, True, verdict.INDISTINGUISHABLE),  # another effect does as well without being bent
        (0.0, False, verdict.MISSING),  # a shape that vanishes is a simpler law
    ],
)
def test_a_law_that_fits_only_bent_to_its_limits_is_not_named(model, damping: float, tied: bool, kind: str) -> None:
    values = {"mass": 50.0, "frequency": 20.0, "damping": damping}
    base, final = state(model, 6000.0, {}), state(model.with_effect("structural_flexibility", values), 3000.0, {})
    misfits = {"structural_flexibility": final.misfit}
    found = SearchResult(model, Split([], []), FitSettings(), base, final, misfits, {})
    assert verdict.kind_of(found, tied=tied) == kind


def test_no_further_effect_is_named_on_whose_size_segments_disagree(model, monkeypatch: pytest.MonkeyPatch) -> None:
    first, both = model.with_effect("valve_deadband"), model.with_effect("valve_deadband").with_effect("sensor_lag")
    base, one, final = state(model, 60000.0, {}), state(first, 20000.0, {}), state(both, 3100.0, {})
    misfits = {"valve_deadband": one.misfit, "sensor_lag": final.misfit}
    found = SearchResult(model, Split([], []), FitSettings(), base, final, misfits, {"sensor_lag": one})
    assert decisive(found).added == ["valve_deadband", "sensor_lag"]
    monkeypatch.setattr(worth, "may_be_nothing", lambda at, effect: effect.name == "sensor_lag")
    assert decisive(found).added == ["valve_deadband"] and decisive(found).final is one


@pytest.mark.parametrize(
    ("half_width", "at_bound", "nothing"),
    [
        (283.0, None, True),  # of 256 kg: an interval from -27 to 539
        (100.0, None, False),
        (np.inf, None, True),  # the records do not determine it
        (np.inf, "highest", False),
    ],
)
def test_an_interval_that_holds_nothing(
    model, half_width: float, at_bound: str | None, nothing: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_it = model.with_effect("structural_flexibility", {"mass": 256.0})
    known = {
        "structural_flexibility.mass": Known(0.5 * half_width, half_width, at_bound),
        "structural_flexibility.damping": Known(0.1, 0.2, None),  # a shape has no size
    }
    monkeypatch.setattr(uncertainty, "parameter_errors", lambda at, shared: known)
    at: Any = SimpleNamespace(model=with_it)
    assert uncertainty.may_be_nothing(at, with_it.library["structural_flexibility"]) is nothing


def test_what_is_named_is_how_large_effects_are(model) -> None:
    """Their intervals are sought by fits; those of shapes are not."""
    final = state(model.with_effect("entrained_air", {"fraction": 0.04, "exponent": 1.2}), 3000.0, {})
    base = state(model, 8000.0, {})
    result = SearchResult(model, Split([], []), FitSettings(), base, final, {"entrained_air": final.misfit}, {})
    assert result.named == ["entrained_air.fraction"]


@pytest.mark.parametrize("exponent", [1.2, 1.4])
def test_a_shape_that_is_usually_at_its_limit_is_not_bent(model, exponent: float) -> None:
    """Air that is compressed in no time is adiabatic."""
    found = model.with_effect("entrained_air", {"fraction": 0.04, "exponent": exponent})
    base, final = state(model, 8000.0, {}), state(found, 3000.0, {})
    result = SearchResult(model, Split([], []), FitSettings(), base, final, {"entrained_air": final.misfit}, {})
    assert verdict.kind_of(result, tied=False) == verdict.MISSING


@pytest.mark.parametrize(
    ("own", "other", "near"),
    [
        (3000.0, 3150.0, False),  # beyond two hundredths of what the effect explains
        (3000.0, 3050.0, True),
        (3100.0, 3150.0, True),  # the quick refit of the effect itself stopped as short
        (3100.0, 3250.0, False),
    ],
)
def test_a_quick_refit_is_judged_by_that_of_the_effect_itself(model, own: float, other: float, near: bool) -> None:
    base, final = state(model, 6000.0, {}), state(model.with_effect("command_delay"), 3000.0, {})
    without = state(model, 6000.0, {"command_delay": own, "spool_dynamics": other})
    found = near_competitors(base, without, final, "command_delay").refits
    assert [r.name for r in found] == ["spool_dynamics"] * near


@pytest.mark.parametrize(("explained", "simpler"), [(0.0, False), (5e6, True)])
def test_beside_what_explains_much_a_parameter_must_explain_more(model, explained: float, simpler: bool) -> None:
    """Of two effects that leave 100 more or less; what laws found before are off is 0.0005 of what they explain."""
    search = CandidateFits.__new__(CandidateFits)
    search.path = [state(model, 3000.0 + explained, {}), state(model, 3000.0, {})]
    few, many = (replace(state(model, left, {}), linearisation=SimpleNamespace(parameters=range(n)))
                 for left, n in ((2500.0, 5), (2400.0, 7)))  # fmt: skip
    assert (search.with_freedom(few) < search.with_freedom(many)) is simpler


@pytest.mark.parametrize(
    ("before", "after", "named"),
    [
        (1.04, 1.032, False),  # what was left would be called complete, and most of it stays
        (1.04, 1.0, True),
        (1.39, 1.2, True),  # something was missing: the verdict says how well it is explained
        (1.39, 1.4, False),  # what it explained was noise that had been judged without it
    ],
)
def test_where_nothing_need_be_missing_an_effect_must_explain_what_is_left(model, before, after, named) -> None:
    base, final = state(model, 3000 * before, {}), state(model.with_effect("constant_load"), 3000 * after, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    assert bool(decisive(found).added) is named
    assert decisive(found).final is (final if named else base)


def test_what_lowers_the_residual_by_less_than_anybody_sees_is_no_effect() -> None:
    """However surely: with many values the least reduction that counts is far smaller."""
    before = Misfit(80_000.0, 40_000.0, 80_000, 40_000)
    for share, gained in ((0.997, False), (0.993, True)):
        after = Misfit(share * 80_000.0, share * 40_000.0, 80_000, 40_000)
        assert before.total - after.total > 5.0 * before.least
        assert nothing_gained(before, after) is not gained


@pytest.mark.parametrize(("after", "named"), [(60.0, False), (10.0, True)])
def test_an_effect_that_leaves_most_of_what_is_nothing_to_anybody_is_not_named(model, after, named) -> None:
    """Sensors may show a hundred times their noise that is a thousandth of the motion."""
    base, final = state(model, 3000 * 107.0, {}), state(model.with_effect("constant_load"), 3000 * after, {})
    base.__dict__["immaterial"] = True
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"constant_load": final.misfit}, {})
    assert bool(decisive(found).added) is named


@pytest.mark.parametrize(
    ("without", "other", "distinguishable", "named"),
    [
        (1.30, "sensor_scale", False, False),  # a twentieth of all, and a sensor would do as well
        (1.30, "sensor_scale", True, True),
        (1.30, "turbulent_leakage", False, True),  # a tie within its subsystem says where it is
        (1.90, "sensor_scale", False, True),  # it explains too much to be a matter of laws
    ],
)
def test_a_small_further_effect_that_may_be_anything_is_not_named(
    model, monkeypatch: pytest.MonkeyPatch, without: float, other: str, distinguishable: bool, named: bool
) -> None:
    one = model.with_effect("stribeck_friction")
    base, before = state(model, 3000 * 5.0, {}), state(one, 3000 * without, {})
    final = state(one.with_effect("external_leakage"), 3000 * 1.1, {})
    rival = CompetingModel(other, one, before.misfit, 0.0, 21.0 if distinguishable else 20.0, 1.0)
    monkeypatch.setattr(worth, "competing_models", lambda name, state, misfit: [rival])
    misfits = {"stribeck_friction": before.misfit, "external_leakage": final.misfit}
    found = SearchResult(model, Split([], []), FitSettings(), base, final, misfits, {"external_leakage": before})
    kept = decisive(found)
    assert kept.added == ["stribeck_friction", "external_leakage"][: 1 + named]
    assert kept.final is (final if named else before)
    assert kept.misfits[kept.added[-1]] == kept.final.misfit


@pytest.mark.parametrize(
    ("name", "without", "left", "kept"),
    [
        ("sensor_lag", 1.004, 0.999, False),
        ("sensor_quantisation", 1.004, 0.999, True),
        ("sensor_lag", 0.98, 0.978, False),
        ("sensor_lag", 0.98, 0.95, True),  # the noise, judged without it, had it in itself
    ],
)
def test_an_effect_without_which_nothing_is_left_either_is_not_missing(
    model, name: str, without: float, left: float, kept: bool
) -> None:
    one = model.with_effect("constant_load")
    base, before = state(model, 3000 * 60.0, {}), state(one, 3000 * without, {})
    final = state(one.with_effect(name), 3000 * left, {})
    misfits = {"constant_load": before.misfit, name: final.misfit}
    found = SearchResult(model, Split([], []), FitSettings(), base, final, misfits, {name: before})
    assert decisive(found).added == ["constant_load", name][: 1 + kept]


def test_segments_hold_no_more_than_so_many_periods_of_the_oil(model) -> None:
    light = model.with_entry("moving_mass", value=model.value("moving_mass") / 100.0, bounds=None)
    records = [standing(5.0)]
    assert segment_length(model, records) == 0.5
    assert segment_length(light, records) == pytest.approx(25.0 / 393.0, rel=0.05)
    assert segment_length(light, [Record.sampled("slow", 0.02, {"drive": np.zeros(200)})]) == pytest.approx(0.8)


def test_progress_tells_what_is_best_and_ends_when_its_time_is_over() -> None:
    told: list[str] = []
    progress = Progress(told.append, within=100.0)
    progress.reached((), at(3000 * 4.0))
    progress("one")
    progress.reached(("backlash",), at(3000 * 2.25))
    progress.reached(("valve_deadband",), at(3000 * 9.0))
    progress("two")
    assert told == ["one · 70 s left", "two · best so far: backlash, 2 → 1.5 × noise · 70 s left"]
    with pytest.raises(OutOfTimeError, match="100 s are over"):
        replace(progress, begun=progress.begun - 71.0)("three")


@pytest.mark.parametrize("moment", ["fitting with valve_deadband", "noise of the records"])
def test_a_search_that_is_ended_early_gives_the_best_so_far(model, moment: str, monkeypatch) -> None:
    at_once = replace(CRITERIA, right_law=0.0)  # however much is left: who ends a search does not wait for curves
    for module in ("verdict", "diagnosis"):
        monkeypatch.setattr(f"hydraulic_sysid.diagnosis.search.{module}.CRITERIA", at_once)
    drive = np.repeat(np.random.default_rng(2).uniform(-3.0, 3.0, 20), 250)
    run, draw = Plant(model.with_effect("valve_deadband")).simulate(drive, DT), np.random.default_rng(3)
    noise = {"position": 1e-5, "pressure_a": 2e4, "pressure_b": 2e4}
    channels = {c: run[c] + std * draw.standard_normal(drive.size) for c, std in noise.items()}
    for key in model.free_keys():
        model = model.with_entry(key, free=key == "viscous_friction.coefficient")

    told, pressed = list[str](), list[str]()

    def tell(text: str) -> None:
        told.append(text)
        due = any(t.startswith("fitting with valve_deadband") for t in told) and text.startswith(moment)
        if due and not pressed:
            pressed.append(text)
            raise KeyboardInterrupt

    found = diagnose(model, [Record.sampled("r", DT, {"drive": drive, **channels})], progress=tell)
    said = found.result["verdict"]
    assert not any("curve of" in text for text in told)
    assert said["kind"] == "undecided" and said["effects"] == ["valve_deadband"] and not found.decided
    assert said["level"] == "close", "however little it leaves"
    assert "was ended before it was done. Best so far: valve_deadband added." in said["text"]


def test_what_a_fault_of_the_recording_explains_is_explained(model) -> None:
    base = state(model, 3000 * 1.04, {})
    found = SearchResult(model, noisy(1.0), FitSettings(), base, base, {}, {})
    assert found.before is base.misfit and found.unexplained_share == pytest.approx(1.0)
    found = replace(found, as_recorded=as_recorded(model, 3000 * 5.0, 1.0))
    assert found.before == at(3000 * 5.0) and found.unexplained_share < 0.01


def test_what_was_left_before_is_told_over_the_noise_of_the_end(model) -> None:
    """A fault of the recording that is mended may show a smaller noise: then more of it was left before."""
    base = state(model, 3000 * 25.0, {})
    found = SearchResult(model, noisy(0.5), FitSettings(), base, base, {}, {})
    assert found.before_over_noise is base.misfit
    found = replace(found, as_recorded=as_recorded(model, 3000 * 16.0, 1.0))
    assert found.before_over_noise.rms_validation == pytest.approx(8.0)
    assert found.before_over_noise.rms_fit == pytest.approx(8.0) and found.before.rms_fit == pytest.approx(4.0)


def test_a_small_remainder_does_not_take_back_what_is_said_of_the_recording(model) -> None:
    base = state(model, 3000 * 1.2, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, base, {}, {})
    assert verdict.kind_of(found, tied=False) == verdict.OUTSIDE
    late = RecordingFault(HYPOTHESES[0], 2e-3, 1e-5, 5000.0)
    found = replace(found, faults=(late,), as_recorded=as_recorded(model, 3000 * 5.0))
    assert verdict.kind_of(found, tied=False) == verdict.RECORDING
    much = replace(found, as_recorded=as_recorded(model, 3000 * 1.5))
    assert verdict.kind_of(much, tied=False) == verdict.OUTSIDE
    assert late.text in verdict.sentences(much, verdict.judge(much), Whereabouts()), "it is said all the same"
    much = replace(much, moved=(Deviation("dead_volume_a", 200e-6, 205e-6, 2.1e-6, 2000.0),))
    said = verdict.sentences(much, verdict.judge(much), Whereabouts())
    assert "dead_volume_a" not in said, "bent to what is not known"


def test_a_fault_of_the_recording_that_explains_the_same_is_named_beside_the_effect(model) -> None:
    gain = next(h for h in HYPOTHESES if h.name == "pressure_a_gain")
    base, final = state(model, 3000 * 4.0, {}), state(model.with_effect("pressure_offset"), 3000.0, {})
    fault = RecordingFault(gain, 0.05, 1e-3, 9000.0)
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {"pressure_offset": final.misfit}, {})
    assert verdict.judge(found).kind == verdict.MISSING
    found = replace(found, faults_instead=[fault])
    judged = verdict.judge(found)
    assert judged.kind == verdict.INDISTINGUISHABLE and judged.possible == ["pressure_offset"]
    said = verdict.sentences(found, judged, Whereabouts())
    assert said.startswith("Missing: pressure_offset, or nothing is, and pressure_a reads 5.0 % too much. These data")


def with_gain_and_supply(model: Model, left: float) -> tuple[SearchResult, SearchState]:
    """A search that ended with a gain and another supply pressure, which leave so much; a state with the effect."""
    gain = RecordingFault(next(h for h in HYPOTHESES if h.name == "pressure_a_gain"), 0.05, 1e-3, 9000.0)
    supply = Deviation("supply_pressure", 14.0e6, 14.1e6, 2e4, 900.0)
    base, final = state(model, 3000 * 4.0, {}), state(model, left, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, final, {}, {}, moved=(supply,), faults=(gain,))
    return replace(found, as_recorded=base), state(model.with_effect("pressure_offset"), 3000.0, {})


@pytest.mark.parametrize(
    ("left", "free", "named"),
    [
        (2999.0, 2, True),  # hardly less than the effect alone
        (2900.0, 2, False),  # clearly less
        (2999.0, 3, False),  # an effect that has more free than there are causes
    ],
)
def test_one_effect_is_named_before_a_fault_and_a_number_that_explain_the_same_together(
    model: Model, monkeypatch: pytest.MonkeyPatch, left: float, free: int, named: bool
) -> None:
    found, effect = with_gain_and_supply(model, left)
    offset = effect.model.library["pressure_offset"]
    more = (*offset.parameters, replace(offset.parameters[0], name="offset_tank"))[:free]
    library = {"pressure_offset": replace(offset, parameters=more)}
    effect = replace(effect, model=SimpleNamespace(library=library, effects=effect.model.effects))  # type: ignore[arg-type]
    search = object.__new__(Search)
    search.split, search._beaten = found.split, effect
    monkeypatch.setattr(Search, "with_moved", lambda self, state, moved: state)
    monkeypatch.setattr(Search, "explore", lambda self, base, most: base)
    monkeypatch.setattr(Search, "_strict", lambda self, base: True)
    done = search.set_against_effect(found)
    assert done.added == (["pressure_offset"] if named else [])
    assert bool(done.faults) is bool(done.moved) is not named
    assert [f.hypothesis.name for f in done.together_instead.faults] == (["pressure_a_gain"] if named else [])


@pytest.mark.parametrize(
    ("left", "numbers", "tied"),
    [
        (2999.0, 1, True),  # as little
        (3100.0, 1, False),  # clearly more
        (2999.0, 2, False),  # as little, with more of the data sheet wrong
    ],
)
def test_a_gain_of_the_other_reading_that_says_the_same_is_named_beside_a_gain(
    model: Model, monkeypatch: pytest.MonkeyPatch, left: float, numbers: int, tied: bool
) -> None:
    found, _ = with_gain_and_supply(model, 3000.0)
    record = Record("r", DT * np.arange(2000), DT, {c: np.zeros(2000) for c in ("drive", "position", *CHAMBERS)})
    whole = Split(cut([record], "hydraulic", 0.5), [])
    scaled = replace(whole, segments=found.faults[0].on(whole.segments))
    search, seen = object.__new__(Search), []
    search.split, search.say, search._last = scaled, lambda text: None, FitSettings()  # type: ignore[assignment]

    def fitted(self: Search, model: Model, settings: FitSettings) -> SearchState:
        seen.append([reading.gain for reading in self.split.segments[0].readings])
        return state(model, left, {})

    monkeypatch.setattr(Search, "state", fitted)
    monkeypatch.setattr(Search, "fewest_moved", lambda self, final, strict: (final, [found.moved[0]] * numbers))
    effects = [state(model.with_effect("pressure_offset"), left, {})] if tied else []
    monkeypatch.setattr(Search, "in_place_of", lambda *_: (found.base, effects))
    monkeypatch.setattr("hydraulic_sysid.diagnosis.search.recording_fits.resized", lambda at, fault: fault)
    done = search.with_other_gains(found)
    assert search.split is scaled and seen == [pytest.approx([0.0, 0.0, -0.05])], "the other one, in its place"
    same = "or pressure_b reads 5.0 % too little, or pressure_offset is missing, which these data cannot distinguish"
    assert done.faults[0].text == "pressure_a reads 5.0 % too much" + (f" ({same})" if tied else "")
    named = [(*e.effects, *e.faults) for e in explanations(done, verdict.judge(done)) if e.named]
    assert named == [("pressure_a_gain",), *([("pressure_b_gain",), ("pressure_offset",)] if tied else [])]
    assert search.with_other_gains(replace(found, moved=())).faults == found.faults, "the data sheet decides"


def test_a_fault_and_a_number_that_explain_the_same_together_are_named_beside_the_effect(model: Model) -> None:
    found, effect = with_gain_and_supply(model, 3000.0)
    instead = Together(found.faults, found.moved)
    found = replace(
        found, final=effect, misfits={"pressure_offset": effect.misfit}, moved=(), faults=(), together_instead=instead
    )
    judged = verdict.judge(found)
    assert judged.kind == verdict.INDISTINGUISHABLE and judged.possible == ["pressure_offset"]
    said = verdict.sentences(found, judged, Whereabouts())
    assert said.startswith(
        "Missing: pressure_offset, or nothing is, and pressure_a reads 5.0 % too much and supply_pressure is 141"
    )
    likeliest = explanations(found, judged)[:2]
    assert [(e.effects, e.numbers, e.faults, e.named) for e in likeliest] == [
        (("pressure_offset",), (), (), True), ((), ("supply_pressure",), ("pressure_a_gain",), True)
    ]  # fmt: skip


def held_numbers(off: Sequence[float], correlation: float = 0.0) -> HeldNumbers:
    """Numbers a, b, …, so many standard errors off what the file says, two neighbours correlated."""
    cover = np.eye(len(off))
    cover[0, 1] = cover[1, 0] = correlation
    return HeldNumbers(tuple("abc"[: len(off)]), np.array(off), np.zeros(len(off)), cover)


def test_no_more_numbers_move_than_have_to() -> None:
    held = held_numbers([30.0, 1.0, 12.0])
    assert held.cost(["a", "b", "c"]) == 0.0 and held.cost(["a"]) == pytest.approx(1.0 + 144.0)
    assert next(held.fewest(200.0, 200.0)) == ("a",)
    assert list(held.fewest(100.0, 100.0)) == [("a", "c"), ("a", "b", "c")]
    assert list(held_numbers([1.0, 1.0]).fewest(100.0, 100.0))[0] == ()


def test_fewer_numbers_come_first_where_the_quadratic_may_be_wrong() -> None:
    """But of those that cost too much, only what costs clearly less than the one before."""
    held = held_numbers([30.0, 1.0, 12.0])
    assert list(held.fewest(100.0, 1000.0)) == [("a",), ("a", "c"), ("a", "b", "c")]
    assert list(held_numbers([20.0, 20.0, 20.0]).fewest(10.0, 2000.0)) == [(), ("a", "b"), ("a", "b", "c")]


def test_a_number_at_its_bound_has_the_error_that_it_has_beside_the_others() -> None:
    found = held_numbers([30.0, 1.0]).deviation("a", ["a"], 30.0)
    assert (found.key, found.nominal, found.value, found.standard_error) == ("a", 0.0, 30.0, 1.0)
    assert found.cost == pytest.approx(900.0)


def test_of_numbers_that_say_the_same_either_may_move() -> None:
    """Only their difference is known well, as of two areas with the valve's flow free."""
    held = held_numbers([3.0, -3.0], correlation=0.999)
    assert held.cost([]) == pytest.approx(18e3)
    assert next(held.fewest(100.0, 100.0)) == ("a",)
    assert held.instead("a", ["a"], 100.0) == [("b",)]
    assert held_numbers([30.0, 1.0]).instead("a", ["a"], 100.0) == []


def test_numbers_that_explain_the_same_are_all_named(model) -> None:
    other = Deviation("piston_area_b", 2.1e-3, 2.12e-3, 1e-5, 900.0)
    deviation = Deviation("piston_area_a", 3.12e-3, 3.09e-3, 1e-5, 1000.0, alternatives=(other,))
    base = state(model, 3000 * 1.04, {})
    found = SearchResult(model, Split([], []), FitSettings(), base, base, {}, {}, moved=[deviation])
    assert verdict.data_sheet_sentences(found) == [
        "piston_area_a is 30.9 ± 0.1 cm², not the 31.2 cm² of the model file, "
        "or piston_area_b is 21.2 ± 0.1 cm², not the 21 cm² of the model file: these data cannot distinguish them."
    ]
    sharp = replace(other, value=2.1004e-3, standard_error=2.6e-8)
    assert verdict.data_sheet_sentences(replace(found, moved=[sharp])) == [
        "piston_area_b is 21.004 ± 0.00026 cm², not the 21 cm² of the model file."
    ]


@pytest.mark.parametrize(
    ("own", "other", "final", "alone"),
    [
        (1e4, 8e5, 9e3, True),  # the other repairs a fifth
        (1e4, 3e5, 9e3, False),  # … or most of it, while not all is explained
        (4e5, 8e5, 9e3, False),  # it is not the whole answer itself
        (5e3, 5e4, 3.1e3, True),  # all is explained, and the other leaves twenty times as much
        (5e3, 1e4, 3.1e3, False),
    ],
)
def test_a_candidate_that_no_other_comes_near_has_no_competitor(model, own, other, final, alone) -> None:
    base = state(model, 1e6, {"valve_deadband": own, "backlash": other})
    assert without_competitor(base, state(model, final, {}), "valve_deadband") is alone


def test_later_refits_are_not_all_of_one_subsystem(model) -> None:
    names = ("spool_dynamics", "command_delay", "spool_rate_limit", "entrained_air")
    found = varied(names, [model.library[name] for name in names], 2)
    assert found == ["spool_dynamics", "command_delay", "entrained_air"]


def test_an_observed_parameter_is_tried_at_what_was_seen_alone(model) -> None:
    quantised = model.library["sensor_quantisation"]
    tried = [probe.values for (probe,) in probes(quantised, RecordFeatures(resolution=3e-4))]
    assert {values["sensor_quantisation.step"] for values in tried} == {3e-4}
    noise = [values["sensor_quantisation.noise"] for values in tried]
    assert noise[0] == 0.0 and noise == sorted(set(noise)) and noise[-1] < 3e-4
    assert list(probes(quantised, RecordFeatures())) == []
    assert list(probes(quantised, RecordFeatures(resolution=0.5))) == [], "beyond what the effect allows"


def test_half_the_influence_of_a_frequency_is_twice_the_frequency() -> None:
    assert inverse(1000.0, 80.0) and not inverse(0.0, 0.02)
    assert between(1000.0, 80.0, 0.5, 80.0) == 160.0
    assert between(0.0, 0.04, 0.5, 0.02) == 0.02
    assert between(1.0, 1.04, 0.5, 1.03) == pytest.approx(1.02)
    assert between(1.0, 0.2, 1.0, 1.03) == 0.2, "a bound stays within the bounds"


def test_a_reduction_must_show_on_segments_for_fitting_and_for_validation() -> None:
    before = Misfit(1.2e5, 6e4, 100_000, 50_000)
    assert material(before, Misfit(1.1e5, 5.5e4, 100_000, 50_000))
    assert not material(before, Misfit(1.1e5, 6.1e4, 100_000, 50_000))  # fitted away, not confirmed
    assert not material(before, Misfit(1.2e5, 5.5e4, 100_000, 50_000))
    assert not material(before, Misfit(1.2e5 - 30.0, 6e4 - 15.0, 100_000, 50_000))  # chance has more
    assert explained(before, Misfit(1.0e5, 5.0e4, 100_000, 50_000)) == pytest.approx(1.0)
    assert before.excess == pytest.approx(3e4)


def by_segment(cost: list[float]) -> Misfit:
    """Of forty segments of 1000 values, every third for validation."""
    costs, fitted = np.array(cost), np.arange(len(cost)) % 3 < 2
    count = np.full(costs.size, 1000)
    return Misfit(
        costs[fitted].sum(), costs[~fitted].sum(), 1000 * fitted.sum(), 1000 * (~fitted).sum(),
        by_segment=costs, counted=count, fitted=fitted,
    )  # fmt: skip


def test_no_single_segment_turns_what_counts() -> None:
    before, wild = [1100.0] * 40, 26  # a segment for validation whose initial state is not found
    after = [1000.0] * 40
    worse = [5000.0 if i == wild else c for i, c in enumerate(after)]
    start = by_segment([4000.0 if i == wild else c for i, c in enumerate(before)])
    assert material(start, by_segment(worse)) and explained(start, by_segment(worse)) == pytest.approx(1.0)
    lost = [20_000.0 if i == wild else c for i, c in enumerate(after)]  # more than all others gain
    assert material(by_segment(before), by_segment(lost))
    assert reduction(by_segment(before), by_segment(lost)) == pytest.approx(38 * 100.0)
    alone = by_segment([1000.0 if i == wild else c for i, c in enumerate(before)])
    assert not material(start, alone)  # one segment that gains is no effect either


def test_free_parameters_without_bounds_get_the_data_sheets_scatter(model) -> None:
    bench = bounded(load_model("moog_mcr_m_1002_bench"))
    assert bench.entry("moving_mass").bounds == (250.0, 1000.0)
    assert bounded(model).entry("moving_mass").bounds == (400.0, 600.0)  # the file's own


def test_what_a_search_let_move_is_bound_again_as_the_file_has_it() -> None:
    filed = load_model("moog_mcr_m_1002_bench").with_entry("supply_pressure", bounds=(13.5e6, 14.5e6))
    found = relaxed(bounded(filed)).with_values({"moving_mass": 600.0, "supply_pressure": 15e6}, source="fitted")
    done = as_filed(found, filed)
    assert done.entries["moving_mass"].bounds is None and done.value("moving_mass") == 600.0
    assert done.entries["supply_pressure"].bounds is None, "the value lies beyond them"
    kept = as_filed(found.with_values({"supply_pressure": 14.2e6}), filed).entries["supply_pressure"]
    assert (kept.bounds, kept.free) == ((13.5e6, 14.5e6), filed.entries["supply_pressure"].free)
    assert done.entries["piston_area_a"].free is None


def test_the_step_of_codes_survives_what_a_text_file_rounds_away() -> None:
    step = 0.000255091218
    x = np.round(np.linspace(-0.2, 0.2, 5000) / step) * step
    assert code_step(np.round(x, 6)) == pytest.approx(step, rel=1e-6)
    assert code_step(np.random.default_rng(0).standard_normal(500)) == 0.0
    assert code_step(np.zeros(50)) == 0.0
    often = np.tile(np.round(x, 6), 100)
    often[[7, 400]] += 0.3 * step, 21.7 * step  # spikes
    assert code_step(often) == pytest.approx(step, rel=1e-6)
    seldom = np.round(x, 6)  # many codes are read but once, so that this does not show which values are spikes
    seldom[::150] += 80.0 * step * np.linspace(-1.0, 1.0, 34)
    assert code_step(seldom) == pytest.approx(step, rel=1e-5)


def test_nonparametric_additions_are_effects_of_their_own_and_none_of_the_library(model) -> None:
    assert FILES
    for file in FILES:
        assert file.stem not in model.library


def test_effects_of_the_amplifier_are_named_before_the_hydraulics() -> None:
    plain = standing(2.0)
    told = Record.sampled(
        "told", DT, dict(plain.channels), description={"plant": {"imitated_effects": ["valve_deadband"]}}
    )
    assert verdict.imitated([plain]) == [] and verdict.imitated([plain, told]) == ["valve_deadband"]
    assert "read those settings first" in verdict.warning(["valve_deadband"], ["valve_deadband"])
    assert verdict.warning(["valve_deadband"], []) == ""


def test_without_pressures_a_family_of_effects_is_named_whole(model) -> None:
    assert verdict.families(model, ["valve_deadband"], ["position", "pressure_a", "pressure_b"]) == {}
    found = verdict.families(model, ["valve_deadband", "entrained_air"], ["position"])
    assert set(found) == {"valve_deadband"}
    assert {"stribeck_friction", "backlash", "valve_hysteresis"} <= set(found["valve_deadband"])
    assert "coulomb_friction" not in found["valve_deadband"]  # on already
    assert set(verdict.families(model, ["sensor_lag"], ["position"])["sensor_lag"]) == {
        "command_delay",
        "spool_dynamics",
        "sensor_delay",
    }


def test_where_the_drive_is_the_force_only_what_lies_in_line_with_the_motion_acts_alike() -> None:
    axis = load_model(Path(__file__).parents[2] / "benchmarks" / "measured" / "models" / "mts.yaml")
    found = verdict.families(axis, ["command_delay", "coulomb_friction", "constant_load"], ["position"])
    assert set(found) == {"command_delay"}
    assert set(found["command_delay"]) == {"spool_dynamics", "sensor_lag", "sensor_delay"}


def test_unusable_input_is_named(model) -> None:
    with pytest.raises(DiagnosisError, match="no record"):
        diagnose(model, [])
    with pytest.raises(DiagnosisError, match="coulomb_friction is on already"):
        add(model, "coulomb_friction", [standing(2.0)])
    bare = Record.sampled("bare", DT, {"drive": np.zeros(2000)})
    with pytest.raises(DiagnosisError, match="bare: no channel 'position'"):
        diagnose(model, [bare])


def test_a_parameter_that_the_file_fixes_does_not_move(model) -> None:
    movable = set(model.movable_keys())
    assert {"moving_mass", "orifice_transition", "bristle_length", "bristle_time"} < movable
    fixed = model.with_entry("moving_mass", free=False).with_entry("orifice_transition", free=False)
    assert movable - set(fixed.movable_keys()) == {"moving_mass", "orifice_transition"}


@pytest.mark.thorough
def test_dry_friction_of_a_light_piston_is_looked_for(model) -> None:
    """The library's 450 N on 1.3 kg ask for steps that no fit follows; 60 N do not."""
    light = model.without_effect("coulomb_friction").with_values(
        {
            "moving_mass": 1.3, "piston_area_a": 2.0e-4, "piston_area_b": 1.2e-4, "stroke": 0.2,
            "dead_volume_a": 2e-5, "dead_volume_b": 2e-5, "bulk_modulus": 8e8, "supply_pressure": 4.4e6,
            "valve_flow": 1e-4, "viscous_friction.coefficient": 100.0,
        }
    )  # fmt: skip
    for key in ("moving_mass", "bulk_modulus", "valve_flow"):
        light = light.with_entry(key, bounds=None)
    real = Plant(light.with_effect("coulomb_friction", {"level": 60.0}))
    time, draw = DT * np.arange(6000), np.random.default_rng(7)
    records = []
    for frequency in (0.4, 1.1):
        drive = 3.0 * np.sin(2.0 * np.pi * frequency * time)
        run = real.simulate(drive, DT, real.initial_state())
        noise = {"position": 5e-6, "pressure_a": 5e3, "pressure_b": 5e3}
        seen = {c: getattr(run, c) + std * draw.standard_normal(len(time)) for c, std in noise.items()}
        records.append(Record.sampled(f"{frequency} Hz", DT, {"drive": drive, **seen}))
    search = Search.of(light, records, [], FitSettings(), lambda _: None)
    base = search.begin()
    tried = search.explore(base)
    best, second = tried.refits[:2]
    assert best.name == "coulomb_friction"
    assert best.misfit.excess < 0.5 * min(second.misfit.excess, base.misfit.excess)


@pytest.fixture(scope="module")
def swept() -> tuple[Model, Model, Search]:
    """A plant with a dead band, the same bent as by a fit without it (spool and smoothing at bounds), and a search."""
    given = load_model("moog_mcr_m_1002_bench")
    built = given.with_effect("valve_deadband", {"width": 0.03})
    built = built.with_values({"spool_dynamics.frequency": 60.0, "spool_dynamics.damping": 0.7})
    time, draw = DT * np.arange(8000), np.random.default_rng(11)
    drive = 3.0 * np.sin(2.0 * np.pi * (0.2 * time + 0.5 * time**2))
    run = Plant(built).simulate(drive, DT, Plant(built).initial_state())
    noise = {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}
    seen = {c: np.asarray(getattr(run, c)) + std * draw.standard_normal(time.size) for c, std in noise.items()}
    record = Record.sampled("sweep", DT, {"drive": drive, **seen})
    bent = built.with_values(
        {
            "moving_mass": 431.0,
            "spool_dynamics.frequency": 1000.0,
            "spool_dynamics.damping": 2.0,
            "orifice_transition": 1e6,
            "bristle_length": 5e-6,
            "bristle_time": 2.34e-3,
            "viscous_friction.coefficient": 1190.0,
            "internal_leakage.coefficient": 0.0,
        }
    )
    return built, bent, Search.of(given, [record], [], FitSettings(), lambda _: None)


def test_what_a_model_was_bent_to_without_an_effect_does_not_hold_it_in_a_local_minimum(swept) -> None:
    built, bent, search = swept
    true, stuck = search.state(built), search.state(bent)
    assert stuck.misfit.total > 1.5 * true.misfit.total
    found = search.begun_anew(stuck)
    assert found.misfit.total < 1.01 * true.misfit.total
    assert found.model.value("spool_dynamics.frequency") == pytest.approx(60.0, rel=0.05)


def test_nor_where_the_effect_is_added_on_request(swept, monkeypatch) -> None:
    built, bent, search = swept
    monkeypatch.setattr(search, "refit", lambda base, s: CandidateRefit(s.effect.name, Refit(bent, []), base.misfit))
    found = search.add("valve_deadband").final
    assert found.misfit.variance < 1.05
    assert found.misfit.total < search.state(built).misfit.total + found.misfit.least
    key = "spool_dynamics.frequency"
    error = parameter_errors(found.linearisation, shared=1.0)[key].standard_error  # by the scatter alone
    assert error < 6.0 and abs(found.model.value(key) - 60.0) < 2.5 * error  # one sweep says no more of it
