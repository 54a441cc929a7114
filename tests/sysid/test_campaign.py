"""Campaigns: what is done is kept, what fails is a row, and neither workers nor the campaign itself need live on."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

from hydraulic_sysid import campaign
from hydraulic_sysid.campaign.manifest import CampaignError
from hydraulic_sysid.campaign.outcome import Case, CaseError, Outcome, digest, keep
from hydraulic_sysid.campaign.table import write_table
from hydraulic_sysid.campaign.verb_case import flat
from hydraulic_sysid.data import results
from hydraulic_sysid.report import render
from hydraulic_sysid.verbs import campaign as verb

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"

BEFORE_THE_KILL = 30  # cases of a campaign that is killed which do not wait for that


def square(argument: Any, place: Path) -> dict[str, Any]:
    """What the cases of these tests do: a word tells how they end."""
    word, number = argument
    if word == "complains":
        raise CaseError("no oil")
    if word == "breaks":
        raise ZeroDivisionError("by nothing")
    if word == "dies":
        os._exit(9)
    if word == "dies once":
        marker = place.parents[1] / f"died-{number}"
        if not marker.exists():
            marker.touch()
            os._exit(9)
    if word == "counts":
        with (place.parents[1] / "calls").open("a") as log:
            log.write(f"{number}\n")
        while number >= BEFORE_THE_KILL and not (place.parents[1] / "killed").exists():
            time.sleep(0.01)
    return {"square": number**2}


def cases(*words: str) -> list[Case]:
    return [Case(digest([w, i]), {"record": f"{w} {i}"}, (w, i)) for i, w in enumerate(words)]


def test_outcomes_come_in_the_order_of_the_cases_and_failures_are_rows(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    found = campaign.run(
        square,
        cases("works", "complains", "breaks", "dies", "works", "dies once", "works"),
        tmp_path,
        campaign.processes(2),
        lambda p: told.append((p.before + p.now, p.failed)),
    )
    assert [o.state for o in found] == ["done", "failed", "failed", "failed", "done", "done", "done"]
    assert [o.row.get("square") for o in found] == [0, None, None, None, 16, 25, 36]
    assert found[1].error == "no oil" and "ZeroDivisionError: by nothing" in found[2].error
    assert "worker died" in found[3].error
    assert told[0] == (0, 0) and told[-1] == (7, 3)


def test_what_is_kept_is_not_done_again_unless_it_failed_and_that_is_asked_for(tmp_path: Path) -> None:
    crew = campaign.processes(1)
    first = campaign.run(square, cases("works", "complains"), tmp_path, crew)
    forged = Outcome(first[0].key, {}, "done", {"square": -1})
    keep(tmp_path, forged)
    second = campaign.run(square, cases("works", "complains"), tmp_path, crew)
    assert [o.row for o in second] == [{"square": -1}, {}]
    (tmp_path / "cases" / f"{first[1].key}.json").write_text('{"half')  # a power cut
    third = campaign.run(square, cases("works", "complains"), tmp_path, crew, again=True)
    assert third[0].row == {"square": -1} and third[1].failed and third[1].seconds > 0.0


def test_two_campaigns_do_not_share_a_folder(tmp_path: Path) -> None:
    def told(_: Any) -> None:
        with pytest.raises(CampaignError, match="another campaign"):
            campaign.run(square, cases("works"), tmp_path, campaign.processes(1))

    campaign.run(square, cases("works"), tmp_path, campaign.processes(1), told)


_KILLED = """
import sys
from pathlib import Path
sys.path[:0] = {path!r}
import test_campaign as here
from hydraulic_sysid import campaign
if __name__ == "__main__":
    campaign.run(here.square, here.cases(*["counts"] * 60), Path({folder!r}), campaign.processes(2))
