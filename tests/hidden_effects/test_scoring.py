"""The judge's rules, on made-up diagnoses."""

from __future__ import annotations

import json
from typing import Any

import pytest
from matplotlib.axes import Axes

from hidden_effects import benches, matrix, plant, scoring
from hidden_effects.reliability_diagram import reliability_diagram
from hydraulic_sysid.campaign.outcome import CASES

DEADBAND = {
    "name": "b", "kind": "single", "severity": "mild", "hidden": {"valve_deadband": {"width": 0.02}},
    "companions": [], "subsystems_as_good": [["valve"]], "columns": list(plant.COLUMNS), "setting": {"sized": False},
}  # fmt: skip


def effect(name: str, rank: int = 1, **parameters: tuple[float, float]) -> dict[str, Any]:
    rows = [
        {"key": f"{name}.{k}", "value": v, "standard_error": e, "interval": [v - 1.96 * e, v + 1.96 * e], "unit": "1"}
        for k, (v, e) in parameters.items()
    ]
    return {"name": name, "rank": rank, "added": True, "parameters": rows}


def said(kind: str, *effects: dict[str, Any], others: tuple[str, ...] = (), subsystem: str | None = None):
    tried = [{"name": n, "rank": 10 + i, "added": False, "parameters": []} for i, n in enumerate(others)]
    return {"verdict": {"kind": kind, "text": "", "subsystem": subsystem}, "effects": [*effects, *tried]}


def test_the_right_name_counts_first_only_as_missing():
    right = scoring.judge(DEADBAND, said("missing", effect("valve_deadband")))
    assert right["right_first"] and right["first_three"] and right["nothing_beside"]
    tie = scoring.judge(DEADBAND, said(scoring.TIE, effect("valve_deadband"), others=("backlash",)))
    assert not tie["right_first"] and tie["first_three"]


def test_rank_decides_not_order_and_the_fourth_is_too_late():
    second = said("missing", effect("valve_deadband", 2), effect("backlash", 1))
    marks = scoring.judge(DEADBAND, second)
    assert not marks["right_first"] and marks["first_three"] and not marks["nothing_beside"]
    late = said("missing", effect("backlash"), others=("presliding", "sensor_lag", "valve_deadband"))
    assert not scoring.judge(DEADBAND, late)["first_three"]


@pytest.mark.parametrize("kind", ["complete", "outside the library", "failed"])
def test_other_verdicts_name_nothing(kind):
    marks = scoring.judge(DEADBAND, said(kind, effect("valve_deadband")))
    assert not marks["right_first"] and not marks["first_three"] and marks["parameters"] == []


def test_parameters_are_compared_where_they_are_told():
    near = said("missing", effect("valve_deadband", width=(0.0215, 1e-3)))
    row = scoring.judge(DEADBAND, near)["parameters"][0]
    assert row["near"] and row["covered"] and row["relative_error"] == pytest.approx(0.075)
    far = said("missing", effect("valve_deadband", width=(0.0225, 1e-3)))
    row = scoring.judge(DEADBAND, far)["parameters"][0]
    assert not row["near"] and not row["covered"]
    blind = said("missing", effect("valve_deadband", width=(0.0225, float("nan"))))
    assert scoring.judge(DEADBAND, blind)["parameters"] == []


def test_a_scale_is_judged_by_its_distance_from_one():
    answer = DEADBAND | {"hidden": {"sensor_scale": {"scale": 1.03}}, "subsystems_as_good": [["sensor"]]}
    row = scoring.judge(answer, said("missing", effect("sensor_scale", scale=(1.02, 0.01))))["parameters"][0]
    assert row["relative_error"] == pytest.approx(-1 / 3) and not row["near"]


def test_pairs_unknowns_and_nothing():
    pair = DEADBAND | {"kind": "pair", "hidden": {"valve_deadband": {}, "entrained_air": {}}}
    both = scoring.judge(pair, said("missing", effect("entrained_air"), effect("valve_deadband", 2)))
    one = scoring.judge(pair, said("missing", effect("entrained_air")))
    assert both["both_found"] and not one["both_found"] and one["one_found"]
    three = pair | {"kind": "triple", "hidden": pair["hidden"] | {"presliding": {}}}
    two = said("missing", effect("entrained_air"), effect("valve_deadband", 2))
    assert not scoring.judge(three, two)["three_found"]
    faint = three | {"visible": ["valve_deadband", "entrained_air"]}  # what the records do not show is not asked for
    shown = scoring.judge(faint, two)
    beside = scoring.judge(faint, said("missing", effect("entrained_air"), effect("backlash", 2)))
    assert shown["three_found"] and shown["only_true"] and not beside["three_found"] and not beside["only_true"]
    assert scoring.rates([shown, beside])["three_found"] == (1, 2)
    unknown = DEADBAND | {"kind": "unknown", "hidden": {"hose_creep": {}}, "subsystems_as_good": [["fluid", "flow"]]}
    marks = scoring.judge(unknown, said(scoring.OUTSIDE, subsystem="flow"))
    assert marks["said_so"] and marks["right_subsystem"]
    none = DEADBAND | {"kind": "none", "hidden": {}}
    alarm = scoring.judge(none, said("missing", effect("backlash")))
    quiet = scoring.judge(none, said("complete"))
    assert scoring.rates([alarm, quiet])["false_alarms"] == (1, 2)


