"""Changes over many bags, and units beside each other: on numbers whose truth is known, and on simulated bags."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.monitoring import change, estimates, fleet, trend
from hydraulic_sysid.monitoring.random_effects import pooled
from hydraulic_sysid.verbs import fleet as fleet_verb
from hydraulic_sysid.verbs import monitor as monitor_verb

LEAKAGE = "internal_leakage.coefficient"


def test_pooled_values_have_the_scatter_that_their_errors_leave() -> None:
    rng = np.random.default_rng(1)
    errors = rng.uniform(0.5, 1.5, 4000)
    alone = pooled(5.0 + errors * rng.standard_normal(4000), errors)
    scattered = pooled(5.0 + np.hypot(errors, 2.0) * rng.standard_normal(4000), errors)
    assert alone.between < 0.3 and abs(alone.mean - 5.0) < 4.0 * alone.error
    assert abs(scattered.between - 2.0) < 0.15 and abs(scattered.mean - 5.0) < 4.0 * scattered.error


def test_equal_values_without_errors_are_no_division_by_zero() -> None:
    same = pooled(np.zeros(5), np.zeros(5))
    assert same.mean == 0.0 and same.distance(0.0, 0.0) == 0.0
    assert change.chart(np.ones(9), np.zeros(9), 200.0, 5).alarm is None


def test_the_threshold_is_that_of_the_tables() -> None:
    # Montgomery, Introduction to Statistical Quality Control, ch. 9, k = 0.5: two-sided ARL 168 at h = 4, 465 at 5
    assert abs(change.threshold(2.0 * 168.0) - 4.0) < 0.02
    assert abs(change.threshold(2.0 * 465.0) - 5.0) < 0.02


def test_false_alarms_are_as_rare_as_asked() -> None:
    rng = np.random.default_rng(2)
    watched = alarms = 0
    for _ in range(200):
        errors = rng.uniform(0.5, 2.0, 50)
        alarm = change.chart(rng.normal(0.0, np.hypot(errors, 1.0)), errors, 100.0, 5).alarm
        alarms += alarm is not None
        watched += 50 if alarm is None else alarm.at + 1
    assert 60.0 < watched / alarms < 400.0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_growing_parameter_is_found_within_three_bags(sign: int) -> None:
    rng = np.random.default_rng(3)
    late, off = [], []
    for _ in range(60):
        values = rng.standard_normal(30)
        values[15:] += sign * 2.5 * np.arange(1, 16)
        alarm = change.chart(values, np.ones(30), 1200.0, 5).alarm
        assert alarm is not None and (alarm.at < 15 or alarm.direction == sign)
        late.append(alarm.at - 14)
        off.append(alarm.onset - 15)
    assert np.median(late) <= 3 and abs(np.median(off)) <= 1


def test_a_line_and_its_crossing_cover_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(4)
    times = np.arange(12.0)
    hits = 0
    for _ in range(400):
        found = trend.line(times, 3.0 + 0.5 * times + rng.standard_normal(12), np.ones(12))
        assert found is not None
        reached = trend.crossing(found, 13.0, 11.0)
        hits += reached is not None and reached.earliest <= 20.0 <= reached.latest
    assert 0.91 < hits / 400 <= 0.995


def test_a_line_that_goes_elsewhere_never_reaches_the_limit() -> None:
    falling = trend.line(np.arange(5.0), 3.0 - np.arange(5.0), np.full(5, 0.1))
    assert falling is not None and trend.crossing(falling, 9.0, 4.0) is None
    assert trend.line(np.arange(2.0), np.arange(2.0), np.ones(2)) is None
    vague = trend.line(np.arange(5.0), np.array([0.0, 1.0, 0.0, 1.0, 0.2]), np.ones(5))
    assert vague is not None
    reached = trend.crossing(vague, 5.0, 4.0)
    assert reached is not None and reached.latest == float("inf")


def test_the_unit_that_is_different_is_named_and_no_other() -> None:
    rng = np.random.default_rng(5)
    found = wrong = 0
    for _ in range(100):
        values = rng.normal(10.0, 1.0, 8)
        values[2] += 10.0
        members = fleet.members([str(i) for i in range(8)], values, np.full(8, 0.3))
        found += members[2].probability > 0.5
        wrong += sum(m.probability > 0.5 for m in members) - (members[2].probability > 0.5)
    assert found >= 90 and wrong <= 25  # of 700
    with pytest.raises(ValueError, match="at least 4"):
        fleet.members(["a", "b", "c"], np.ones(3), np.ones(3))


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten bags of the sample bench, its piston seal worn from the eighth on, and the model file."""
    folder = tmp_path_factory.mktemp("bags")
    model = load_model("sample_bench")
    save_model(model, folder / "model.yaml")
    rng = np.random.default_rng(6)
    t = np.arange(6000) * 1e-3
    for i in range(10):
        values = {LEAKAGE: model.value(LEAKAGE) + (6e-11 if i >= 7 else 0.0)}
        drive = 3.0 * np.sin(2 * np.pi * (0.5 + 0.3 * t) * t + i) + 2.0 * np.sign(np.sin(2 * np.pi * 0.7 * t + i))
        made = Plant(model).with_parameters(values).simulate(drive, 1e-3)
        noisy = [made.position + 2e-5 * rng.standard_normal(6000)]
        noisy += [p + 1.5e4 * rng.standard_normal(6000) for p in (made.pressure_a, made.pressure_b)]
        table = np.column_stack([t, made.drive, *noisy])
        head = "time_s,drive_V,position_m,pressure_a_Pa,pressure_b_Pa"
        np.savetxt(folder / f"bag_{i:02d}.csv", table, "%.9g", ",", header=head, comments="")
    return folder


