"""What explains records whose physics is complete: nothing more, a number of the data sheet, or the recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import Mock

import numpy as np
import pytest
from hostile_page import assert_cannot_inject
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.diagnosis.search import Diagnosis, diagnose, verdict
from hydraulic_sysid.diagnosis.search.data_sheet import relaxed
from hydraulic_sysid.diagnosis.search.frozen_jacobian import Refit
from hydraulic_sysid.diagnosis.search.holdout import MOST_VALUES, QUICK_LEAST, QUICK_SECONDS, split
from hydraulic_sysid.diagnosis.search.progress import OutOfTimeError
from hydraulic_sysid.diagnosis.search.remainder import Spikes
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.search_state import CandidateRefit, SearchResult
from hydraulic_sysid.estimation.fit import FitSettings
from hydraulic_sysid.report import render

Array = np.ndarray

DT, SECONDS = 1e-3, 4.0
NOISE = {"position": 1e-5, "pressure_a": 1e4, "pressure_b": 1e4}


@pytest.fixture(scope="module")
def model() -> Model:
    """Of the free parameters two are left, so that a search is short."""
    bench = load_model("sample_bench")
    for key in bench.free_keys():
        if key not in ("valve_flow", "viscous_friction.coefficient"):
            bench = bench.with_entry(key, free=False)
    return bench


@pytest.fixture(scope="module")
def runs(model: Model) -> list[dict[str, Array]]:
    """What the plant does in three experiments: steps, a slow sine, a chirp."""
    return driven(model)


def driven(model: Model) -> list[dict[str, Array]]:
    plant, time = Plant(model), DT * np.arange(round(SECONDS / DT))
    draw = np.random.default_rng(7)
    drives = [
        np.repeat(draw.uniform(-4.0, 4.0, 16), 250),
        2.0 * np.sin(2.0 * np.pi * 0.5 * time),
        3.0 * np.sin(2.0 * np.pi * (0.5 * time + 0.5 * time**2)),
    ]
    found = []
    for drive in drives:
        run = plant.simulate(drive, DT, plant.initial_state())
        found.append({"drive": drive, **{c: np.asarray(getattr(run, c)) for c in NOISE}})
    return found


def records(runs: Sequence[Mapping[str, Array]], filtered: bool = False) -> list[Record]:
    """With the noise of the sensors; ``filtered``: low-passed at 200 Hz, with hum, in steps of a 12-bit converter."""
    draw, found = np.random.default_rng(11), []
    for number, run in enumerate(runs):
        channels = {"drive": run["drive"]}
        for channel, std in NOISE.items():
            noise = draw.standard_normal(run["drive"].size)
            if filtered:
                noise = lfilter(*butter(2, 2.0 * DT * 200.0), noise)
                noise += np.sin(2.0 * np.pi * 50.0 * DT * np.arange(noise.size) + number)
            seen = run[channel] + std * noise
            channels[channel] = np.round(seen / (0.7 * std)) * (0.7 * std) if filtered else seen
        found.append(Record.sampled(f"record_{number}", DT, channels))
    return found


def document(done: Diagnosis) -> dict[str, Any]:
    """As a file holds it; its page can be made."""
    found = plain(done.result)
    assert found["verdict"]["text"] in render([found])
    return found


@pytest.mark.parametrize("filtered", [False, True], ids=["white", "real"])
def test_nothing_missing_is_complete_whatever_the_sensors(model: Model, runs, filtered: bool) -> None:
    found = document(diagnose(model, records(runs, filtered)))
    assert found["verdict"]["kind"] == "complete", found["verdict"]["text"]
    for part in ("fit", "validation"):
        assert 0.95 < found["residual"]["after"][part] < 1.05
    assert found["data_sheet"] == [] == found["recording"]["faults"]
    assert all(r["beyond_noise"] < 0.25 * r["noise"] for r in found["remainder"])
    if filtered:
        assert all(50.0 in lines for lines in found["recording"]["mains_lines"].values())


def test_a_wrong_supply_pressure_is_a_matter_of_the_data_sheet(model: Model) -> None:
    nominal = model.value("supply_pressure")
    truth = 0.97 * nominal
    done = diagnose(model, records(driven(model.with_values({"supply_pressure": truth}))))
    found = document(done)
    assert found["verdict"]["kind"] == "data sheet", found["verdict"]["text"]
    (number,) = found["data_sheet"]
    assert (number["key"], number["nominal"]) == ("supply_pressure", nominal)
    assert abs(number["value"] - truth) < max(3.0 * number["standard_error"], 1e-3 * truth)
    assert done.model.value("supply_pressure") == pytest.approx(number["value"])
    assert done.model.value("piston_area_a") == model.value("piston_area_a")  # what is not named is as it was
    assert "supply_pressure is" in found["verdict"]["text"]


@pytest.mark.thorough
def test_areas_that_say_the_same_are_both_named(model: Model) -> None:
    """With valve flow, mass and friction free a larger area of one side is a smaller one of the other."""
    for key in ("moving_mass", "bulk_modulus", "coulomb_friction.level", "internal_leakage.coefficient"):
        model = model.with_entry(key, free=True)
    truth = {"piston_area_b": 1.02 * model.value("piston_area_b")}
    found = document(diagnose(model, records(driven(model.with_values(truth)))))
    assert found["verdict"]["kind"] == "data sheet", found["verdict"]["text"]
    (number,) = found["data_sheet"]
    (other,) = number["alternatives"]
    assert {number["key"], other["key"]} == {"piston_area_a", "piston_area_b"}
    assert other["standard_error"] < 0.02 * other["nominal"] and f", or {other['key']} is" in found["verdict"]["text"]


@pytest.mark.thorough
def test_wrong_numbers_beside_a_missing_effect_are_named_as_such(model: Model) -> None:
    """The effect hides at first what they do, so that the data sheet is asked again once it is there."""
    off = {"piston_area_b": 0.97, "supply_pressure": 1.03}
    truth = {key: share * model.value(key) for key, share in off.items()}
    bench = model.with_effect("command_delay", {"delay": 0.02}).with_values(truth)
    found = document(diagnose(model, records(driven(bench))))
    assert found["verdict"]["kind"] == "missing", found["verdict"]["text"]
    assert [e["name"] for e in found["effects"] if e["added"]] == ["command_delay"]
    assert {d["key"] for d in found["data_sheet"]} == set(truth)
    assert found["residual"]["after"]["validation"] < 1.05


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("effect", "size", "others"),
    [
        ("hose_compliance", 0.4, {}),
        ("sensor_offset", 0.4, {"constant_load": 300.0}),
    ],
)
def test_one_effect_is_simpler_than_two_numbers_that_say_the_same(
    model: Model, effect: str, size: float, others: Mapping[str, float]
) -> None:
    """A hose is both dead volumes larger, an offset of the position is one larger and the other smaller."""
    volume = size * model.value("dead_volume_a")
    amount = volume / (model.value("bulk_modulus") if effect == "hose_compliance" else model.value("piston_area_a"))
    bench = model
    for name, value in {effect: amount, **others}.items():
        (parameter,) = model.library[name].parameters
        bench = bench.with_effect(name, {parameter.name: value})
    found = document(diagnose(model, records(driven(bench))))
    assert found["verdict"]["kind"] == "missing", found["verdict"]["text"]
    assert {e["name"] for e in found["effects"] if e["added"]} == {effect, *others} and not found["data_sheet"]
    assert {d["key"] for d in found["data_sheet_instead"]} <= {"dead_volume_a", "dead_volume_b"}
    assert found["residual"]["after"]["validation"] < 1.05


@pytest.mark.thorough
@pytest.mark.parametrize(("effect", "size"), [("hose_compliance", 0.4), ("sensor_offset", 0.4)])
def test_one_effect_is_simpler_beside_numbers_that_are_wrong(model: Model, effect: str, size: float) -> None:
    """Only some of the numbers that would explain the records are there for the effect."""
    volume = size * model.value("dead_volume_a")
    amount = volume / (model.value("bulk_modulus") if effect == "hose_compliance" else model.value("piston_area_a"))
    (parameter,) = model.library[effect].parameters
    off = {key: share * model.value(key) for key, share in {"piston_area_b": 0.97, "supply_pressure": 1.03}.items()}
    bench = model.with_effect(effect, {parameter.name: amount}).with_values(off)
    found = document(diagnose(model, records(driven(bench))))
    assert [e["name"] for e in found["effects"] if e["added"]] == [effect], found["verdict"]["text"]
    assert {d["key"] for d in found["data_sheet"]} <= set(off)
    assert {d["key"] for d in found["data_sheet_instead"]} <= {"dead_volume_a", "dead_volume_b"}


@pytest.mark.thorough
def test_late_pressures_are_a_matter_of_the_recording(model: Model, runs) -> None:
    late = [{c: np.concatenate((v[:1], v[:1], v[:-2])) if c.startswith("pressure") else v for c, v in run.items()}
            for run in runs]  # fmt: skip
    found = document(diagnose(model, records(late)))
    assert found["verdict"]["kind"] == "recording", found["verdict"]["text"]
    (fault,) = found["recording"]["faults"]
    assert fault["name"] == "pressures" and fault["channels"] == ["pressure_a", "pressure_b"]
    assert fault["size"] == pytest.approx(2.0 * DT, rel=0.1)
    assert "late" in found["verdict"]["text"]
    assert found["residual"]["before"]["validation"] > 1.2 * found["residual"]["after"]["validation"]


@pytest.mark.thorough
def test_pressures_that_are_a_little_late_beside_an_effect_are_no_further_effect(model: Model) -> None:
    """The effect hides them at first: what all channels but the position show is then like a slower valve."""
    runs = driven(model.with_effect("sensor_delay", {"delay": 0.012}))
    time = DT * np.arange(round(SECONDS / DT))
    before = np.maximum(time - 0.9 * DT, 0.0)
    late = [{c: CubicSpline(time, v)(before) if c.startswith("pressure") else v for c, v in run.items()}
            for run in runs]  # fmt: skip
    found = document(diagnose(model, records(late)))
    assert [e["name"] for e in found["effects"] if e["added"]] == ["sensor_delay"], found["verdict"]["text"]
    assert {f["name"] for f in found["recording"]["faults"]} <= {"pressures", "pressures_low_pass"}


def test_what_was_found_is_the_best_so_far_where_the_time_ends_in_what_follows(
    model: Model, runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = Search.of(model, records(runs), [], FitSettings(), lambda _: None)
    base = search.begin()
    known = search.state(model.with_effect("sensor_delay", {"delay": 0.01}).with_effect("valve_deadband"))
    known = replace(known, misfit=replace(known.misfit, validation=2.0 * known.misfit.validation))
    with monkeypatch.context() as patch:
        patch.setattr(search, "explore", Mock(side_effect=OutOfTimeError("over")))
        with pytest.raises(OutOfTimeError):
            search.forward(base, known)
    found = search.so_far()
    assert found.stopped and found.added == ["sensor_delay", "valve_deadband"]
    assert found.final.model.effects == known.model.effects


def test_a_rival_that_was_stuck_begins_once_more_where_the_search_ended(model: Model) -> None:
    """While the piston moves, a friction that is larger one way is a load; its quick refit, here, has led nowhere."""
    loaded = model.with_effect("constant_load", {"load": 900.0})
    search = Search.of(model, records(driven(loaded)), [], FitSettings(), lambda _: None)
    base, final = search.begin(), search.state(loaded)
    refits = [
        CandidateRefit(name, Refit(base.model.with_effect(name, {key: value}), base.linearisation.costs), base.misfit)
        for name, key, value in (("friction_asymmetry", "difference", -100.0), ("sensor_delay", "delay", 1e-3))
    ]
    own = CandidateRefit("constant_load", Refit(final.model, final.linearisation.costs), final.misfit)
    without, misfits = replace(base, refits=[own, *refits]), {"constant_load": final.misfit}
    found = SearchResult(model, search.split, search.settings, without, final, misfits, {"constant_load": without})
    again = search.rivals_begun_anew(found).competing["constant_load"].refits
    assert [r.name for r in again] == ["constant_load", "friction_asymmetry", "sensor_delay"]
    assert again[1].misfit.excess < 0.02 * base.misfit.excess
    assert again[2] is refits[1]  # it changes something else


def test_rivals_are_fitted_to_the_end_before_they_are_told_apart(model: Model) -> None:
    """A friction that is larger one way, whose quick refit stopped short, and a delay that is out of the question."""
    loaded = model.with_effect("constant_load", {"load": 900.0})
    search = Search.of(model, records(driven(loaded)), [], FitSettings(), lambda _: None)
    base, final = search.begin(), search.state(loaded)

    def refit(name: str, key: str, value: float, share: float) -> CandidateRefit:
        """Of an effect that explains, quickly refitted, a share of what the load does."""
        left = replace(base.misfit, fit=base.misfit.fit - share * (base.misfit.fit - final.misfit.fit))
        return CandidateRefit(name, Refit(base.model.with_effect(name, {key: value}), base.linearisation.costs), left)

    near, far = refit("friction_asymmetry", "difference", -100.0, 0.8), refit("sensor_delay", "delay", 1e-3, 0.3)
    without, misfits = replace(base, refits=[near, far]), {"constant_load": final.misfit}
    found = SearchResult(model, search.split, search.settings, without, final, misfits, {"constant_load": without})
    (again, same) = search.rivals_finished(found).competing["constant_load"].refits
    assert again.name == near.name and again.finished and again.misfit.excess < 0.05 * base.misfit.excess
    assert same is far and not far.finished
    rivals = verdict.judge(search.rivals_finished(found)).competing["constant_load"]
    assert [(c.name, c.finished) for c in rivals] == [("friction_asymmetry", True), ("sensor_delay", False)]


def test_rivals_that_a_loose_data_sheet_made_as_good_are_looked_for_as_it_was_filed(model: Model) -> None:
    """Beside numbers that do what a load does, a droop that does nothing of it left as little as the load."""
    loaded = model.with_effect("constant_load", {"load": 900.0})
    search = Search.of(model, records(driven(loaded)), [], FitSettings(), lambda _: None)
    base, final = search.begin(), search.state(loaded)
    own, other = (
        CandidateRefit(name, Refit(base.model.with_effect(name, values), base.linearisation.costs), final.misfit)
        for name, values in (("constant_load", {"load": 900.0}), ("supply_droop", {"resistance": 1e8}))
    )
    loose = replace(base, model=relaxed(base.model), refits=[own, other])
    misfits = {"constant_load": final.misfit}
    for without, seen in ((loose, False), (replace(loose, model=model), True)):
        found = SearchResult(model, search.split, search.settings, base, final, misfits, {"constant_load": without})
        again = search.rivals_as_filed(found).competing["constant_load"]
        assert (again is without) is seen
        near = [r.name for r in again.refits if r.misfit.excess < 0.1 * base.misfit.excess]
        assert ("supply_droop" in near) is seen


def test_the_values_of_a_model_are_those_of_its_laws_as_they_stand(model: Model, runs) -> None:
    """A search lets every law be off a little in each segment, and then hardly sees that a value is off as much."""
    search = Search.of(model, records(runs, filtered=True), [], FitSettings(), lambda _: None)
    base = search.begin()
    laws = [s.nuisance.shape[-1] - 2 * sum(map(len, s.hum)) for s in search.split.segments]
    assert laws == [2, 2, 2] and all(s.hum for s in search.split.segments)
    assert [s.with_exact_laws().nuisance.shape[-1] for s in search.split.segments] == [6, 6, 6], "a line per channel"
    off = {key: 1.02 * base.model.value(key) for key in base.model.free_keys()}
    done = search.with_exact_laws(base.model.with_values(off), search.split)
    assert done.value("valve_flow") == pytest.approx(model.value("valve_flow"), rel=5e-4)
    # Friction is a small part of the force here.
    assert done.value("viscous_friction.coefficient") == pytest.approx(164.0, rel=0.03)

    search.say = replace(search.say, within=1e-9)  # the time of the search is over: a part was kept for this
    ended = SearchResult(search.given, search.split, search.settings, replace(base, refits=[]), base, {}, {})
    ended = replace(ended, final=replace(base, model=base.model.with_values(off)))
    for stopped in (False, True):
        kept = search.with_final_values(replace(ended, stopped=stopped)).final.model.value("valve_flow")
        assert (kept == off["valve_flow"]) is stopped, "the best so far is as it is"


@pytest.mark.thorough
def test_slow_transducers_are_a_matter_of_the_recording(model: Model, runs) -> None:
    """They ring on from one segment into the next."""
    lag = 0.01
    kept = np.exp(-DT / lag)
    pole = [1.0 - (1.0 - kept) * lag / DT, (1.0 - kept) * lag / DT - kept], [1.0, -kept]  # of straight lines
    slow = [{c: lfilter(*pole, v - v[0]) + v[0] if c.startswith("pressure") else v for c, v in run.items()}
            for run in runs]  # fmt: skip
    found = document(diagnose(model, records(slow)))
    assert found["verdict"]["kind"] == "recording", found["verdict"]["text"]
    (fault,) = found["recording"]["faults"]
    assert fault["name"] == "pressures_low_pass" and fault["size"] == pytest.approx(lag, rel=0.03)
    assert found["residual"]["after"]["validation"] < 1.03


@pytest.mark.thorough
def test_a_transducer_that_reads_too_much_is_a_matter_of_the_recording(model: Model, runs) -> None:
    scaled = [{**run, "pressure_b": 1.03 * run["pressure_b"]} for run in runs]
    found = document(diagnose(model, records(scaled)))
    assert found["verdict"]["kind"] == "recording", found["verdict"]["text"]
    (fault,) = found["recording"]["faults"]
    assert fault["name"] == "pressure_b_gain" and fault["unit"] == "1"
    assert fault["size"] == pytest.approx(0.03, rel=0.1)
    assert "pressure_b reads 3.0 % too much: calibrate the transducer" in found["verdict"]["text"]
    assert_cannot_inject(found)


def test_spikes_are_counted_and_do_not_count(model: Model, runs) -> None:
    spoiled = []
    for record in records(runs):
        wild = record["pressure_a"].copy()
        wild[200::400] += 50.0 * NOISE["pressure_a"]
        spoiled.append(Record.sampled(record.name, DT, {**record.channels, "pressure_a": wild}))
    found = document(diagnose(model, spoiled))
    assert found["verdict"]["kind"] == "recording", found["verdict"]["text"]
    (spikes,) = found["recording"]["spikes"]
    assert spikes["channel"] == "pressure_a" and 27 <= spikes["count"] <= 30
    assert 0.95 < found["residual"]["after"]["validation"] < 1.05


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (1, "1 sample of pressure A (0.001 %) stands alone far off the noise, at 7 s of run; it is left out."),
        (50, "50 samples of pressure A (0.05 %) are spikes, the first at 7 s of run; they are left out: look for a "),
    ],
)
def test_few_spikes_are_an_accident(count: int, said: str) -> None:
    found = [Spikes("pressure_a", count, 1e-5 * count, count * [("run", 7.0)])]
    (sentence,) = verdict.recording_sentences(cast(SearchResult, SimpleNamespace(faults=[], spikes=found)))
    assert sentence.startswith(said)


@pytest.mark.thorough
def test_noise_on_the_recorded_drive_is_a_matter_of_the_recording(model: Model, runs) -> None:
    draw, noisy = np.random.default_rng(3), []
    for record in records(runs):
        drive = record["drive"] + 0.03 * draw.standard_normal(len(record))
        noisy.append(Record.sampled(record.name, DT, {**record.channels, "drive": drive}))
    found = document(diagnose(model, noisy))
    assert found["verdict"]["kind"] == "recording", found["verdict"]["text"]
    (fault,) = found["recording"]["faults"]
    assert (fault["name"], fault["unit"]) == ("drive_noise", "V")
    assert fault["size"] == pytest.approx(0.03, rel=0.1)


@pytest.mark.thorough
def test_a_slow_log_of_a_fast_drive_is_a_matter_of_the_recording(model: Model) -> None:
    """Whoever logs every fourth sample of a drive that jumps at any time does not know what the valve got."""
    plant, draw, slow = Plant(model), np.random.default_rng(9), []
    for number in range(3):
        drive = np.repeat(draw.uniform(-3.0, 3.0, 40), draw.integers(60, 140, 40))
        run = plant.simulate(drive, DT, plant.initial_state())
        seen = {c: np.asarray(getattr(run, c)) + std * draw.standard_normal(drive.size) for c, std in NOISE.items()}
        slow.append(Record.sampled(f"log_{number}", 4 * DT, {c: v[::4] for c, v in ({"drive": drive} | seen).items()}))
    found = document(diagnose(model, slow))
    assert found["verdict"]["kind"] == "recording", found["verdict"]["text"]
    assert [f["name"] for f in found["recording"]["faults"]][:1] == ["drive_between_samples"]


def test_the_residual_is_tested_for_whiteness(model: Model, runs) -> None:
    for row in document(diagnose(model, records(runs, filtered=True)))["whiteness"]:
        assert not row["coloured"] and abs(row["correlation"]) < 0.1 and 0.9 < row["rms"] < 1.1


def test_of_very_long_records_blocks_are_left_out(model: Model) -> None:
    time = DT * np.arange(400_000)
    channels = {c: np.sin(time) for c in ("drive", *NOISE)}
    long = split([Record.sampled("long", DT, channels)], (), model, 0.5)
    assert 0.4 * MOST_VALUES < sum(s.measured.size for s in long.segments) < 1.1 * MOST_VALUES
    (segments,), (fit,) = long.segments, long.fit
    assert 0.6 < fit.mean() < 0.72
    assert time.size - segments.first[-1] <= np.diff(segments.first).max()  # evenly, up to the end


def test_what_goes_furthest_is_not_left_out(model: Model) -> None:
    """A cushion acts where the piston goes once in a record."""
    time = DT * np.arange(100_000)
    channels = {c: np.sin(time) + np.where(np.abs(time - 39.3) < 0.5, 0.5, 0.0) for c in NOISE}
    used = split([Record.sampled("long", DT, channels | {"drive": np.sin(time)})], (), model, 0.5).segments[0]
    assert used.measured[..., 0].max() > 1.3


@pytest.mark.parametrize("names", [("position",), tuple(NOISE)], ids=["position", "pressures, too"])
@pytest.mark.parametrize("dt", [1e-3, 4e-3])
def test_for_a_quick_answer_a_few_seconds_do_that_hold_enough(model: Model, dt: float, names: tuple[str, ...]) -> None:
    time = dt * np.arange(round(60.0 / dt))
    record = Record.sampled("long", dt, {c: np.sin(time) for c in ("drive", *names)})
    used = split([record], (), model, 0.5, quick=True).segments
    seconds, values = sum(len(s) * s.samples * dt for s in used), sum(s.measured.size for s in used)
    assert values > 0.9 * QUICK_LEAST
    assert seconds < 1.2 * QUICK_SECONDS or values < 1.3 * QUICK_LEAST
