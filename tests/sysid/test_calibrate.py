"""Calibration finds what made the data, says what the data do not tell, and never looks at held-out records.

The data come from small plants written here, which share nothing with the simulator: another right-hand side with
SciPy's integrator for the hydraulic axis, closed forms between the events of dry friction for the mechanical one.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hydraulic_sim.errors import ModelError
from hydraulic_sim.model import Entry, Model
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.diagnosis.calibrate import CalibrationError, FitSettings, calibrate
from hydraulic_sysid.estimation.noise import noise_std, robust_noise_std
from hydraulic_sysid.report import render
from hydraulic_sysid.report.calibrate import figures as calibrate_figures
from hydraulic_sysid.verbs import calibrate as verb

Array = NDArray[np.float64]

DT = 1e-3
HOLD = 250  # samples for which the drive stands still
NOISE = {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}
TRUTH = {
    "moving_mass": 500.0,
    "bulk_modulus": 1.5e9,
    "valve_flow": 2.5e-3,
    "internal_leakage.coefficient": 5e-12,
    "viscous_friction.coefficient": 2000.0,
}
AREA, STROKE, DEAD, SUPPLY, TANK, DROP = 8.0645e-3, 1.524, 3.048e-4, 14e6, 0.3e6, 3.5e6


def slope(_: float, x: Array, opening: float) -> list[float]:
    """A symmetric axis on a four-land valve: viscous friction, laminar leakage past the piston."""
    position, velocity, p_a, p_b = x
    gain = TRUTH["valve_flow"] * abs(opening) / math.sqrt(DROP)
    into, out = (p_a, p_b) if opening >= 0.0 else (p_b, p_a)
    filled, emptied = gain * math.sqrt(max(SUPPLY - into, 0.0)), gain * math.sqrt(max(out - TANK, 0.0))
    flow_a, flow_b = (filled, -emptied) if opening >= 0.0 else (-emptied, filled)
    leak = TRUTH["internal_leakage.coefficient"] * (p_a - p_b)
    beta = TRUTH["bulk_modulus"]
    return [
        velocity,
        ((p_a - p_b) * AREA - TRUTH["viscous_friction.coefficient"] * velocity) / TRUTH["moving_mass"],
        beta * (flow_a - leak - AREA * velocity) / (DEAD + AREA * (STROKE / 2 + position)),
        beta * (flow_b + leak + AREA * velocity) / (DEAD + AREA * (STROKE / 2 - position)),
    ]


def clean(seed: int, seconds: float, volts: float) -> dict[str, Array]:
    """Channels of the hydraulic axis without noise, the drive jumping between random levels."""
    holds = round(seconds / DT / HOLD)
    levels = np.random.default_rng(seed).uniform(-volts, volts, holds)
    x = np.array([0.0, 0.0, 7.15e6, 7.15e6])
    samples = []
    for level in levels:
        grid = DT * np.arange(HOLD + 1)
        run = solve_ivp(slope, (0.0, grid[-1]), x, "DOP853", grid, args=(level / 10.0,), rtol=1e-8, atol=1e-9)
        samples.append(run.y[:, :-1])
        x = run.y[:, -1]
    states = np.concatenate(samples, axis=1)
    return {
        "drive": np.repeat(levels, HOLD), "position": states[0], "pressure_a": states[2], "pressure_b": states[3]
    }  # fmt: skip


def noisy(name: str, channels: dict[str, Array], seed: int) -> Record:
    draw = np.random.default_rng(seed)
    return Record.sampled(
        name,
        DT,
        {c: v + NOISE[c] * draw.standard_normal(v.size) if c in NOISE else v for c, v in channels.items()},
        Path(f"{name}.csv"),
    )


@pytest.fixture(scope="module")
def axis() -> list[dict[str, Array]]:
    return [clean(seed, 4.0, 8.0) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def records(axis: list[dict[str, Array]]) -> list[Record]:
    return [noisy(f"record_{i}", channels, 10 + i) for i, channels in enumerate(axis)]


def true_model() -> Model:
    """Sharp orifices, as in `slope`: the simulator's smoothing at 10 kPa would shift the valve's flow by 0.07 %."""
    sharp = {**TRUTH, "orifice_transition": 100.0}
    bench = load_model("sample_bench").without_effect("coulomb_friction")
    for key in TRUTH:  # this axis is another than the bench, whose bounds are not its own
        bench = bench.with_entry(key, bounds=None)
    return bench.with_values(sharp)


@pytest.fixture
def model() -> Model:
    """Every free parameter a tenth off."""
    return true_model().with_values({k: v * (1.1 if i % 2 else 0.9) for i, (k, v) in enumerate(TRUTH.items())})


def named(result: dict, key: str) -> dict:
    return next(p for p in result["parameters"] if p["key"] == key)


def test_intervals_hold_the_truth(axis: list[dict[str, Array]], model: Model) -> None:
    inside = []
    for seed in range(8):
        drawn = [noisy(f"record_{i}", channels, 100 * seed + i) for i, channels in enumerate(axis)]
        done = calibrate(model, drawn[:2])
        assert done.result["converged"]
        for p in done.result["parameters"]:
            low, high = p["interval"]
            assert p["value"] == pytest.approx(TRUTH[p["key"]], rel=0.05)
            inside.append(low <= TRUTH[p["key"]] <= high)
    assert len(inside) == 40
    assert np.mean(inside) >= 0.85  # 95 % expected; fewer than 34 of 40 happens once in a hundred


def test_residual_falls_to_the_noise_on_held_out_records_too(records: list[Record], model: Model) -> None:
    done = calibrate(model, records[:2], records[2:])
    for part in ("fit", "test"):
        assert done.result[part]["before"] > 3.0
        assert done.result[part]["after"] == pytest.approx(1.0, abs=0.05)
        for row in done.result[part]["records"]:
            assert row["after"] == pytest.approx(1.0, abs=0.1)
            assert row["noise_std"] == pytest.approx(NOISE[row["channel"]], rel=0.15)
    assert done.result["verdict"]["level"] == "explained"
    assert done.result["not_identifiable"] == []
    line = done.model.history[-1]
    assert line["records"] == ["record_0", "record_1"]
    assert line["test_records"] == ["record_2"]
    assert done.model.entry("moving_mass").standard_error == named(done.result, "moving_mass")["standard_error"]


def test_records_for_testing_do_not_touch_the_fit(
    records: list[Record], axis: list[dict[str, Array]], model: Model
) -> None:
    other = noisy("other", {**axis[2], "position": axis[2]["position"] * 1.3}, 5)
    fits = [calibrate(model, records[:2], held).result for held in ([], [records[2]], [other])]
    for again in fits[1:]:
        assert again["parameters"] == fits[0]["parameters"]
        assert again["correlation"] == fits[0]["correlation"]
        assert again["fit"] == fits[0]["fit"]
    assert fits[1]["test"]["after"] < 1.1 < fits[2]["test"]["after"]


def test_same_data_give_the_same_result_whatever_the_workers(
    records: list[Record], model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = calibrate(model, records).result
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    second = calibrate(model, records).result
    for volatile in ("created",):
        first.pop(volatile), second.pop(volatile)
    assert first == second


@pytest.mark.parametrize(
    ("bounds", "which", "value"), [((300.0, 470.0), "highest", 470.0), ((530.0, 900.0), "lowest", 530.0)]
)
def test_a_parameter_at_its_bound_is_reported(
    records: list[Record], model: Model, bounds: tuple[float, float], which: str, value: float
) -> None:
    inside = sum(bounds) / 2.0
    held = model.with_values({"moving_mass": inside}).with_entry("moving_mass", bounds=bounds)
    result = calibrate(held, records[:1]).result
    assert named(result, "moving_mass")["at_bound"] == which
    assert named(result, "moving_mass")["value"] == value
    assert named(result, "bulk_modulus")["at_bound"] is None
    assert result["verdict"]["level"] != "explained"


def bare(record: Record) -> Record:
    """The record without its pressures."""
    return Record.sampled(record.name, DT, {c: record[c] for c in ("drive", "position")}, record.source)


def test_without_pressures_the_rest_is_still_fitted_and_less_is_told(records: list[Record], model: Model) -> None:
    full, less = (calibrate(model, r[:2]).result for r in (records, [bare(r) for r in records]))
    assert {r["channel"] for r in less["fit"]["records"]} == {"position"}
    assert less["converged"]
    assert less["fit"]["after"] < 1.1
    for p in less["parameters"]:
        assert p["value"] == pytest.approx(TRUTH[p["key"]], rel=0.3)
    for key in ("moving_mass", "viscous_friction.coefficient"):
        assert named(less, key)["standard_error"] > 2.0 * named(full, key)["standard_error"]
    # The position shows the frequency of mass and oil: their ratio, and hardly each by itself.
    keys = less["correlation"]["keys"]
    both = less["correlation"]["matrix"][keys.index("moving_mass")][keys.index("bulk_modulus")]
    assert both > 0.99


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_small_motion_without_pressures_does_not_tell_mass_from_oil(model: Model, seed: int) -> None:
    """In short segments: over half a second the ringing of the oil turns too far for differences of parameters."""
    small = [bare(noisy("small", clean(1, 4.0, 0.1), seed))]
    result = calibrate(model, small, settings=FitSettings(length=0.1)).result
    assert any({"moving_mass", "bulk_modulus"} <= set(d["weights"]) for d in result["not_identifiable"])
    assert not named(result, "moving_mass")["identifiable"]
    assert not named(result, "viscous_friction.coefficient")["identifiable"]
    assert not named(result, "internal_leakage.coefficient")["identifiable"]


def test_what_standing_still_does_not_tell_is_named(model: Model) -> None:
    count = 3000
    still = {"drive": np.zeros(count), "position": np.zeros(count), "pressure_a": np.full(count, 7.15e6),
             "pressure_b": np.full(count, 7.15e6)}  # fmt: skip
    done = calibrate(model, [noisy("still", still, 1)], (), None, ["viscous_friction.coefficient"])
    parameter = done.result["parameters"][0]
    assert not parameter["identifiable"]
    assert done.result["not_identifiable"][0]["weights"].keys() == {"viscous_friction.coefficient"}
    assert "cannot identify viscous_friction.coefficient" in done.result["verdict"]["text"]
    assert "viscous_friction.coefficient" in render([plain(done.result)])


def spoiled(axis: list[dict[str, Array]], width: int) -> list[Record]:
    """Two records in which every hundredth sample is wild, ``width`` of them in a row."""
    found = []
    for i, channels in enumerate(axis[:2]):
        record = noisy(f"record_{i}", channels, 10 + i)
        wild = {c: record[c].copy() for c in record.channels}
        draw = np.random.default_rng(i)
        for channel, off in (("position", 0.01), ("pressure_a", -7e6), ("pressure_b", -7e6)):
            begin = draw.choice(len(record) // width, len(record) // (100 * width), replace=False) * width
            wild[channel][(begin[:, None] + np.arange(width)).ravel()] += off
        found.append(Record.sampled(record.name, DT, wild, record.source))
    return found


def worst(model: Model, records: list[Record], robust: bool) -> float:
    """How far the worst parameter is off what made the data, of its value."""
    result = calibrate(model, records, (), FitSettings(robust=robust)).result
    return max(abs(p["value"] / TRUTH[p["key"]] - 1.0) for p in result["parameters"])


def test_single_wild_samples_do_not_count_whatever_the_loss(axis: list[dict[str, Array]], model: Model) -> None:
    assert worst(model, spoiled(axis, 1), False) < 0.05
    assert worst(model, spoiled(axis, 1), True) < 0.05


def test_robust_loss_survives_dropouts(axis: list[dict[str, Array]], model: Model) -> None:
    assert worst(model, spoiled(axis, 4), True) < 0.05
    assert worst(model, spoiled(axis, 4), False) > 0.1


def test_robust_noise_std_does_not_follow_outliers() -> None:
    draw = np.random.default_rng(0)
    signal = np.sin(np.arange(5000) / 50.0) + 1e-3 * draw.standard_normal(5000)
    assert robust_noise_std(signal) == pytest.approx(1e-3, rel=0.1)
    signal[draw.choice(5000, 50, replace=False)] += 0.3
    assert robust_noise_std(signal) == pytest.approx(1e-3, rel=0.25)
    assert noise_std(signal) > 1e-2


def test_one_piece_is_a_free_run(records: list[Record], model: Model) -> None:
    done = calibrate(model, records, (), FitSettings(length=1e9), ["moving_mass", "bulk_modulus", "valve_flow"])
    assert done.result["converged"]
    for key in ("moving_mass", "bulk_modulus", "valve_flow"):
        assert done.model.value(key) == pytest.approx(TRUTH[key], rel=0.1)


def dry_axis(force: Array, mass: float, viscous: float, level: float) -> Array:
    """Position of a mass with viscous and Coulomb friction under a held force, exact between stick and slip."""
    position, velocity, seen = 0.0, 0.0, []
    for f in force:
        seen.append(position)
        left = DT
        while left > 0.0:
            if velocity == 0.0 and abs(f) <= level:
                break
            way = math.copysign(1.0, velocity or f)
            final, tau = (f - way * level) / viscous, mass / viscous
            stop = tau * math.log((velocity - final) / -final) if velocity * final < 0.0 else math.inf
            span = min(left, stop)
            decay = math.exp(-span / tau)
            position += final * span + (velocity - final) * tau * (1.0 - decay)
            velocity = 0.0 if span == stop else final + (velocity - final) * decay
            left -= span
    return np.array(seen)


def test_mechanical_axis_from_force_to_position() -> None:
    truth = {"moving_mass": 95.0, "viscous_friction.coefficient": 200.0, "coulomb_friction.level": 20.0}
    model = Model(
        "axis",
        {"moving_mass": Entry(95.0), "drive_force": Entry(35.0, free=False), "stroke": Entry(2.0, free=False)},
        ("viscous_friction", "coulomb_friction"),
        "mechanical",
    ).with_values({"moving_mass": 105.0, "viscous_friction.coefficient": 180.0, "coulomb_friction.level": 25.0})
    time = DT * np.arange(6000)
    records = []
    for i, pace in enumerate((2.0, 3.1)):
        drive = 2.5 * np.sin(pace * time) + 1.5 * np.sin(3.7 * pace * time + i)
        position = dry_axis(35.0 * drive, *truth.values())
        records.append(noisy(f"axis_{i}", {"drive": drive, "position": position}, i))
    done = calibrate(model, records[:1], records[1:])
    assert {p["key"] for p in done.result["parameters"]} == set(truth)
    for key, value in truth.items():
        assert done.model.value(key) == pytest.approx(value, rel=0.03)
    # The simulator's dry friction turns within micrometres and milliseconds, that of `dry_axis` at once.
    assert done.result["test"]["after"] < 1.4
    assert done.result["test"]["before"] > 5.0


def test_unusable_input_is_named(records: list[Record], model: Model) -> None:
    fixed = model
    for key in model.free_keys():
        fixed = fixed.with_entry(key, free=False)
    short = Record.sampled("short", DT, {c: v[:15] for c, v in records[0].channels.items()})
    blind = Record.sampled("blind", DT, {"drive": records[0]["drive"]})
    part = records[0].window(1.0, 3.0)
    cases = [
        (lambda: calibrate(fixed, records), "no parameter is free"),
        (lambda: calibrate(model, records, keys=["moving_mas"]), "moving_mas: not in the model; it has: moving_mass"),
        (lambda: calibrate(model, records, keys=["coulomb_friction.level"]), "not in the model"),
        (lambda: calibrate(model, [short]), "short: .* 15"),
        (lambda: calibrate(model, [blind]), "blind: no channel 'position'"),
        (lambda: calibrate(model, records, settings=FitSettings(length=-1.0)), "must be positive"),
        (lambda: calibrate(model, []), "no record"),
        (lambda: calibrate(model, records, [records[1]]), "also among those to fit: record_1"),
        (lambda: calibrate(model, records, [part]), r"also among those to fit: record_0\[1–3 s\]"),
    ]
    for call, words in cases:
        with pytest.raises((CalibrationError, ModelError), match=words):
            call()
    first, last = records[0].split(0.5)
    assert calibrate(model, [first], [last], keys=["valve_flow"]).result["test"]["after"] > 0.9


def save_csv(path: Path, record: Record) -> str:
    names = {"drive": "drive_V", "position": "position_m", "pressure_a": "pressure_a_Pa", "pressure_b": "pressure_b_Pa"}
    table = np.column_stack([record.time, *(record[c] for c in names)])
    np.savetxt(path, table, delimiter=",", header=",".join(("time_s", *names.values())), comments="")
    return str(path)


@pytest.fixture
def files(tmp_path: Path, records: list[Record], model: Model) -> dict[str, str]:
    save_model(model, tmp_path / "start.yaml")
    return {"model": str(tmp_path / "start.yaml"), **{r.name: save_csv(tmp_path / f"{r.name}.csv", r) for r in records}}


def test_verb_writes_document_page_and_model(
    files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    call = ["--model", files["model"], "--record", files["record_0"], files["record_1"], "--out", str(out)]
    assert verb.main([*call, "--holdout-record", files["record_2"]]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["calibrate.json", "model.yaml", "report.html"]
    result = json.loads((out / "calibrate.json").read_text(encoding="utf-8"))
    printed = " ".join(capsys.readouterr().out.split())
    assert result["verdict"]["text"] in printed
    assert " test " in printed
    page = (out / "report.html").read_text(encoding="utf-8")
    assert result["verdict"]["text"] in page
    assert all(p["key"] in page for p in result["parameters"])
    made = load_model(out / "model.yaml")
    for p in result["parameters"]:
        assert made.value(p["key"]) == pytest.approx(p["value"], rel=1e-9)
        assert made.entry(p["key"]).standard_error == pytest.approx(p["standard_error"], rel=1e-9)
        assert made.entry(p["key"]).source == "calibrated"
    assert made.history[-1]["test_records"] == ["record_2"]
    before = (out / "model.yaml").read_bytes()
    assert verb.main(call) == 2
    assert "never overwritten" in capsys.readouterr().err
    assert (out / "model.yaml").read_bytes() == before


def test_verb_prints_json_and_takes_chosen_parameters(
    files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["--model", files["model"], "--record", files["record_0"], "--out", str(tmp_path / "run"), "--json"]
    assert verb.main([*call, "--free", "valve_flow", "valve_flow", "--window", "0", "2", "--robust"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [p["key"] for p in result["parameters"]] == ["valve_flow"]
    assert result["settings"]["robust"] is True
    assert result["test"] is None
    assert result["records"][0]["duration"] == pytest.approx(2.0)


def test_verb_says_what_is_wrong(files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ["--model", files["model"], "--out", str(tmp_path / "run"), "--record"]
    for arguments, words in (
        ([files["record_0"], "--free", "nothing"], "nothing: not in the model"),
        ([files["record_0"], "--holdout-record", files["record_0"]], "also among those to fit"),
        ([files["record_0"], "--window", "0", "2", "--holdout-record", files["record_0"]], "also among those to fit"),
        ([files["record_0"], "--piece", "0.01"], "at least 20"),
        (["nowhere.csv"], "nowhere.csv"),
    ):
        assert verb.main([*call, *arguments]) == 2
        error = capsys.readouterr().err
        assert words in error
        assert "Traceback" not in error
        assert not (tmp_path / "run").exists()


def test_figures_show_what_the_document_holds(records: list[Record], model: Model) -> None:
    result = plain(calibrate(model, records[:2], records[2:]).result)
    changes = calibrate_figures.changes(result)
    assert changes is not None
    mass = named(result, "moving_mass")
    at = list(changes.data[0].y).index("moving_mass")
    assert changes.data[0].x[at] == pytest.approx(100.0 * (mass["value"] / mass["before"] - 1.0), rel=1e-5)
    width = 196.0 * mass["standard_error"] / mass["before"]
    assert changes.data[0].error_x.array[at] == pytest.approx(width, rel=1e-5)
    bars = calibrate_figures.residuals(result)
    assert len(bars.layout.shapes) == 6
    assert all(s.y0 == s.y1 == 1 for s in bars.layout.shapes)
    shown = [float(v) for trace in bars.data if trace.name == "after" for v in trace.y]
    stored = {r["after"] for part in ("fit", "test") for r in result[part]["records"]}
    assert sorted(shown) == pytest.approx(sorted(stored), rel=1e-5)
    assert np.allclose(calibrate_figures.correlation(result).data[0].z, result["correlation"]["matrix"])
    assert_cannot_inject(result)
