"""The page shows what the documents hold, needs nothing else, and the documents survive the way to disk and back."""

from __future__ import annotations

import base64
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hydraulic_node_utils.whole_file import write_text
from hydraulic_sim.model_file import load_model
from hydraulic_sysid import report
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import quantity
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.compare import ModelSubject, compare
from hydraulic_sysid.linear.identification import identify
from hydraulic_sysid.report import render, write_page
from hydraulic_sysid.report.compare import figures as compare_figures
from hydraulic_sysid.report.identify import figures as identify_figures
from hydraulic_sysid.verbs import report as report_verb

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run's folder with both results of two sample records."""
    run = tmp_path_factory.mktemp("run")
    records = read_all([SAMPLE / "triangle.csv.gz", SAMPLE / "steps.csv.gz"])
    results.write_result(run, identify(records)[0])
    results.write_result(run, compare(ModelSubject(load_model("sample_bench")), records))
    write_page(run, results.read_folder(run))
    return run


@pytest.fixture(scope="module")
def comparison(folder: Path) -> dict[str, Any]:
    return results.read_result(folder / "compare.json")


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def trace_values(data: dict[str, Any]) -> np.ndarray:
    assert data["dtype"] == "f4"
    return np.frombuffer(base64.b64decode(data["bdata"]), dtype="<f4")


def test_page_needs_no_other_file_and_no_network(page: str) -> None:
    head = page[: page.index("<script>")]
    assert not re.search(r"""(src|href)\s*=\s*["']""", head)
    assert "<link" not in head
    assert not re.search(r"<script[^>]+src=", page)
    assert page.count("plotly.js v") == 1
    assert len(page) < 12e6


def test_page_says_the_verdicts_and_every_finding(page: str, comparison: dict[str, Any], folder: Path) -> None:
    identification = results.read_result(folder / "identify.json")
    for text in [comparison["verdict"]["text"], identification["verdict"]["text"]]:
        assert text in page
    for finding in comparison["findings"]:
        assert finding["text"] in page


def test_every_figure_has_its_place_and_its_data(page: str) -> None:
    places = re.findall(r'data-figure="([^"]+)"', page)
    data = re.findall(r'<script type="application/json" id="([^"]+)">', page)
    assert sorted(places) == sorted(data)
    assert len(places) == len(set(places)) > 20
    for spec in re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', page, flags=re.S):
        assert json.loads(spec.replace("<\\/", "</"))["data"]


def test_curves_are_those_of_the_document(comparison: dict[str, Any]) -> None:
    figure = json.loads(compare_figures.overlay(comparison, comparison["records"][0]).to_json())
    measured = next(t for t in figure["data"] if t["name"] == "measured")
    stored = comparison["records"][0]["traces"]["position"]["measured"]
    assert np.allclose(trace_values(measured["y"]), 1e3 * np.array(stored["value"]), rtol=1e-6)
    assert np.allclose(trace_values(measured["x"]), stored["time"], rtol=1e-6)


def test_what_is_suggested_reads_the_same(comparison: dict[str, Any]) -> None:
    reading = {"record": ["a.csv", "b.csv"], "segment": 0.12, "holdout": ["c d.csv"]}
    page = html.unescape(render([{**comparison, "reading": reading}]))
    assert "diagnose --model sample_bench --record a.csv b.csv --segment 0.12 --holdout 'c d.csv' --out" in page


def test_figures_carry_units_and_share_time(comparison: dict[str, Any]) -> None:
    figure = compare_figures.overlay(comparison, comparison["records"][0])
    titles = [figure.layout[k].title.text for k in figure.layout if k.startswith("yaxis")]
    assert {"position<br>[mm]", "velocity<br>[mm/s]", "pressure A<br>[bar]", "drive<br>[V]"} <= set(titles)
    assert {t.xaxis for t in figure.data} == {"x"}
    maps = compare_figures.error_maps(comparison, "velocity")
    assert maps.layout.yaxis.title.text == "error [mm/s]"


def test_every_figure_function_makes_one(comparison: dict[str, Any], folder: Path) -> None:
    identification, records = results.read_result(folder / "identify.json"), comparison["records"]
    made = [
        compare_figures.spectra(comparison, records[0]),
        compare_figures.growth(comparison, records[1]),
        *(compare_figures.error_maps(comparison, c, r) for c in comparison["channels"] for r in (None, *records)),
        identify_figures.overlay(identification["settings"], identification["test"]["records"][0]),
        identify_figures.residual_tests(identification["fit"]["records"][0]),
        identify_figures.poles(identification["model"]),
    ]
    assert all(f.data for f in made)


def test_no_text_of_a_document_can_become_html(comparison: dict[str, Any], folder: Path) -> None:
    assert_cannot_inject({**comparison, "records": comparison["records"][:1]})
    assert_cannot_inject(results.read_result(folder / "identify.json"))


