"""Options that several verbs share, through the verbs that have them."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path

import pytest

from hydraulic_sysid.verbs import bandwidth, calibrate, compare, diagnose

SAMPLE = Path(__file__).resolve().parents[2] / "examples" / "sample_bench"


def test_records_may_be_named_together_or_one_by_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps, multisine = str(SAMPLE / "steps.csv.gz"), str(SAMPLE / "multisine.csv.gz")
    assert bandwidth.main(["--record", steps, multisine, "--record", steps, "--out", str(tmp_path)]) == 2
    assert "there are 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("verb", "there"), [(calibrate, "model.yaml"), (diagnose, "competing_seal_drag.yaml"), (diagnose, "model.yaml")]
)
def test_a_model_is_never_overwritten(
    verb: object, there: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / there).write_text("mine")
    arguments = ["--model", "sample_bench", "--record", str(SAMPLE), "--out", str(tmp_path)]
    more = ["--apply"] if verb is diagnose else []
    assert verb.main([*arguments, *more]) == 2  # type: ignore[attr-defined]
    assert f"{tmp_path / there} exists; choose another folder (a model is never overwritten)" in capsys.readouterr().err
    assert (tmp_path / there).read_text() == "mine"


def test_what_the_page_suggests_reads_the_same(tmp_path: Path) -> None:
    columns = tmp_path / "my map.yaml"
    channels = "drive: {column: command_V, unit: V}, position: {column: position_m, unit: m}"
    columns.write_text("time: {column: time_s, unit: s}\nchannels: {" + channels + "}\n")
    steps = str(SAMPLE / "steps.csv.gz")
    reading = ["--record", steps, "--columns", str(columns), "--window", "1", "3"]
    assert compare.main(["--model", "sample_bench", *reading, "--out", str(tmp_path / "run")]) == 0
    page = html.unescape((tmp_path / "run" / "report.html").read_text())
    calls = re.findall(r'<code class="call">python -m hydraulic_sysid (\w+) (.*?)</code>', page)
    assert calls
    for verb, call in calls:
        wanted = ["--model", "sample_bench", "--record", steps, "--columns", str(columns), "--window", "1.0", "3.0"]
        assert shlex.split(call)[: len(wanted)] == wanted, verb
