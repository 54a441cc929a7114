"""The measured sets that are shipped, studied as the command does: every statement that a study checks has to hold."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import measured_studies
from measured.study import StudyError, data_folder

STUDIES = measured_studies.studies()
SHIPPED = sorted(name for name, study in STUDIES.items() if study.EXCERPT is not None)
SHORT = "mts"  # the others, which take a minute each, are thorough
MOST = 1_000_000  # bytes of an excerpt


def test_the_shipped_sets_are_these() -> None:
    assert SHIPPED == ["bam", "mts", "so101"]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_excerpt_is_small_and_says_whose_it_is(name: str) -> None:
    files = [path for path in STUDIES[name].EXCERPT.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= MOST
    assert {"LICENSE", "README.md"} <= {path.name for path in files}


STUDIED = [name if name == SHORT else pytest.param(name, marks=pytest.mark.thorough) for name in SHIPPED]


@pytest.fixture(scope="module", params=STUDIED)
def studied(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path, int]:
    """Name of a set, the folder of the results, and the exit code of the command."""
    out = tmp_path_factory.mktemp(request.param)
    return request.param, out, measured_studies.main([request.param, "--quick", "--out", str(out)])


def test_what_a_study_says_of_its_excerpt_holds(studied: tuple[str, Path, int]) -> None:
    name, out, code = studied
    (row,) = json.loads((out / "rows.json").read_text("utf-8"))
    assert [check["text"] for check in row["checks"] if not check["holds"]] == [] and row["checks"], name
    assert code == 0
    assert row["after"] <= row["before"]
    assert len(list(out.glob("measured_*.png"))) == 1


def test_what_a_diagnosis_says_of_an_excerpt(studied: tuple[str, Path, int]) -> None:
    """A servo's goal moves on between samples 20 ms apart; the loop of the machine has a dead time; an arm hangs."""
    name, out, _ = studied
    found = [json.loads(path.read_text("utf-8")) for path in out.glob("*/diagnose.json")]
    (found,) = found
    if name == "bam":
        assert [fault["name"] for fault in found["recording"]["faults"]] == ["drive_between_samples"]
    elif name == "so101":
        assert "gravity_pendulum" in STUDIES[name].first_and_tied(found)
    else:
        assert {"spool_dynamics", "command_delay"} & {*found["verdict"]["effects"]}
    assert found["residual"]["after"]["validation"] < found["residual"]["before"]["validation"]


@pytest.mark.parametrize("name", sorted(set(STUDIES) - set(SHIPPED)))
def test_a_set_that_is_not_shipped_asks_for_its_folder(name: str, tmp_path: Path, capsys) -> None:
    assert measured_studies.main([name, "--out", str(tmp_path)]) == 2
    assert STUDIES[name].SOURCE.repository in capsys.readouterr().err


@pytest.mark.parametrize("name", ["bam", "so101"])
def test_a_machine_that_a_set_does_not_have_is_refused(name: str, tmp_path: Path, capsys) -> None:
    assert measured_studies.main([name, "--machine", "mx64", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "no machine 'mx64'" in said and ("sts3250" if name == "bam" else "elbow") in said


def test_a_folder_without_the_data_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"no 0A\.txt in it"):
        data_folder(STUDIES["mts"].SOURCE, tmp_path, tmp_path / "unpacked")
