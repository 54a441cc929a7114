"""Test data: what neither a fit nor the choice of effects has seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search import add
from hydraulic_sysid.diagnosis.search.holdout import TEST_VALUES, Split, split
from hydraulic_sysid.diagnosis.search.progress import OutOfTimeError
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.unseen import judged_alike
from hydraulic_sysid.estimation.fit import FitSettings
from hydraulic_sysid.estimation.segments import Segments

DT, NOISE = 1e-3, {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


def swept(plant: Model, name: str, seconds: float, seed: int) -> Record:
    """Slow to fast, with noise."""
    time, draw = DT * np.arange(round(seconds / DT)), np.random.default_rng(seed)
    drive = 2.0 * np.sin(2.0 * np.pi * (0.3 + 0.2 * time) * time)
    run = Plant(plant).simulate(drive, DT)
    seen = {c: np.asarray(getattr(run, c)) + std * draw.standard_normal(time.size) for c, std in NOISE.items()}
    return Record.sampled(name, DT, {"drive": drive, **seen})


def standing(name: str, seconds: float) -> Record:
    time = DT * np.arange(round(seconds / DT))
    return Record.sampled(name, DT, {c: np.sin(time) for c in ("drive", *NOISE)})


def inside(segments: Segments) -> set[int]:
    """Samples that lie within a segment; neighbours share the one between them."""
    return {k for first in segments.first.tolist() for k in range(first + 1, first + segments.samples - 1)}


@pytest.mark.parametrize("quick", [False, True])
def test_what_is_left_of_long_records_is_tested_on_and_nothing_else_has_it(model: Model, quick: bool) -> None:
    parts = split([standing("a", 40.0), standing("b", 50.0)], [], model, 0.5, quick)
    values = sum(s.measured.size for s in parts.to_test)
    assert 0.5 * TEST_VALUES < values < 1.3 * TEST_VALUES and parts.tested() == []
    used = {s.record.name: inside(s) for s in parts.segments}
    assert {s.record.name for s in parts.to_test} == set(used) == {"a", "b"}
    for s in parts.to_test:
        assert not used[s.record.name] & inside(s)


def test_of_short_records_nothing_is_left(model: Model) -> None:
    assert split([standing("a", 10.0)], [], model, 0.5).to_test == []


def test_records_that_are_named_are_tested_on_whole(model: Model) -> None:
    parts = split([standing("a", 40.0)], [], model, 0.5, test=[standing("c", 6.0)])
    assert [r.name for r in parts.tested()] == ["c"] == [s.record.name for s in parts.to_test]
    without = split([standing("a", 40.0)], [], model, 0.5)
    assert roles(parts) == roles(without)  # nor do they change what is fitted


def roles(parts: Split) -> list[tuple[str, list[int], list[bool]]]:
    return [(s.record.name, s.first.tolist(), f.tolist()) for s, f in zip(parts.segments, parts.fit, strict=True)]


def test_at_another_rate_noise_is_as_strong(model: Model) -> None:
    """A filtered record by itself would be held to next to nothing."""
    bench = model.with_effect("valve_deadband", {"width": 0.03})
    slow = swept(bench, "slow", 6.0, 4)
    smooth = {c: np.convolve(np.pad(slow[c], 2, mode="edge"), np.full(5, 0.2), mode="valid")[::4] for c in NOISE}
    unseen = Record.sampled("slow", 4.0 * DT, {"drive": slow["drive"][::4], **smooth})
    split_up = split([swept(bench, "fast", 6.0, 5)], [], model, 0.5, test=[unseen])
    (judged,) = judged_alike(split_up.to_test, split_up.segments)
    np.testing.assert_allclose(judged.noise_std, list(NOISE.values()), rtol=0.1)
    assert (split_up.to_test[0].noise_std < 0.7 * judged.noise_std).all()


def test_a_search_whose_time_is_over_still_says_what_it_found(model: Model) -> None:
    """What is told of it takes its time; no fits for intervals are begun then."""
    bench = model.with_effect("valve_deadband", {"width": 0.03})
    record = swept(bench, "known", 6.0, 9)
    told = list[str]()
    more = swept(bench, "more", 3.0, 10)
    search = Search.of(model, [record], [], FitSettings(), told.append, within=3600.0, test=[more])
    found = search.add("valve_deadband")
    search.say = replace(search.say, within=1e-9)  # over
    with pytest.raises(OutOfTimeError):
        search.say("next")
    known, tested = search.known_of(found, found.named), search.tested(found)
    assert known["valve_deadband.width"].standard_error < 0.003 and tested is not None and tested.after < 1.05
    assert not any("interval" in text for text in told)


def test_spikes_of_test_data_do_not_count(model: Model) -> None:
    """Nor do they in what is fitted."""
    bench = model.with_effect("valve_deadband", {"width": 0.03})
    spiky, draw = swept(bench, "spiky", 5.0, 6), np.random.default_rng(7)
    hit = draw.random(len(spiky)) < 0.005
    channels = {c: spiky[c] + 30.0 * NOISE[c] * hit * draw.choice([-1.0, 1.0], hit.size) for c in NOISE}
    unseen = Record.sampled("spiky", DT, {"drive": spiky["drive"], **channels})
    found = add(model, "valve_deadband", [swept(bench, "known", 8.0, 8)], test=[unseen])
    assert 0.9 < found.result["test"]["after"] < 1.05


def test_test_data_change_nothing_but_what_is_said_of_them(model: Model) -> None:
    """One record that follows the law that is added, and one that does not, say what they are; the fit is the same."""
    bench = model.with_effect("valve_deadband", {"width": 0.03})
    records = [swept(bench, "known", 10.0, 1)]
    alike, other = swept(bench, "alike", 4.0, 2), swept(model, "without", 4.0, 3)
    one, two = (add(model, "valve_deadband", records, test=[unseen]) for unseen in (alike, other))
    bare = add(model, "valve_deadband", records)
    assert one.model.entries == two.model.entries == bare.model.entries
    assert one.result["test"]["records"] == ("alike",) and one.result["test"]["seconds"] == pytest.approx(3.9, abs=0.4)
    assert one.result["test"]["after"] < 1.03 < 1.3 < one.result["test"]["before"]
    assert two.result["test"]["before"] < two.result["test"]["after"]
    assert "× of what was validated on, most of all in without from " in two.result["verdict"]["text"]
    assert "validated on" not in one.result["verdict"]["text"]
    assert "On unseen data (" in one.result["verdict"]["text"]
    assert bare.result["test"] is None and "Nothing was left to test on" in bare.result["verdict"]["text"]