"""


@pytest.mark.parametrize("outcomes_before", [3, 25])
def test_a_killed_campaign_goes_on_and_its_workers_end(tmp_path: Path, outcomes_before: int) -> None:
    script = tmp_path / "killed.py"
    script.write_text(_KILLED.format(path=[str(Path(__file__).parent), *sys.path], folder=str(tmp_path)))
    process = subprocess.Popen([sys.executable, script], start_new_session=True)
    while len(list(tmp_path.glob("cases/*.json"))) < outcomes_before:
        assert process.poll() is None
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    (tmp_path / "killed").touch()
    while any(_of_group(process.pid)):
        time.sleep(0.01)
    found = campaign.run(square, cases(*["counts"] * 60), tmp_path, campaign.processes(2))
    assert [o.row["square"] for o in found] == [i**2 for i in range(60)]
    calls = Counter((tmp_path / "calls").read_text().split())
    assert set(calls) == {str(i) for i in range(60)}
    assert sum(calls.values()) <= 60 + 2, "what was done has been done again"


def _of_group(group: int) -> list[int]:
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


@pytest.mark.thorough
def test_a_dask_cluster_gives_what_processes_give(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    from hydraulic_sysid.campaign.verb_case import verb_cases, work

    manifest = campaign.Manifest("compare", {"steps": [str(SAMPLE / "steps.csv.gz")]}, {"sample_bench": "sample_bench"})
    here = campaign.run(work, verb_cases(manifest), tmp_path / "here", campaign.processes(1))
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        crew = campaign.dask_cluster(cluster.scheduler_address)
        there = campaign.run(work, verb_cases(manifest), tmp_path / "there", crew)
        crew.rid(crew.start())
    assert not here[0].failed and here[0].row == there[0].row


def test_no_cluster_is_said(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="no Dask scheduler answers"):
        campaign.dask_cluster("nonsense://here")


def test_the_verb_runs_a_manifest_and_shows_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,position_mm\n0,1\n")
    manifest = tmp_path / "manifest.yaml"
    content = {
        "verb": "compare",
        "records": [str(SAMPLE / "steps.csv.gz"), "broken.csv"],
        "models": ["sample_bench"],
        "options": [{}, {"window": [0, 4]}],
    }
    manifest.write_text(yaml.safe_dump(content))
    out = tmp_path / "out"
    assert verb.main([str(manifest), "--workers", "2", "--out", str(out)]) == 1
    assert "broken.csv" in capsys.readouterr().out
    with (out / "campaign.csv").open() as table:
        found = list(csv.DictReader(table))
    assert [row["state"] for row in found] == ["done", "done", "failed", "failed"]
    assert float(found[0]["summary.position.horizon.rmse"]) > 0.0
    assert "at least two" in found[2]["error"] or "samples" in found[2]["error"]
    page = (out / "report.html").read_text()
    result = json.loads((out / "campaign.json").read_text())
    for case in result["cases"][:2]:
        assert case["page"] in page and (out / case["page"]).exists()


def test_the_page_of_one_column_needs_no_matrix(tmp_path: Path) -> None:
    from hydraulic_sysid.campaign.document import document

    found = [Outcome(str(i), {"record": f"r{i}", "model": "<m>", "options": ""}, "done", {"x": i}) for i in range(3)]
    page = render([results.plain(document("compare", found, "1 processes", 1.0, ()))])
    assert ">Matrix<" not in page and "<m>" not in page


def test_the_table_as_parquet_has_numbers_as_numbers(tmp_path: Path) -> None:
    from pyarrow import parquet

    found = [
        Outcome("a", {"record": "r"}, "done", {"x": 1, "y": "t"}),
        Outcome("b", {"record": "q"}, "failed", error="e"),
    ]
    write_table(tmp_path / "t.parquet", found)
    table = parquet.read_table(tmp_path / "t.parquet").to_pydict()
    assert table["x"] == [1, None] and table["record"] == ["r", "q"] and table["error"] == ["", "e"]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("records: [a]", "verb"),
        ("verb: compare\ncolour: red", "unknown keys colour"),
        ("verb: compare\nrecords: [no/*]", "nothing matches"),
        ("verb: compare\nrecords: 3", "list of paths"),
        ("verb: compare\noptions: {a: 1}", "list of mappings"),
        (": [", "no manifest"),
    ],
)
def test_a_bad_manifest_is_refused(tmp_path: Path, content: str, complaint: str) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(content)
    with pytest.raises(CampaignError, match=complaint):
        campaign.load_manifest(file)


@pytest.mark.parametrize("name", ["compares", "campaign", "numpy.testing compare", "hydraulic_sysid nothing"])
def test_an_unknown_verb_is_refused(name: str) -> None:
    with pytest.raises(CampaignError, match="there is no verb"):
        campaign.verb_cases(campaign.Manifest(name))


def test_keys_change_with_what_matters(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("1")
    one = campaign.Manifest("compare", {"a": [str(file)]}, {"m": "sample_bench"}, {"o": {}})
    renamed = campaign.Manifest("compare", {"b": [str(file)]}, {"m": "sample_bench"}, {"o": {}})
    other = campaign.Manifest("compare", {"a": [str(file)]}, {"m": "sample_bench"}, {"o": {"segment": 1}})
    keys = [campaign.verb_cases(m)[0].key for m in (one, renamed, other)]
    assert keys[0] == keys[1] != keys[2]
    campaign.verb_case.content.cache_clear()
    file.write_text("2")
    assert campaign.verb_cases(one)[0].key != keys[0]


def test_a_row_has_numbers_texts_and_names() -> None:
    document = {"schema": "s", "a": {"b": 1.5, "c": {"d": {"e": {"f": 2}}}}, "effects": [{"name": "x"}, {"name": "y"}],
                "long": list(range(99)), "none": None}  # fmt: skip
    assert dict(flat(document)) == {"a.b": 1.5, "effects": "x + y"}
