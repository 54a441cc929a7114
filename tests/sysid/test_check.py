"""A check of the model file says what the records contradict, and nothing of records that are as the file says."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hidden_effects import axis, benches
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import FIT_REFINEMENT, Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.diagnosis.calibrate import CalibrationError
from hydraulic_sysid.diagnosis.check import Finding, check, contradictions
from hydraulic_sysid.diagnosis.check.experiment import resonance
from hydraulic_sysid.report import render
from hydraulic_sysid.verbs import calibrate as verb

Array = np.ndarray
Spoil = Callable[[Record], Record]

SAMPLE = Path(__file__).resolve().parents[2] / "examples" / "sample_bench"
DT = 1e-3
NOISE = {"position": 1e-5, "pressure_a": 1e4, "pressure_b": 1e4}
ROD = 5.5e-3  # m^2, the smaller area


@pytest.fixture(scope="module")
def model() -> Model:
    """An axis with a rod on one side."""
    return load_model("sample_bench").with_values({"piston_area_b": ROD})


@pytest.fixture(scope="module")
def records(model: Model) -> list[Record]:
    """Steps of several sizes, back and forth, and a chirp."""
    time, levels = DT * np.arange(6000), np.array([6.0, -5.0, 3.0, -4.0, 8.0, -6.5, 1.5, -2.0])
    steps = np.repeat(np.tile(levels, 2)[:12], 500)
    chirp = 3.0 * np.sin(2.0 * np.pi * (0.5 * time + 0.5 * time**2))
    return [
        recorded(model, name, drive, seed) for seed, (name, drive) in enumerate([("steps", steps), ("chirp", chirp)])
    ]


def recorded(model: Model, name: str, drive: Array, seed: int = 0, dt: float = DT, start: float = 0.0) -> Record:
    """The plant's run along a drive, with the noise of sensors."""
    plant, draw = Plant(model), np.random.default_rng(seed)
    run = plant.simulate(drive, dt, plant.initial_state(position=start))
    seen = {c: np.asarray(getattr(run, c)) + std * draw.standard_normal(drive.size) for c, std in NOISE.items()}
    return Record.sampled(name, dt, {"drive": drive, **seen})


def changed(**what: Callable[[Array], Array]) -> Spoil:
    """Spoils channels of a record."""
    return lambda r: replace(r, channels={c: what[c](v) if c in what else v for c, v in r.channels.items()})


def without(*names: str) -> Spoil:
    return lambda r: replace(r, channels={c: v for c, v in r.channels.items() if c not in names})


def swapped(record: Record) -> Record:
    a, b = record["pressure_a"], record["pressure_b"]
    return replace(record, channels={**record.channels, "pressure_a": b, "pressure_b": a})


def found(model: Model, records: Sequence[Record], kind: str) -> Finding:
    """The only finding of a kind."""
    (one,) = (f for f in contradictions(model, records) if f.kind == kind)
    return one


