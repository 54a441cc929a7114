"""The verbs as a user calls them: exit codes, files, messages."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest

from hydraulic_sim.exchange.fmu import compiler
from hydraulic_sim.verbs import export
from hydraulic_sysid.verbs import compare, identify, report

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"
STEPS = str(SAMPLE / "steps.csv.gz")
needs_a_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")


def test_compare_writes_document_and_page_and_prints_the_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert compare.main(["--model", "sample_bench", "--record", STEPS, "--out", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["compare.json", "report.html"]
    printed = capsys.readouterr().out
    assert "0.5 s ahead the model fits position to" in " ".join(printed.split())
    assert str(out / "report.html") in printed
    assert json.loads((out / "compare.json").read_text())["records"][0]["name"] == "steps"


def test_compare_prints_json_that_another_program_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--model", "sample_bench", "--record", STEPS, "--out", str(tmp_path), "--json", "--window", "2", "6"]
    assert compare.main([*arguments, "--horizon", "0.2"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["settings"]["horizon"] == 0.2
    assert result["records"][0]["duration"] == pytest.approx(4.0)
    assert result["records"][0]["channels"]["position"]["horizon"]["rmse"] > 0.0
    assert "traces" not in result["records"][0]


def test_identify_holds_the_last_part_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert identify.main(["--record", STEPS, "--holdout", "0.25", "--out", str(tmp_path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["fit"]["records"][0]["samples"] == 120
    assert result["test"]["records"][0]["samples"] == 40
    assert result["test"]["best_fit_free_run"] > 80.0
    assert result["test"]["best_fit_one_step"] > 95.0
    assert result["test"]["fpe"] > result["fit"]["mse"]
    assert (tmp_path / "report.html").exists()


def test_identify_holds_whole_records_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = str(SAMPLE / "multisine.csv.gz")
    arguments = ["--record", STEPS, "--holdout-record", other, "--order", "2", "2", "1", "--sampling-time", "0.02"]
    assert identify.main([*arguments, "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "identify.json").read_text())
    assert [r["name"] for r in result["test"]["records"]] == ["multisine"]
    assert len(result["model"]["poles"]) == 2
    assert result["settings"]["sampling_time"] == 0.02
    printed = capsys.readouterr().out
    assert "ARX(2, 2, 1) at 20 ms" in printed
    assert "test data" in printed


def test_report_makes_one_page_of_all_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    window = ["--window", "0", "4"]
    assert identify.main(["--record", STEPS, "--out", str(tmp_path), *window]) == 0
    assert compare.main(["--model", "sample_bench", "--record", STEPS, "--out", str(tmp_path), *window]) == 0
    (tmp_path / "report.html").unlink()
    capsys.readouterr()
    assert report.main([str(tmp_path)]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert page.index("Identification ·") < page.index("Model against measurement ·")
    elsewhere = tmp_path / "elsewhere"
    assert report.main([str(tmp_path / "compare.json"), "--out", str(elsewhere)]) == 0
    assert "Identification ·" not in (elsewhere / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "no_such_model", "--record", STEPS], "no_such_model: no such model file"),
        (["--model", "sample_bench", "--record", "nowhere.csv"], "nowhere.csv"),
        (["--model", "sample_bench", "--record", STEPS, "--horizon", "30"], "horizon of 30 s"),
        (["--model", "sample_bench", "--record", STEPS, "--window", "100", "101"], "100 … 101 s"),
    ],
)
def test_compare_says_what_is_wrong_in_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert compare.main([*arguments, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error
    assert len(error.strip().splitlines()) <= 2
    assert not out.exists()


def test_identify_says_which_channel_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--record", STEPS, "--input", "spool", "--out", str(tmp_path / "run")]
    assert identify.main(arguments) == 2
    error = capsys.readouterr().err
    assert "no channel 'spool'" in error
    assert "steps" in error


def test_nothing_is_computed_for_a_folder_that_may_not_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "compare.json").write_text("{}")
    assert compare.main(["--model", "sample_bench", "--record", "nowhere.csv", "--out", str(tmp_path)]) == 2
    assert "compare.json" in capsys.readouterr().err
    assert (tmp_path / "compare.json").read_text() == "{}"


def test_report_of_an_empty_folder_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert report.main([str(tmp_path)]) == 2
    assert "holds no result" in capsys.readouterr().err


def test_unknown_columns_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    strange = tmp_path / "strange.csv.gz"
    with gzip.open(strange, "wt") as stream:
        stream.write("a,b\n0,1\n1,2\n")
    assert compare.main(["--model", "sample_bench", "--record", str(strange), "--out", str(tmp_path / "run")]) == 2
    assert "strange.csv.gz" in capsys.readouterr().err


@needs_a_compiler
def test_an_fmu_is_compared_like_the_model_that_it_comes_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert export.main(["--model", "sample_bench", "--fmu", str(tmp_path / "a.fmu")]) == 0
    capsys.readouterr()
    found = []
    for what in (["--model", "sample_bench"], ["--fmu", str(tmp_path / "a.fmu")]):
        assert compare.main([*what, "--record", STEPS, "--out", str(tmp_path / what[0][2:]), "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    model, fmu = (f["summary"] for f in found)
    assert (found[0]["model"]["fmu"], found[1]["model"]["fmu"]) == (False, True)
    assert set(model) == set(fmu)
    for channel in ("position", "velocity", "load_pressure"):
        for mode in ("free_run", "horizon"):
            assert fmu[channel][mode]["rmse"] == pytest.approx(model[channel][mode]["rmse"], rel=0.05), (channel, mode)
    page = (tmp_path / "fmu" / "report.html").read_text(encoding="utf-8")
    assert "Describe the actuator in a model file" in page and "hydraulic_sysid diagnose" not in page


@needs_a_compiler
def test_compare_refuses_an_fmu_that_has_no_position(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export.main(["--model", "sample_bench", "--fmu", str(tmp_path / "a.fmu")]) == 0
    arguments = ["--fmu", str(tmp_path / "a.fmu"), "--record", STEPS, "--out", str(tmp_path / "run")]
    assert compare.main([*arguments, "--variables", "position=nothing"]) == 2
    assert "no variable 'nothing' for position" in capsys.readouterr().err
    assert compare.main([*arguments[2:], "--model", "sample_bench", "--variables", "position=x"]) == 2
    assert "there is no --fmu" in capsys.readouterr().err