def test_verdicts_are_counted_by_the_probability_that_they_state():
    def judged(probability: float | None, name="valve_deadband", kind="missing", tied: tuple[str, ...] = ()):
        found = said(kind, effect(name))
        found["verdict"] |= {"probability": probability, "effects": [name, *tied]}
        return scoring.judge(DEADBAND, found)

    marks = [judged(0.96), judged(0.97), judged(0.98, "backlash"), judged(0.6), judged(None)]
    assert scoring.reliability(marks) == [(0.5, 0.8, 1, 1, 0.6), (0.95, 0.99, 2, 3, pytest.approx(0.97))]
    assert scoring.rates(marks)["sure"] == (2, 3)
    ties = [judged(0.96, "backlash", scoring.TIE, ("valve_deadband",)), judged(0.96, "backlash", scoring.TIE)]
    assert [t["verdict_right"] for t in ties] == [True, False]
    assert scoring.rates(ties)["true_among"] == (1, 2)
    rows = matrix.reliability_rows([{"marks": m} for m in marks])
    assert rows[2:] == ["| 50…80 % | 60 % | 1 | 1 = 100 % | 21…100 % |", "| 95…99 % | 97 % | 3 | 2 = 67 % | 21…94 % |"]


def test_the_reliability_diagram_shows_every_bin(tmp_path, monkeypatch):
    said = ((0.97, True), (0.96, False), (0.6, True), (None, False))
    marks = [{"probability": p, "verdict_right": right} for p, right in said]
    drawn = []
    plot = Axes.errorbar

    def errorbar(self, x, y, yerr, **style):
        drawn.append((x, y, yerr))
        return plot(self, x, y, yerr, **style)

    monkeypatch.setattr(Axes, "errorbar", errorbar)
    assert reliability_diagram(marks, tmp_path / "r.png").stat().st_size > 5000
    low, high = scoring.wilson(1, 2)
    assert drawn == [
        (60.0, 100.0, [[pytest.approx(100 - 100 * scoring.wilson(1, 1)[0])], [pytest.approx(0.0, abs=1e-9)]]),
        (pytest.approx(96.5), 50.0, [[pytest.approx(50 - 100 * low)], [pytest.approx(100 * high - 50)]]),
    ]
    with pytest.raises(ValueError, match="nothing to draw"):
        reliability_diagram([{"probability": None, "verdict_right": True}], tmp_path / "none.png")


def test_wilson_interval():
    low, high = scoring.wilson(9, 10)
    assert (low, high) == (pytest.approx(0.5958, abs=1e-4), pytest.approx(0.9821, abs=1e-4))
    assert scoring.wilson(0, 0) == (0.0, 1.0)


def test_selection_and_page(tmp_path):
    chosen = matrix.select("single", "mild", ["valve_deadband"])
    assert [b.name for b in chosen] == ["valve_deadband-mild-s1"]
    assert [b.name for b in matrix.select("single", "mild", ["valve_deadband"], [7])] == ["valve_deadband-mild-s7"]
    assert {b.kind for b in matrix.select(only=["none"])} == {"none"}
    with pytest.raises(ValueError, match="gravity"):
        matrix.select(only=["gravity"])
    bench = benches.Bench("single", ("valve_deadband",), "mild", 1)
    width = bench.truth()["valve_deadband"]["width"]
    marks = scoring.judge(bench.answer(), said("missing", effect("valve_deadband", width=(width, 1e-4))))
    outcome = {"answer": bench.answer(), "marks": marks, "cpu_seconds": 12.0, "peak_MiB": 300.0}
    page = matrix.document([outcome])
    assert "benchmarks/diagnosis_matrix.py --doc" in page and "| valve_deadband | 1 | valve_deadband |" in page
    assert "| one hidden effect: right name first | ≥ 92 % | 1/1 = 100 % | 21…100 % |" in page
    assert matrix.kept(tmp_path) == []
    (tmp_path / CASES).mkdir()
    for quick, version in ((False, matrix.version()), (True, matrix.version()), (False, "another")):
        row = outcome | {"version": version, "quick": quick}
        (tmp_path / CASES / f"{quick}-{version}.json").write_text(json.dumps({"state": "done", "row": row}))
    assert [d["quick"] for d in matrix.kept(tmp_path)] == [False]
    assert [d["quick"] for d in matrix.kept(tmp_path, quick=True)] == [True]
