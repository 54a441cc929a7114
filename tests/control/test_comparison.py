"""Controllers side by side: trials with disturbances, the delay that is borne, tables and page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_control import gains_file
from hydraulic_control.comparison import claim_cells, claims, compare, delay_margin
from hydraulic_control.comparison_page import page
from hydraulic_control.simulation import BEGIN_S, QUIET, SensorNoise
from hydraulic_control.trials import TRIALS, trials_of
from hydraulic_control.verbs import evaluate
from hydraulic_sim.model_file import load_model

MODEL = load_model("moog_mcr_m_1002_bench")
PID, NPID = gains_file.load("pid"), gains_file.load("npid")


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    controllers = {"pid": PID, "<b>npid": NPID, "hopeless": {"controller": "pid", "kp": 1e5}}
    return compare(controllers, MODEL, 1, 7, 0.05, SensorNoise())


def test_every_trial_has_figures_of_every_controller(document: dict[str, Any]) -> None:
    assert set(document["descriptions"]) == set(TRIALS)
    for name in ("pid", "<b>npid"):
        for trial, found in document["controllers"][name]["trials"].items():
            assert found["ran_away"] == 0 and found["nominal"]["rms_error"] <= 2.0 * found["worst"]["rms_error"], trial
            assert ("rise_time" in found["nominal"]) == TRIALS[trial].is_step
            assert len(found["response"]["time"]) == len(found["response"]["position"]) > 1000
    good, bad = (document["controllers"][name]["delay_margin"] for name in ("pid", "hopeless"))
    assert good > 0.01 > bad


def test_what_is_published_stands_beside_what_was_measured(document: dict[str, Any]) -> None:
    rows = {(row["controller"], row["text"]): row for row in claims(document)}
    npid = document["controllers"]["<b>npid"]["trials"]["step"]["median"]
    (settles,) = (row for (name, text), row in rows.items() if name == "<b>npid" and "settles" in text)
    assert settles["measured"] == npid["settling_time"] and settles["holds"]
    (alike,) = (row for (name, _), row in rows.items() if name == "pid")
    trials = document["controllers"]["pid"]["trials"]["step"]
    assert alike["measured"] == trials["worst"]["rise_time"] / trials["nominal"]["rise_time"]
    assert claim_cells(settles)[3:] == (f"{npid['settling_time']:.2g}", "≤ 3", "holds")


def test_a_claim_over_a_law_that_was_not_tried_stays_open(document: dict[str, Any]) -> None:
    law = {**document["controllers"]["pid"], "values": {"controller": "mrac"}}
    alone = {**document, "controllers": {"mrac": law}}
    assert [(row["measured"], row["holds"]) for row in claims(alone)] == [(None, None)]
    both = {**document, "controllers": {"mrac": law, "pid": document["controllers"]["pid"]}}
    (row,) = (row for row in claims(both) if row["controller"] == "mrac")
    assert row["measured"] == 1.0 and row["holds"]
    assert claim_cells(row)[2] == "rms error, sine, over that of pid"


def test_a_disturbance_comes_when_it_is_said_to() -> None:
    held = TRIALS["load_step"].response(PID, MODEL, 0.05, QUIET, 0)
    before = np.abs(held.position[held.time < 0.3]).max()
    assert np.abs(held.position[held.time > 0.3]).max() > 10.0 * before
    dropped = TRIALS["supply_drop"].response(PID, MODEL, 0.05, QUIET, 0)
    same = TRIALS["sine"].response(PID, MODEL, 0.05, QUIET, 0)
    early, count = dropped.time < 2.5, int(np.sum(dropped.time < 2.5))
    assert np.array_equal(dropped.position[early], same.position[:count]) and count > 400
    late = slice(count + 200, min(len(same.time), len(dropped.time)))
    assert np.abs(dropped.drive[late]).max() > 1.1 * np.abs(same.drive[late]).max()


def test_an_axis_without_oil_is_not_disturbed_in_it(tmp_path: Path) -> None:
    file = tmp_path / "axis.yaml"
    known = {"moving_mass": "100 kg", "stroke": "1 m", "drive_limit": "10 V", "drive_force": "50 N/V"}
    numbers = ", ".join(f"{name}: {{value: {value}}}" for name, value in known.items())
    file.write_text(f"format: hydraulic-model-1\nname: axis\nplant: mechanical\nparameters: {{{numbers}}}\n")
    axis = load_model(file)
    assert set(TRIALS) - set(trials_of(axis)) == {"supply_drop", "leakage"}
    assert set(trials_of(MODEL)) == set(TRIALS)
    loads = [model.value("constant_load.load") for _, model in TRIALS["load_step"].changes(axis)]
    assert loads == [0.0, pytest.approx(-50.0)], "a tenth of what the drive can push"


def test_figures_are_of_what_comes_after_the_start() -> None:
    assert TRIALS["step"].response(PID, MODEL, 0.05, QUIET, 0).time[0] == pytest.approx(-2e-3)
    assert TRIALS["sine"].response(PID, MODEL, 0.05, QUIET, 0).time[0] == pytest.approx(2.0)
    assert BEGIN_S >= 0.5


def test_a_loop_that_is_damped_bears_more_delay() -> None:
    assert delay_margin(PID, MODEL, 0.05) > delay_margin({**PID, "kp": 8.0 * PID["kp"]}, MODEL, 0.05)


def test_the_page_needs_nothing_and_lets_no_markup_through(document: dict[str, Any]) -> None:
    text = page(document)
    assert "<b>npid" not in text and "&lt;b&gt;npid" in text
    assert "<script src" not in text and "http-equiv" not in text
    assert text.count("<h2>") - 1 == text.count("data-figure=") - text.count("[data-figure=") == len(TRIALS)
    assert "What is published" in text and "almost alike in simulation" in text
    assert 'data-value="Infinity"' in text, "what is hopeless does not settle"


def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "laws.html"
    options = ["--gains", "pid", "npid", "--trials", "1", "--page", str(place), "--sort", "settling_time"]
    assert evaluate.main(options) == 0
    said = capsys.readouterr().out
    assert all(f"{name}: " in said for name in TRIALS) and str(place) in said
    assert place.stat().st_size > 1e6
    assert evaluate.main(options) == 2, "nothing is overwritten"
    capsys.readouterr()
    assert evaluate.main(["--gains", "pid", "--trials", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["controllers"]["pid"]["trials"]["step"]["worst"] is None
    twins = [tmp_path / folder / "pid.yaml" for folder in ("a", "b")]
    for twin in twins:
        twin.parent.mkdir()
        twin.write_bytes(gains_file.find("pid").read_bytes())
    assert evaluate.main(["--gains", *map(str, twins), "--trials", "0", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["controllers"]) == set(map(str, twins)), "none is lost"
    assert evaluate.main(["--trials", "1", "--scatter", "2"]) == 2
    assert "--scatter" in capsys.readouterr().err
    assert evaluate.main(["--page", str(tmp_path / "other.html")]) == 2
    assert "--trials" in capsys.readouterr().err
