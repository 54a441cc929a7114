"""diagnose and add on the records that come with the project, which an independent plant made (a hidden dead band)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hostile_page import assert_cannot_inject

from hydraulic_sim.model_file import load_model
from hydraulic_sysid.diagnosis.search import Diagnosis
from hydraulic_sysid.diagnosis.search.holdout import QUICK_VALUES
from hydraulic_sysid.report import render
from hydraulic_sysid.verbs.add import main as add_main
from hydraulic_sysid.verbs.diagnose import main as diagnose_main

RECORDS = Path(__file__).parents[2] / "examples" / "sample_bench"
pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("diagnosed")
    assert diagnose_main(["--model", "sample_bench", "--record", str(RECORDS), "--apply", "--out", str(out)]) == 0
    return out


def test_the_hidden_dead_band_is_found_and_its_width_too(run: Path) -> None:
    found = json.loads((run / "diagnose.json").read_text())
    assert found["schema"] == "hydraulic_sysid.diagnose/2"
    assert found["verdict"]["kind"] == "missing"
    assert found["verdict"]["effects"] == ["valve_deadband"]
    assert found["verdict"]["subsystem"] == "valve"
    first = found["effects"][0]
    assert (first["name"], first["rank"], first["added"]) == ("valve_deadband", 1, True)
    assert first["residual_before"] > 3.0 > 1.1 > first["residual_after"]
    width = first["parameters"][0]
    assert width["value"] == pytest.approx(0.03, rel=0.02) and width["standard_error"] > 0.0
    assert [s["name"] for s in found["residual"]["after_each_effect"]] == ["valve_deadband"]
    assert len(found["effects"]) == len({e["name"] for e in found["effects"]}) > 30
    assert {f["severity"] for f in found["check"]} <= {"note"}
    assert {b["name"] for b in found["balances"]} >= {"force", "flow_a", "flow_b"}
    assert set(found["noise_std"]) == {"position", "pressure_a", "pressure_b"}


@pytest.mark.thorough
def test_a_quick_look_at_a_part_of_the_records_finds_it_too(run: Path, tmp_path: Path) -> None:
    assert diagnose_main(["--model", "sample_bench", "--record", str(RECORDS), "--quick", "--out", str(tmp_path)]) == 0
    whole, quick = (json.loads((folder / "diagnose.json").read_text()) for folder in (run, tmp_path))
    assert quick["verdict"]["effects"] == ["valve_deadband"]
    assert quick["settings"]["values_used"] < 1.2 * QUICK_VALUES < whole["settings"]["values_used"]
    assert quick["settings"]["quick"] and not whole["settings"]["quick"]
    assert whole["balances"] and not quick["balances"], "what only confirms is left out"
    names = [{r["name"] for r in found["records"]} for found in (whole, quick)]
    assert names[0] == names[1], "a record was left out"


def test_why_not_the_runner_up_is_said_with_its_figure(run: Path) -> None:
    found = json.loads((run / "diagnose.json").read_text())
    second = found["competing_models"]["valve_deadband"][0]
    assert second["distinguishable"] and second["residual_after"] > 2.0
    assert f"{second['name']} instead of valve_deadband leaves" in found["verdict"]["text"]


def test_a_verdict_states_the_probability_of_what_it_names(run: Path) -> None:
    found = json.loads((run / "diagnose.json").read_text())
    named = [e for e in found["explanations"] if e["named"]]
    assert [e["effects"] for e in named] == [["valve_deadband"]]
    assert 0.5 < found["verdict"]["probability"] == named[0]["probability"] < 1.0
    assert found["verdict"]["text"].endswith(f"probability of this verdict is {100 * named[0]['probability']:.0f} %.")
    assert sum(e["probability"] for e in found["explanations"]) == pytest.approx(1.0)


def test_the_model_that_was_written_has_the_effect_and_says_where_from(run: Path) -> None:
    model = load_model(run / "model.yaml")
    assert "valve_deadband" in model.effects
    assert model.entry("valve_deadband.width").standard_error
    line = model.history[-1]
    assert line["change"] == "added valve_deadband" and line["error_after"] < line["error_before"]


def test_the_page_shows_what_the_document_holds(run: Path) -> None:
    page = (run / "report.html").read_text()
    for word in ("The error falls", "Before and after", "Explanations", "Competing models", "valve_deadband"):
        assert word in page
    assert_cannot_inject(json.loads((run / "diagnose.json").read_text()))


CURVE = {
    "place": "valve",
    "subsystem": "valve",
    "summary": "opening of any shape",
    "variable": "size_of_opening",
    "unit": "1",
    "explained_share": 0.4,
    "knots": [0.0, 0.5, 1.0],
    "value": [0.0, 0.1, 0.1],
    "low": [-0.1, 0.0, 0.0],
    "high": [0.1, 0.2, 0.2],
}
NUMBER = {
    "key": "supply_pressure",
    "unit": "Pa",
    "nominal": 14e6,
    "value": 15.81e6,
    "standard_error": 1e4,
    "chi_square_difference": 4e3,
    "instead": ["backlash"],
    "alternatives": [{"key": "piston_area_a"}],
}
CONTRADICTION = {"severity": "contradiction", "text": "The travel is too long.", "remedy": "Mend the stroke."}
DATA_SHEET = {"data_sheet": [NUMBER]}
FAULT = {
    "name": "drive",
    "channels": ["position"],
    "size": -1e-3,
    "unit": "s",
    "standard_error": 1e-5,
    "text": "the drive was late",
    "remedy": "mend it",
}
SPIKES = {"channel": "pressure_a", "count": 3, "share": 1e-3, "places": [{"record": "steps", "time": 1.5}]}
GAIN = {
    "faults": [],
    "instead": [{"text": "pressure_a reads 5 % too much", "remedy": "calibrate it"}],
    "spikes": [],
    "set_aside": [],
    "mains_lines": {},
}
RECORDING = {"recording": {"faults": [FAULT], "spikes": [SPIKES], "mains_lines": {"pressure_a": [50.0]}}}
OUTSIDE = {"nonparametric_curves": [CURVE], "nearest_effects": ["backlash"]}
PROPOSED = {
    "proposed_effect": {
        "name": "own",
        "file": "/tmp/own effect.py",
        "place": "unknown_force",
        "subsystem": "force",
        "variable": "position",
        "law": "kink",
        "explained_share": 0.98,
        "beside": ["stribeck_friction"],
    }
}
SHOWN = {"summary": "a force of any shape", "unit": "N", "lag": 0.0157, "knots": [-0.1, 0.1], "value": [0.0, 5.0]}
SWING = {"place": "unknown_force", "subsystem": "force", "frequency": 1.85, "amplitude": 555.0, "share": 0.96}
PERIODIC = {"periodic_inputs": [SWING | {"summary": "a force of any shape", "unit": "N"}]}
PROPOSED_LAW = {"proposed_effect": PROPOSED["proposed_effect"] | SHOWN}


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        (
            "outside the library",
            OUTSIDE,
            "The shape of what is left; 40.0\u00a0%; library: backlash; --propose my_effect.py",
        ),
        (
            "outside the library",
            OUTSIDE | PROPOSED,
            "Add stribeck_friction to the model first; add &#39;/tmp/own effect.py&#39;",
        ),
        (
            "outside the library",
            OUTSIDE | PROPOSED_LAW,
            "proposed; plant: a force of any shape over the position; 15.7\u00a0ms late; To first order",
        ),
        (
            "outside the library",
            OUTSIDE | PERIODIC,
            "Look for what runs at 1.85\u00a0Hz beside the bench; What swings of itself; 0.555\u00a0kN; 96.0\u00a0%",
        ),
        ("indistinguishable", {}, "The error falls; next_experiment --diagnosis"),
        ("indistinguishable", {"recording": GAIN}, "Look whether pressure_a reads 5 % too much: calibrate it."),
        ("complete", {"competing_models": {}, "balances": []}, "Measured and simulated; Nothing has to be added"),
        ("undecided", {}, "Let it search to its end; The error falls"),
        ("complete", {"check": [CONTRADICTION]}, "First: The travel is too long. Mend the stroke."),
        (
            "data sheet",
            DATA_SHEET,
            "Ask for the true supply_pressure or piston_area_a: the records cannot say; 158.1; backlash, piston_area_a",
        ),
        ("recording", RECORDING, "The drive was late: mend it.; Look for a loose contact; Spikes in pressure"),
    ],
)
def test_the_page_of_every_verdict_says_what_to_do(run: Path, kind: str, change: dict[str, Any], words: str) -> None:
    document = json.loads((run / "diagnose.json").read_text())
    document["verdict"] |= {"kind": kind, "periodic": "periodic_inputs" in change}
    if kind == "complete":
        document["residual"]["after_each_effect"] = []
    page = render([{**document, **change}])
    assert [word for word in words.split("; ") if word not in page] == []
    assert ("of what the noise did not explain before" in page) is (kind != "complete")


def test_contradictions_are_warnings_on_top_of_the_answer(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    document = {**json.loads((run / "diagnose.json").read_text()), "check": [CONTRADICTION]}
    found = Diagnosis(load_model("sample_bench"), {}, document)
    monkeypatch.setattr("hydraulic_sysid.verbs.diagnose.diagnose", lambda *_: found)
    assert diagnose_main(["--model", "sample_bench", "--record", str(RECORDS), "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.startswith("warning: The travel is too long. Mend the stroke.\n")


@pytest.mark.parametrize(
    ("kind", "competing", "written"),
    [
        ("missing", (), ["model.yaml"]),
        ("data sheet", (), ["model.yaml"]),
        ("complete", (), ["model.yaml"]),
        (
            "indistinguishable",
            ("valve_deadband", "backlash"),
            ["competing_backlash.yaml", "competing_valve_deadband.yaml"],
        ),
        ("outside the library", (), []),
    ],
)
def test_apply_writes_what_the_verdict_says(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    kind: str, competing: tuple[str, ...], written: list[str],
) -> None:  # fmt: skip
    document = json.loads((run / "diagnose.json").read_text())
    document["verdict"]["kind"] = kind
    model = load_model(run / "model.yaml")
    monkeypatch.setattr(
        "hydraulic_sysid.verbs.diagnose.diagnose",
        lambda *_: Diagnosis(model, dict.fromkeys(competing, model), document),
    )
    command = ["--model", "sample_bench", "--record", str(RECORDS), "--out", str(tmp_path), "--apply"]
    assert diagnose_main(command) == (0 if "model.yaml" in written else 1)
    assert sorted(f.name for f in tmp_path.glob("*.yaml")) == written
    assert ("no model.yaml was written" in capsys.readouterr().err) == ("model.yaml" not in written)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("there.py", "never overwritten"),
        ("coulomb_friction.py", "has an effect coulomb_friction already"),
        ("no-name.py", "allowed is NAME.py"),
        ("class.py", "allowed is NAME.py"),
        ("effect.txt", "allowed is NAME.py"),
    ],
)
def test_where_no_effect_can_be_proposed_is_said_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, complaint: str
) -> None:
    (tmp_path / "there.py").write_text("mine")
    command = ["--model", "sample_bench", "--record", str(RECORDS), "--out", str(tmp_path / "out")]
    assert diagnose_main([*command, "--propose", str(tmp_path / name)]) == 2
    assert complaint in capsys.readouterr().err
    assert (tmp_path / "there.py").read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


def test_nothing_is_proposed_where_the_library_explains_the_records(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = Diagnosis(load_model(run / "model.yaml"), {}, json.loads((run / "diagnose.json").read_text()))
    monkeypatch.setattr("hydraulic_sysid.verbs.diagnose.diagnose", lambda *_: found)
    command = ["--model", "sample_bench", "--record", str(RECORDS), "--out", str(tmp_path / "out")]
    assert diagnose_main([*command, "--propose", str(tmp_path / "own.py")]) == 0
    assert "own.py was not written: the verdict is 'missing'" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_nothing_but_what_was_found_has_changed_in_the_model(run: Path) -> None:
    before, after = load_model("sample_bench"), load_model(run / "model.yaml")
    assert set(after.effects) - set(before.effects) == {"valve_deadband"}
    fitted = before.movable_keys()
    for key, entry in before.entries.items():
        assert (after.entries[key].free, after.entries[key].bounds) == (entry.free, entry.bounds), key
        assert key in fitted or after.value(key) == entry.value, key


def test_a_model_is_never_overwritten(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert diagnose_main(["--model", "sample_bench", "--record", str(RECORDS), "--apply", "--out", str(run)]) == 2
    assert "never overwritten" in capsys.readouterr().err


def test_add_fits_an_effect_and_says_whether_the_data_bear_it_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = [str(p) for p in sorted(RECORDS.glob("*.csv.gz"))]
    command = ["--model", "sample_bench", "--record", *records[:1], "--holdout", records[1], "--json"]
    assert add_main(["valve_deadband", *command, "--out", str(tmp_path / "right")]) == 0
    done = json.loads(capsys.readouterr().out)
    assert done["verdict"]["kind"] == "confirmed" and "probability" not in done["verdict"]
    assert [r["name"] for r in done["records"] if r["role"] == "test"] == done["test"]["records"]
    assert done["test"]["after"] < 1.05 < 1.5 < done["test"]["before"]
    assert "On unseen data" in done["verdict"]["text"]
    assert_cannot_inject(json.loads((tmp_path / "right" / "add.json").read_text()))
    assert done["residual"]["after"]["validation"] < 1.05 < 1.5 < done["residual"]["before"]["validation"]
    assert "valve_deadband" in load_model(tmp_path / "right" / "model.yaml").effects
    steering = ["--validation" if word == "--holdout" else word for word in command]
    assert add_main(["valve_deadband", *steering, "--out", str(tmp_path / "steered")]) == 0
    steered = json.loads(capsys.readouterr().out)
    assert [r["name"] for r in steered["records"] if r["role"] == "validation"] == done["test"]["records"]
    assert "Nothing was left to test on" in steered["verdict"]["text"] and steered["test"] is None
    assert add_main(["no_such_effect", *command, "--out", str(tmp_path / "none")]) == 2
    assert "no_such_effect" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