def test_the_verb_finds_the_worn_seal_and_fits_each_bag_once(
    bags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["--model", str(bags / "model.yaml"), "--record", str(bags / "bag_*.csv"), "--watch", "internal_leakage"]
    call += ["coulomb_friction", "--limit", f"{LEAKAGE}=1e-9 m^3/(s*Pa)", "--out", str(tmp_path)]
    assert monitor_verb.main(call) == 1
    result = json.loads((tmp_path / "monitor.json").read_text())
    leak = result["parameters"][0]
    assert result["changed"] == [LEAKAGE] and leak["key"] == LEAKAGE
    assert leak["alarm"]["onset"] == "bag_07" and leak["alarm"]["direction"] == 1
    assert abs(leak["alarm"]["after"] - 6.05e-11) < 6e-12
    assert "piston seal" in capsys.readouterr().out
    assert "Parameters over time" in (tmp_path / "report.html").read_text()
    before = {f: f.stat().st_mtime_ns for f in tmp_path.glob("monitor_bags/cases/*.json")}
    assert len(before) == 10
    assert monitor_verb.main(call) == 1
    assert before == {f: f.stat().st_mtime_ns for f in tmp_path.glob("monitor_bags/cases/*.json")}


def test_the_fleet_of_records_has_one_unit_out_of_family(bags: Path, tmp_path: Path) -> None:
    units = tmp_path / "units.yaml"
    units.write_text("\n".join(f"unit {i}: [{bags}/bag_{n:02d}.csv]" for i, n in enumerate((0, 1, 2, 3, 4, 8))))
    out = tmp_path / "out"
    call = [str(units), "--model", str(bags / "model.yaml"), "--watch", "internal_leakage", "--out", str(out)]
    assert fleet_verb.main(call) == 1
    result = json.loads((out / "fleet.json").read_text())
    assert result["verdict"]["units"] == ["unit 5"]
    assert result["rows"][0]["unit"] == "unit 5" and result["rows"][0]["probability"] > 0.9


def test_the_fleet_of_a_table(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    rows = [f"u{i},leak,m^3/(s*Pa),{1e-12 * (1.0 + 0.05 * i)},2e-14" for i in range(6)]
    table.write_text("\n".join(["unit,parameter,measure,value,error", *rows]))
    assert fleet_verb.main([str(table), "--out", str(tmp_path / "a")]) == 0
    for bad, complaint in (("u0,leak,m,x,1", "numbers"), ("u0,leak,m,1,-1", "errors from 0"), (rows[0], "twice")):
        table.write_text("\n".join(["unit,parameter,measure,value,error", rows[0], bad]))
        assert fleet_verb.main([str(table), "--out", str(tmp_path / "b")]) == 2, complaint
    table.write_text("unit,value\n")
    assert fleet_verb.main([str(table), "--out", str(tmp_path / "b")]) == 2


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (["--baseline", "2"], "--baseline is 2"),
        (["--limit", "moving_mass=3 kg"], "is not followed"),
        (["--watch", "gravity"], "gravity"),
        (["--workers", "0"], "--workers is 0"),
    ],
)
def test_what_cannot_be_followed_is_said(
    bags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], complaint: str
) -> None:
    call = ["--model", str(bags / "model.yaml"), "--record", str(bags / "bag_*.csv"), "--out", str(tmp_path), *more]
    assert monitor_verb.main(call) == 2
    assert complaint in capsys.readouterr().err


def test_what_wears_is_followed_unless_names_are_given() -> None:
    model = load_model("sample_bench")
    names = estimates.watched(model)
    assert "internal_leakage" in names and "entrained_air" in names and "sensor_delay" not in names
    assert all(model.library[name].wear for name in names)
    free, keys = estimates.followed(model, ["internal_leakage", "moving_mass"])
    assert keys == [LEAKAGE, "moving_mass"] and free.entry(LEAKAGE).bounds == model.parameter(LEAKAGE).bounds