def judged(model: Model, records: Sequence[Record], but: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Kind and severity of all findings beside notes."""
    return [(f.kind, f.severity) for f in contradictions(model, records) if f.severity != "note" and f.kind not in but]


def test_nothing_is_said_of_records_as_the_file_says(model: Model, records: list[Record]) -> None:
    assert judged(model, records) == []
    for missing in (("pressure_a",), ("pressure_b",), ("pressure_a", "pressure_b")):
        assert judged(model, [without(*missing)(r) for r in records]) == []


@pytest.mark.parametrize(
    ("values", "kind", "subject", "measured"),
    [
        ({"stroke": 0.2}, "travel", "stroke", None),
        ({"supply_pressure": 10e6}, "supply", "supply_pressure", 14e6),
        ({"supply_pressure": 20e6}, "supply", "supply_pressure", 14e6),
        ({"valve_flow": 5e-3}, "valve_flow", "valve_flow", 2.5e-3),
        ({"valve_flow": 1.2e-3}, "valve_flow", "valve_flow", 2.5e-3),
        ({"piston_area_a": ROD, "piston_area_b": 8.0645e-3}, "areas", "piston_area_a", 8.0645e-3),
        ({"piston_area_b": 8.0645e-3}, "areas", "piston_area_b", ROD),
    ],
)
def test_a_number_that_the_records_contradict(
    model: Model, records: list[Record], values: dict[str, float], kind: str, subject: str, measured: float | None
) -> None:
    wrong = model.with_entry("valve_flow", bounds=None).with_values(values)
    if "valve_flow" in values:
        bounds = (0.8 * values["valve_flow"], 1.2 * values["valve_flow"])
        wrong = wrong.with_entry("valve_flow", bounds=bounds)
    one = found(wrong, records, kind)
    assert (one.subject, one.severity) == (subject, "contradiction")
    assert one.stated == values[subject]
    if measured is not None:
        assert one.measured == pytest.approx(measured, rel=0.15)


@pytest.mark.parametrize(
    ("values", "kind", "subject"),
    [({"supply_pressure": 6e6}, "above_supply", "pressure_b"), ({"tank_pressure": 8e6}, "below_tank", "pressure_b")],
)
def test_oil_does_not_flow_uphill(
    model: Model, records: list[Record], values: dict[str, float], kind: str, subject: str
) -> None:
    said = {f.subject: f for f in contradictions(model.with_values(values), records) if f.kind == kind}
    assert said[subject].severity == "contradiction" and "even while oil flows" in said[subject].text


def test_a_supply_a_few_per_cent_off_is_doubtful_and_known_to_one(model: Model, records: list[Record]) -> None:
    one = found(model.with_values({"supply_pressure": 14.6e6}), records, "supply")
    assert one.severity == "doubtful"
    assert one.measured == pytest.approx(14e6, rel=0.01)


def test_a_supply_sensor_counts_more_than_the_chambers(model: Model, records: list[Record]) -> None:
    measured = [replace(r, channels={**r.channels, "pressure_supply": np.full(len(r), 14e6)}) for r in records]
    measured = [changed(pressure_supply=lambda p: p + 1e4 * np.sin(np.arange(p.size)))(r) for r in measured]
    one = found(model.with_values({"supply_pressure": 18e6}), measured, "supply")
    assert one.severity == "contradiction" and "as measured" in one.text
    assert one.measured == pytest.approx(14e6, rel=1e-3)


def test_a_valve_flow_is_checked_without_pressures_too(model: Model, records: list[Record]) -> None:
    wrong = model.with_entry("valve_flow", bounds=(4e-3, 6e-3)).with_values({"valve_flow": 5e-3})
    alone = [without("pressure_a", "pressure_b")(r) for r in records]
    one = found(wrong, alone, "valve_flow")
    assert one.severity == "contradiction" and one.measured == pytest.approx(2.5e-3, rel=0.15)


def test_an_unknown_payload_is_doubtful(model: Model, records: list[Record]) -> None:
    one = found(model.with_values({"moving_mass": 280.0}).with_entry("moving_mass", bounds=(250, 310)), records, "mass")
    assert one.severity == "doubtful" and one.measured == pytest.approx(500.0, rel=0.1)


def test_a_large_load_that_the_model_does_not_have_is_doubtful(model: Model) -> None:
    heavy = model.with_effect("constant_load", {"load": -25e3})
    drive = np.repeat([6.0, -4.0, 5.0, -5.0] * 3, 500)
    one = found(model, [recorded(heavy, "heavy", drive)], "load")
    assert one.severity == "doubtful" and one.measured == pytest.approx(25e3, rel=0.1)
    assert judged(heavy, [recorded(heavy, "heavy", drive)]) == []


@pytest.mark.parametrize(
    ("spoil", "subject"),
    [
        (changed(drive=np.negative), "drive"),
        (changed(position=np.negative), "position"),
        (swapped, "pressure_a"),
    ],
)
def test_a_wrong_sign_is_said_and_nothing_that_follows_from_it(
    model: Model, records: list[Record], spoil: Spoil, subject: str
) -> None:
    one = found(model, [spoil(r) for r in records], "sign")
    assert (one.subject, one.severity, one.records) == (subject, "contradiction", ("steps", "chirp"))
    assert judged(model, [spoil(r) for r in records], but=["sign"]) == []


def test_without_pressures_drive_and_position_may_be_the_inverted_one(model: Model, records: list[Record]) -> None:
    one = found(model, [without("pressure_a", "pressure_b")(changed(drive=np.negative)(r)) for r in records], "sign")
    assert one.severity == "contradiction" and "the drive or the position" in one.remedy


def test_columns_of_two_experiments_do_not_belong_together(model: Model, records: list[Record]) -> None:
    other = np.repeat(np.random.default_rng(3).choice([-5.0, 4.0, -3.0, 6.0], 12), 500)
    one = found(model, [replace(records[0], channels={**records[0].channels, "drive": other})], "sign")
    assert one.subject == "drive" and one.severity == "doubtful"


@pytest.mark.parametrize(
    ("spoil", "subject", "unit"),
    [
        (changed(position=lambda x: 1e3 * x), "position", "mm read as m"),
        (changed(pressure_a=lambda p: 1e-5 * p), "pressure_a", "bar read as Pa"),
        (changed(pressure_b=lambda p: 1e-6 * p), "pressure_b", "MPa read as Pa"),
        (changed(drive=lambda u: 10.0 * u), "drive", "% read as V"),
    ],
)
def test_a_unit_that_looks_wrong_is_named(
    model: Model, records: list[Record], spoil: Spoil, subject: str, unit: str
) -> None:
    one = found(model, [spoil(r) for r in records], "unit")
    assert (one.subject, one.severity) == (subject, "contradiction")
    assert unit in one.remedy
    assert judged(model, [spoil(r) for r in records], but=["unit", "drive_limit", "saturated"]) == []


def test_a_position_that_is_far_too_small_looks_like_a_unit_too(model: Model, records: list[Record]) -> None:
    small = [changed(position=lambda x: 0.01 * x)(r) for r in records]
    one = found(model, small, "valve_flow")
    assert one.severity == "contradiction" and "units of position and drive" in one.remedy


def test_a_position_whose_zero_is_at_one_end(model: Model, records: list[Record]) -> None:
    one = found(model, [changed(position=lambda x: x + 0.7)(r) for r in records], "zero")
    assert (one.subject, one.severity) == ("position", "contradiction")
    shifted = model.with_effect("sensor_offset", {"offset": 0.7})
    assert "zero" not in dict(judged(shifted, [changed(position=lambda x: x + 0.7)(r) for r in records]))


@pytest.mark.parametrize(
    ("spoil", "kind", "subject", "severity"),
    [
        (changed(pressure_a=lambda p: np.full(p.size, 7e6)), "constant", "pressure_a", "contradiction"),
        (changed(position=lambda x: np.minimum(x, np.quantile(x, 0.9))), "clipped", "position", "doubtful"),
        (changed(pressure_a=lambda p: p - 9e6), "vacuum", "pressure_a", "contradiction"),
        (changed(drive=lambda u: 1.5 * u), "drive_limit", "drive_limit", "doubtful"),
        (changed(drive=lambda u: np.where(u > 0.0, 10.0, -10.0)), "saturated", "drive", "not identifiable"),
        (changed(drive=lambda u: 1e-3 * u), "excitation", "drive", "not identifiable"),
        (lambda r: r.window(0.0, 1.5), "short", "time", "doubtful"),
    ],
)
def test_a_fault_of_a_channel_or_an_experiment(
    model: Model, records: list[Record], spoil: Spoil, kind: str, subject: str, severity: str
) -> None:
    assert kind not in dict(judged(model, records))
    one = found(model, [spoil(r) for r in records], kind)
    assert (one.subject, one.severity) == (subject, severity)


def test_a_gap_that_the_logger_filled(model: Model, records: list[Record]) -> None:
    def held(values: Array) -> Array:
        return np.where((np.arange(values.size) > 2000) & (np.arange(values.size) < 2300), values[2000], values)

    spoil = changed(position=held, pressure_a=held, pressure_b=held)
    one = found(model, [spoil(r) for r in records], "gap")
    assert one.severity == "doubtful" and one.measured == pytest.approx(0.3, rel=0.02)


def test_a_blocked_piston_shows_the_supply(model: Model) -> None:
    """Against its stop, with the valve open: neither direction moves steadily, and one chamber fills up."""
    drive = np.repeat([9.0, 9.0], 3000)
    blocked = recorded(model, "stop", drive, start=0.7)
    assert set(judged(model, [blocked])) == {("standstill", "not identifiable"), ("excitation", "not identifiable")}
    one = found(model.with_values({"supply_pressure": 18e6}), [blocked], "supply")
    assert one.severity == "contradiction" and one.measured == pytest.approx(14e6, rel=0.02)


def test_sampling_that_cannot_see_the_resonance(model: Model, records: list[Record]) -> None:
    frequency = resonance(model)
    assert frequency is not None
    for every, severity in ((1, None), (8, "note"), (20, "not identifiable")):
        assert (1.0 / (frequency * DT * every) < 2.5) == (severity == "not identifiable")
        slow = [Record.sampled(r.name, every * DT, {c: v[::every] for c, v in r.channels.items()}) for r in records]
        said = {f.kind: f.severity for f in contradictions(model, slow)}
        assert said.get("sampling") == severity
        assert "contradiction" not in said.values()


def test_what_asks_for_many_steps_is_named(model: Model, records: list[Record]) -> None:
    """Dry friction that turns within micrometres on a mass of grams: a user who waits for a fit learns why."""
    assert "steps" not in {kind for kind, _ in judged(model, records)}
    light = model.with_values({"moving_mass": 0.5}).with_values({"coulomb_friction.level": 900.0})
    said = found(light, records, "steps")
    assert (said.subject, said.severity) == ("coulomb_friction", "note")
    assert said.measured == pytest.approx(DT * 7.2e5 / (0.6 * FIT_REFINEMENT), rel=1e-6)
    assert "coulomb_friction at 720000 1/s" in said.text and "bristle_length (0.005 mm)" in said.remedy


def test_what_the_reader_assumed_is_a_note(model: Model, records: list[Record]) -> None:
    told = [replace(r, description={"notes": ["resampled from 90 irregular samples"]}) for r in records]
    one = found(model, told, "reader")
    assert one.severity == "note" and one.records == ("steps", "chirp")


def test_a_mechanical_axis_is_checked_by_its_drive(tmp_path: Path) -> None:
    (tmp_path / "axis.yaml").write_text(axis.MODEL)
    model, table = load_model(tmp_path / "axis.yaml"), axis.run(np.random.default_rng(5))
    record = Record.sampled("axis", 1.0 / axis.RATE, {"drive": table["command_V"], "position": table["position_m"]})
    assert judged(model, [record]) == []
    assert found(model, [changed(drive=np.negative)(record)], "sign").severity == "contradiction"
    assert found(model.with_values({"stroke": 0.2}), [record], "travel").severity == "contradiction"


@pytest.mark.parametrize("hidden", ["", "valve_deadband", "supply_droop", "load_spring", "missing_codes"])
def test_a_missing_effect_is_no_contradiction(hidden: str, tmp_path: Path) -> None:
    """On a plant that shares nothing with the project's."""
    kind = "none" if not hidden else "unknown" if hidden == "missing_codes" else "single"
    bench = benches.Bench(kind, (hidden,) if hidden else (), "strong" if hidden else "", 31)
    (tmp_path / "model.yaml").write_text(benches.model_text(bench))
    model, records = load_model(tmp_path / "model.yaml"), []
    for name, table in benches.make(bench, names=("triangle", "fast", "long")).items():
        channels = dict(zip(("drive", "position", "pressure_a", "pressure_b"), list(table.values())[1:], strict=True))
        records.append(Record.sampled(name, DT, channels))
    for some in (records, [without("pressure_a", "pressure_b")(r) for r in records], *([r] for r in records)):
        assert [f for f in contradictions(model, some) if f.severity == "contradiction"] == []
    if not hidden:
        assert judged(model, records) == []


def vague(result: dict) -> set[str]:
    return {f["subject"] for f in result["findings"] if f["kind"] in ("identifiability", "collinear")}


def test_what_the_records_cannot_identify(model: Model, records: list[Record]) -> None:
    assert vague(check(model, records)) <= {"internal_leakage.coefficient"}
    even = load_model("sample_bench")  # with a rod on one side alone the piston creeps, and that shows something
    still = [recorded(even, "still", np.zeros(3000))]
    assert vague(check(even, still)) >= {"valve_flow", "viscous_friction.coefficient", "moving_mass"}
    assert vague(check(even, still, keys=["valve_flow"])) == {"valve_flow"}


def test_two_parameters_that_act_alike_are_named_together(model: Model, records: list[Record]) -> None:
    both = model.with_entry("valve_drop", free=True)
    pairs = [f["subject"] for f in check(both, records)["findings"] if f["kind"] == "collinear"]
    assert pairs == ["valve_flow, valve_drop"]


def test_a_check_needs_records_with_drive_and_position(model: Model, records: list[Record]) -> None:
    for bad, words in (
        ([], "no record"),
        ([without("position")(records[0])], "position"),
        ([records[0].window(0.0, 0.01)], "at least 20"),
    ):
        with pytest.raises(CalibrationError, match=words):
            check(model, bad)
    with pytest.raises(CalibrationError, match="not in the model"):
        check(model, records, keys=["no_such"])


def test_the_sample_bench_is_not_contradicted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verb.main(["--check", "--model", "sample_bench", "--record", str(SAMPLE), "--out", str(tmp_path)]) == 0
    assert "Nothing in the records contradicts the model file" in capsys.readouterr().out
    document = json.loads((tmp_path / "check.json").read_text())
    assert document["schema"] == "hydraulic_sysid.check/1"
    assert {f["severity"] for f in document["findings"]} <= {"note", "not identifiable"}
    assert not (tmp_path / "model.yaml").exists()


def test_a_contradiction_is_the_exit_code_and_stands_on_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = load_model("sample_bench").with_values({"supply_pressure": 9e6})
    save_model(wrong, tmp_path / "wrong.yaml")
    arguments = ["--model", str(tmp_path / "wrong.yaml"), "--record", str(SAMPLE), "--out", str(tmp_path / "run")]
    assert verb.main(["--check", *arguments, "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    (one,) = (f for f in document["findings"] if f["severity"] == "contradiction")
    assert (one["subject"], one["unit"], one["stated"]) == ("supply_pressure", "Pa", 9e6)
    assert document["verdict"]["level"] == "off" and one["text"] in document["verdict"]["text"]
    assert one["remedy"] in (tmp_path / "run" / "report.html").read_text()
    assert_cannot_inject(json.loads((tmp_path / "run" / "check.json").read_text()))


def test_the_page_shows_a_check_without_findings(model: Model, records: list[Record]) -> None:
    document = plain({**check(model, records), "findings": []})
    assert "Fit what is free" in render([document])
