"""The verb validate: grid and records, document and page, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.linear.models import Arx, ArxOrder, TransferFunction, write_linear_model
from hydraulic_sysid.linear.validation import Grid
from hydraulic_sysid.linear.validation.validate import Subject, validate
from hydraulic_sysid.report import render
from hydraulic_sysid.verbs import validate as verb

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"
ENDS = {"input": {"channel": "drive", "unit": "V"}, "output": {"channel": "position", "unit": "m"}}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A good model and a poor one, fitted to a run of the bench's preset."""
    folder = tmp_path_factory.mktemp("models")
    t = 1e-3 * np.arange(10_000)
    u = 2.0 * sum(np.sin(2 * np.pi * f * t + p) for f, p in ((0.15, 0.0), (0.75, 1.0), (3.0, 2.0)))
    y = Plant(load_model("moog_mcr_m_1002_bench")).simulate(u, 1e-3)["position"]
    good = TransferFunction().fit([u], [y], 1e-3, "estimate")
    poor = Arx(ArxOrder(1, 1, 1)).fit([u[::50]], [0.5 * y[::50]], 0.05, "estimate")
    return [
        str(write_linear_model(folder / f"{n}.json", m, name=n, **ENDS)) for n, m in (("good", good), ("poor", poor))
    ]


def test_grid_and_records_in_one_document_and_on_one_page(files: list[str], tmp_path: Path, capsys) -> None:
    arguments = ["--linear-model", *files, "--model", "moog_mcr_m_1002_bench", "--amplitudes", "1", "3"]
    arguments += ["--frequencies", "1", "--shapes", "sine", "square", "--record", str(SAMPLE / "steps.csv.gz")]
    assert verb.main([*arguments, "--out", str(tmp_path)]) == 0
    result = results.read_result(tmp_path / "validate.json")
    assert len(result["grid"]) == 4 and [r["name"] for r in result["records"]] == ["steps"]
    for cell in result["grid"]:
        assert cell["models"]["good"]["rmse"] < 0.1 * cell["models"]["poor"]["rmse"]
    assert result["summary"]["good"]["drives"] == 4
    assert result["summary"]["poor"]["worst"]["best_fit"] < 60.0
    one_step = result["records"][0]["models"]["poor"]
    assert one_step["best_fit_one_step"] > one_step["best_fit"]
    assert one_step["residual_tests"]["confidence"] == 0.99
    page = (tmp_path / "report.html").read_text()
    assert "Validation of identified models" in page and "good fits best" in page
    assert_cannot_inject(result)
    printed = " ".join(capsys.readouterr().out.split())
    assert "square 3 V 1 Hz" in printed and result["verdict"]["text"] in printed


def test_an_unstable_model_has_no_figures_and_is_still_shown(files: list[str], tmp_path: Path) -> None:
    content = json.loads(Path(files[1]).read_text())
    content["name"], content["estimate"]["a"] = "wild", [-1.5]
    (tmp_path / "wild.json").write_text(json.dumps(content))
    out = tmp_path / "out"
    arguments = ["--linear-model", files[0], str(tmp_path / "wild.json"), "--model", "moog_mcr_m_1002_bench"]
    assert verb.main([*arguments, "--amplitudes", "1", "--frequencies", "1", "--out", str(out)]) == 0
    result = results.read_result(out / "validate.json")
    assert all(c["models"]["wild"]["rmse"] is None for c in result["grid"])
    assert "good fits best" in result["verdict"]["text"] and not result["models"][1]["stable"]
    render([result])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "nothing to validate"),
        (["--model", "moog_mcr_m_1002_bench", "--amplitudes", "-1"], "amplitude -1 must be positive"),
        (["--record", str(SAMPLE / "nowhere.csv.gz")], "nowhere.csv.gz"),
    ],
)
def test_what_cannot_be_validated_says_why(
    arguments: list[str], words: str, files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert verb.main(["--linear-model", files[0], *arguments, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error and not out.exists()


def test_models_of_other_channels_are_not_mixed(files: list[str]) -> None:
    from hydraulic_sysid.linear.models import IdentificationError, read_linear_model

    model, _ = read_linear_model(Path(files[0]))
    drive, other = Subject(model, "a"), Subject(model, "b", output="pressure_a", unit="Pa")
    with pytest.raises(IdentificationError, match="validate it by itself"):
        validate({"a": drive, "b": other}, None, Grid((1.0,), (1.0,)), [])
    record = Record.sampled("slow", 0.01, {"drive": np.sin(np.arange(300.0)), "position": np.zeros(300)})
    with pytest.raises(IdentificationError, match="needs 0.001 s"):
        validate({"a": drive}, None, Grid((1.0,), (1.0,)), [record])
