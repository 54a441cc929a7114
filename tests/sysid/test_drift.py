"""A parameter that changes along the records is named, one that does not is not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search import document, verdict
from hydraulic_sysid.diagnosis.search.drift import LEAST, Drift, steady
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.search_state import SearchResult
from hydraulic_sysid.diagnosis.search.whereabouts import Whereabouts
from hydraulic_sysid.estimation.fit import FitSettings

DT, SECONDS, PIECE = 1e-3, 16.0, 200
KEY = "valve_null_bias.bias"
NOISE = {"position": 1e-5, "pressure_a": 2e4, "pressure_b": 2e4}


@pytest.fixture(scope="module")
def model() -> Model:
    """The sample bench with a null bias that is known to be there; it and one more parameter are free."""
    model = load_model("sample_bench").with_effect("valve_null_bias", {"bias": 0.02})
    for key in model.free_keys():
        model = model.with_entry(key, free=key in (KEY, "viscous_friction.coefficient"))
    return model


def record(model: Model, change: float, seed: int) -> Record:
    """What the plant does while its bias goes by so much from the beginning of the record to its end."""
    plant, draw = Plant(model), np.random.default_rng(seed)
    drive = np.repeat(draw.uniform(-3.0, 3.0, round(SECONDS / DT) // 250), 250)
    state, parts = plant.initial_state(), list[dict[str, np.ndarray]]()
    for first in range(0, drive.size, PIECE):
        bias = 0.02 + change * ((first + 0.5 * PIECE) / drive.size - 0.5)
        run = plant.with_parameters({KEY: bias}).simulate(drive[first : first + PIECE], DT, state)
        parts.append({c: run[c] for c in NOISE})
        state = run.final
    seen = {c: np.concatenate([p[c] for p in parts]) + s * draw.standard_normal(drive.size) for c, s in NOISE.items()}
    return Record.sampled(f"r{seed}", DT, {"drive": drive, **seen})


def followed(model: Model, change: float, seeds: Sequence[int] = (1, 2)) -> SearchResult:
    search = Search.of(model, [record(model, change, seed) for seed in seeds], (), FitSettings(), lambda text: None)
    state = search.judged(search.state(model))
    return search.with_drift(SearchResult(model, search.split, FitSettings(), state, state, {}, {}))


@pytest.mark.parametrize("change", [0.01, -0.006])
def test_a_parameter_that_changes_along_the_records_is_named(model: Model, change: float) -> None:
    result = followed(model, change)
    found = result.drift
    assert isinstance(found, Drift) and found.key == KEY
    assert found.change == pytest.approx(change, rel=0.1)
    assert found.value == pytest.approx(0.02, rel=0.05) and found.share == pytest.approx(change / 0.02, rel=0.1)
    judged = verdict.judge(result)
    assert judged.kind == verdict.OUTSIDE and verdict.place(result, judged, Whereabouts()) == "valve"
    said = verdict.sentences(result, judged, Whereabouts())
    assert said.startswith(f"Outside the library: {KEY} changes along the records, by ") and "as no effect does" in said
    whole = document.document(result, judged, {}, Whereabouts())
    assert whole["drift"]["key"] == KEY and whole["verdict"]["level"] == "off", "however little it leaves"


@pytest.mark.parametrize("change", [0.0, 0.5 * LEAST * 0.02])
def test_one_that_stays_or_that_a_law_may_be_off_anyway_is_not(model: Model, change: float) -> None:
    result = followed(model, change)
    assert result.drift is None and verdict.judge(result).kind == verdict.COMPLETE


@pytest.mark.parametrize(("share", "named"), [(0.05, True), (0.02, False)])
def test_on_a_small_change_three_records_must_agree(model: Model, share: float, named: bool) -> None:
    found = followed(model, share * 0.02, (1, 2, 3)).drift
    assert (found is not None) is named
    if found is not None:
        assert found.key == KEY and found.share == pytest.approx(share, rel=0.2)


def test_neither_one_segment_nor_one_record_turns_it() -> None:
    draw = np.random.default_rng(5)
    records, fitted = np.repeat(np.arange(4), 20), np.arange(80) % 3 > 0
    size = draw.uniform(0.5, 1.5, 80)
    own = size * draw.normal(1.0, 0.5, 80)
    assert steady(own, size, fitted, records)
    own[7] = -30.0
    assert steady(own, size, fitted, records), "one segment that lacks something else"
    own = np.where(records == 2, -own, own)
    assert not steady(own, size, fitted, records), "a record says the opposite"
    few = records < 2
    assert not steady(own[few], size[few], fitted[few], records[few])


def test_a_phase_that_drifts_is_another_frequency(model: Model) -> None:
    """A ripple of 5 Hz that was taken for one of 5.01 Hz, a full radian over the record."""
    hertz, keys = {"amplitude": 5e5, "phase": 1.0}, ("pump_ripple.phase", "pump_ripple.frequency")
    truth = model.with_effect("pump_ripple", {**hertz, "frequency": 5.0})
    taken = model.with_effect("pump_ripple", {**hertz, "frequency": 5.01}).with_entry(keys[1], free=False)
    assert taken.entry(keys[0]).free
    search = Search.of(taken, [record(truth, 0.0, seed) for seed in (1, 2)], (), FitSettings(), lambda text: None)
    state = search.state(taken)
    assert state.misfit.variance > 1.05
    found = search.with_drift(SearchResult(taken, search.split, FitSettings(), state, state, {}, {})).drift
    assert found is None or not found.key.startswith("pump_ripple.phase")
