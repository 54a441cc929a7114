"""Options that several verbs share, through the verbs that have them."""

from __future__ import annotations

from pathlib import Path

import pytest

from hydraulic_sysid.verbs import bandwidth, calibrate, diagnose

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
