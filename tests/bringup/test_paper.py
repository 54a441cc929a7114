"""The paper's study on the model: its figures are reached, and its thesis holds on data and over the grid."""

from __future__ import annotations

import contextlib
import io
import json
import math
from pathlib import Path
from typing import Any

import pytest
from hostile_page import assert_cannot_inject

from hydraulic_bringup.paper import printed, study
from hydraulic_bringup.verbs import paper

pytestmark = pytest.mark.timeout(900)  # twenty seconds on an idle machine


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """The whole study, rehearsed: folder, document, and what it prints."""
    out = tmp_path_factory.mktemp("study") / "run"
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert paper.main(["--rehearse", "--out", str(out)]) == 0
    return out, json.loads((out / "paper.json").read_text(encoding="utf-8")), said.getvalue()


def test_the_best_fits_of_the_paper_are_reached_on_test_data(run: Any) -> None:
    rows = {r["excitation"]: r for r in run[1]["models"]}
    assert rows["multisine"]["best_fit"] >= printed.BEST_FIT["multisine"] == 99.17
    assert rows["chirp"]["best_fit"] >= printed.BEST_FIT["chirp"] == 98.79
    assert rows["chirp"]["model"] == "ARX(3, 3, 1)" and rows["chirp"]["sampling_time"] == 0.05
    assert rows["multisine"]["model"] == "third-order transfer function"
    assert all(r["fpe_mm2"] > r["mse_mm2"] > 0.0 for r in rows.values())


def test_records_splits_and_bands_are_those_of_the_paper(run: Any) -> None:
    bandwidth = run[1]["bandwidth"]["position"]
    by_name = {e["name"]: e for e in run[1]["excitations"]}
    for kind, held_from in (("chirp", 40.0), ("multisine", 25.0)):
        assert by_name[kind]["duration"] == pytest.approx(50.0)
        assert by_name[kind]["test_from"] == pytest.approx(held_from)
    chirp, tones = by_name["chirp"]["plan"]["signal"], by_name["multisine"]["plan"]["signal"]
    assert [chirp["frequency_start"], chirp["frequency_end"]] == pytest.approx([0.1 * bandwidth, 2.0 * bandwidth])
    assert tones["frequencies"] == pytest.approx([0.1 * bandwidth, 0.5 * bandwidth, 2.0 * bandwidth])
    assert all(e["prediction"]["limited_by"] in ("velocity", "travel") for e in by_name.values())


def test_the_thesis_excitation_outside_the_band_is_worse(run: Any) -> None:
    rows = {r["name"]: r for r in run[1]["thesis"]["rows"]}
    for kind in study.KINDS:
        for band in ("below", "above"):
            other = rows.get(f"{kind}_{band}")
            assert other is not None or f"{kind}_{band}" in run[1]["not_fitted"]
            if other is not None and other["best_fit_in_band"] is not None:
                assert other["best_fit_in_band"] < rows[kind]["best_fit_in_band"]
                assert other["rmse"] > rows[kind]["rmse"]
    assert run[1]["thesis"]["holds"] == {kind: {"best_fit": True, "rmse": True} for kind in study.KINDS}


def test_every_rmse_of_the_grid_is_printed(run: Any) -> None:
    _, document, said = run
    assert {c["shape"] for c in document["grid"]} == {"triangle", "square", "sine", "sawtooth"}
    assert len(document["grid"]) == 4 * len(study.AMPLITUDES_V) * len(study.FREQUENCIES)
    assert all(cell["within_travel"] for cell in document["grid"])
    for cell in document["grid"]:
        for kind in study.KINDS:
            assert f"{1e3 * cell['models'][kind]['rmse']:.3f}" in said
    shapes = ("triangle", "square", "sine", "sawtooth")
    assert [r["name"] for r in document["recorded"]] == [f"validation_{s}" for s in shapes]
    for row in document["recorded"]:
        assert all(math.isfinite(row["models"][kind]["rmse"]) for kind in study.KINDS)


def test_what_the_reviewed_works_did_is_done_here(run: Any) -> None:
    rows = {(r["authors"], r["excitation"]): r for r in run[1]["reviewed"]}
    assert len(rows) == len(printed.REVIEWED) == 6
    for authors, excitation, fit in (
        ("Rahmat 2010", "multisine", 92.8), ("Izzuddin 2015", "multisine", 95.86), ("Izzuddin 2015", "step", 94.67),
        ("Ishak 2006", "multisine", 91.16),
    ):  # fmt: skip
        row = rows[authors, excitation]
        assert row["printed_best_fit"] == fit and not row["why"]
        assert row["best_fit"] >= fit, "a plant that is simulated has no less to offer"
        assert f"({fit:g} %)" in run[2]
    assert rows["Rahmat 2010", "multisine"]["model"] == "ARX(4, 4, 1)"
    assert rows["Ren 2018", "chirp"]["model"] == "fourth-order transfer function"
    assert all(r["best_fit_one_step"] is None or r["best_fit_one_step"] > 90.0 for r in rows.values())


def test_the_papers_figures_stand_beside_ours(run: Any) -> None:
    said = " ".join(run[2].split())
    for figure in ("98.79 %", "99.17 %", "0.00301", "0.002918", "92.8 %", "(0.28)", "(4.3)"):
        assert figure in said
    assert len(run[1]["left_out"]) == len(printed.LEFT_OUT)
    page = (run[0] / "report.html").read_text(encoding="utf-8")
    assert "Excitation from the bandwidth" in page and "What the paper leaves out" in page
    assert_cannot_inject(run[1])


def test_the_models_are_left_for_the_controller(run: Any) -> None:
    from hydraulic_control.identified import load_identified

    for kind in study.KINDS:
        assert load_identified(run[0] / "models" / f"{kind}.json").velocity_gain == pytest.approx(0.0434, rel=0.02)
    rows = {r["where"]: r for r in run[1]["control"]["rows"]}
    assert rows["nonlinear, chirp"]["printed"] == {"rise_time": 0.28, "settling_time": 2.2, "overshoot": 4.8}
    assert all(r["rise_time"] is not None for r in rows.values())


def test_an_unstable_model_counts_as_worse() -> None:
    rows = [
        {"excitation": kind, "band": band, "best_fit_in_band": fit, "rmse": rmse}
        for kind in study.KINDS
        for band, fit, rmse in (("in", 99.0, 1e-3), ("below", math.nan, math.nan), ("above", 98.0, 2e-3))
    ]
    from hydraulic_bringup.paper.document import holds

    assert holds(rows) == {kind: {"best_fit": True, "rmse": True} for kind in study.KINDS}
    rows[2]["rmse"] = 0.5e-3
    assert holds(rows)["chirp"] == {"best_fit": True, "rmse": False}


def test_bad_options_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").write_text("")
    assert paper.main(["--rehearse", "--out", str(tmp_path / "full")]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert paper.main(["--rehearse", "--model", "nobody", "--out", str(tmp_path / "new")]) == 2
    assert "no such model file" in capsys.readouterr().err