def test_figures_show_tags_of_a_document_as_text(comparison: dict[str, Any]) -> None:
    record = {**comparison["records"][0], "name": "<b>x"}
    hostile = {**comparison, "channels": {"position": {"unit": "<i>m", "title": "<b>a</b>&"}}}
    titles = [axis.title.text for axis in compare_figures.overlay(hostile, record).select_yaxes()]
    assert "&lt;b&gt;a&lt;/b&gt;&amp;<br>[&lt;i&gt;m]" in titles


def test_templates_escape_everything_and_know_every_name() -> None:
    templates = [p for p in Path(report.__file__).parent.rglob("*.j2")]
    assert len(templates) > 15
    for template in templates:
        assert not re.search(r"\|\s*(safe|default)\b|autoescape", template.read_text(encoding="utf-8")), template


def test_document_has_no_number_that_json_does_not_know(folder: Path) -> None:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    for name in ("compare.json", "identify.json"):
        assert json.loads((folder / name).read_text(), parse_constant=refuse)["schema"]


def test_plain_keeps_precision_where_it_matters() -> None:
    slow = results.plain({"pole": 0.99999912345, "trace": np.full(100, 1.23456789), "gap": np.array([1.0, np.nan])})
    assert slow["pole"] == 0.99999912345
    assert slow["trace"][0] == 1.23457
    assert slow["gap"] == [1.0, None]


def test_own_files_are_replaced_and_others_kept(tmp_path: Path, comparison: dict[str, Any]) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "settings.json").write_text("{}")
    for _ in range(2):
        results.write_result(tmp_path, comparison)
        write_page(tmp_path, results.read_folder(tmp_path))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["compare.json", "notes.txt", "report.html", "settings.json"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_foreign_files_are_not_written_over(tmp_path: Path, comparison: dict[str, Any]) -> None:
    (tmp_path / "compare.json").write_text('{"mine": 1}')
    with pytest.raises(results.ResultError, match="schema is None"):
        results.write_result(tmp_path, comparison)
    assert (tmp_path / "compare.json").read_text() == '{"mine": 1}'
    (tmp_path / "compare.json").unlink()
    (tmp_path / "report.html").write_text("<html>mine</html>")
    with pytest.raises(results.ResultError, match="not a page of this project"):
        results.check_target(tmp_path, "compare")


def test_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "compare.json"
    write_text(path, "old")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "new \udc80")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("content", "word"),
    [("nonsense", "not a JSON"), ('{"schema": "other/1"}', "schema is 'other/1'"), ("[1]", "schema is None")],
)
def test_unreadable_results_are_named(tmp_path: Path, content: str, word: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(content)
    with pytest.raises(results.ResultError, match=word):
        results.read_result(path)


DAMAGE: dict[str, dict[str, Any]] = {
    "something is missing": {"settings": {}},
    "a text for a number": {"settings": {"horizon": "<b>long", "horizon_part": 0.5}},
    "a number for a list": {"records": 3},
    "half a character": {"title": "\ud800"},
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=list(DAMAGE))
def test_what_does_not_hold_what_its_schema_promises_is_one_line(
    tmp_path: Path, comparison: dict[str, Any], capsys: pytest.CaptureFixture[str], damage: dict[str, Any]
) -> None:
    (tmp_path / "compare.json").write_text(json.dumps({**comparison, **damage}))
    assert report_verb.main([str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "a result does not hold what its schema promises (hydraulic_sysid.compare/" in told
    assert told.count("\n") == 1
    assert not (tmp_path / "report.html").exists()


def test_brackets_without_end_are_no_json(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("[" * 200_000)
    with pytest.raises(results.ResultError, match="not a JSON"):
        results.read_result(tmp_path / "x.json")


def test_unknown_version_is_refused(comparison: dict[str, Any]) -> None:
    with pytest.raises(results.ResultError, match="compare/99"):
        render([{**comparison, "schema": "hydraulic_sysid.compare/99"}])


def test_folder_without_results_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(results.ResultError, match="run calibrate, compare or identify"):
        results.read_folder(tmp_path)
    with pytest.raises(results.ResultError, match="does not exist"):
        results.read_folder(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("value", "unit", "error", "said"),
    [
        (13945089.4, "Pa", 650.0, "139.451 ± 0.0065 bar"),
        (0.0123456, "m", 2.5e-3, "12.3 ± 2.5 mm"),
        (0.0123456, "m", 1.0, "12 ± 1000 mm"),
        (0.0, "m", 1e-3, "0 ± 1 mm"),
    ],
)
def test_a_value_has_as_many_digits_as_its_error_leaves(value: float, unit: str, error: float, said: str) -> None:
    assert quantity(value, unit, error=error) == said
