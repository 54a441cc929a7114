"""What needs no plant: the first paint, records from elsewhere, foreign text, accessibility."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_steps import drop, hidden_part, until
from scipy.io import savemat

PAGE = Path(__file__).parents[3] / "ros_ws/src/hydraulic_workbench/hydraulic_workbench/page"
SAMPLE = Path(__file__).parents[3] / "examples" / "sample_bench"
FIRST_PAINT_MS = 1000
MOST_BYTES = 1_000_000
HOSTILE = '<img src=x onerror="window.hacked=1">'
TABS = ("plant", "live", "experiment", "records", "diagnose")


@pytest.fixture(scope="module")
def bench(start_bench: Callable[..., Any]) -> Iterator[Any]:
    bench = start_bench("--open", str(SAMPLE))
    yield bench
    bench.close()


def table(header: str, time_factor: float = 1000.0) -> bytes:
    """A part of a sample record under names and units of somebody else."""
    lines = gzip.decompress((SAMPLE / "steps.csv.gz").read_bytes()).decode().splitlines()
    names = lines[0].split(",")
    time = next(k for k, name in enumerate(names) if "time" in name)
    rows = [line.split(",") for line in lines[1:3001]]
    for row in rows:
        row[time] = repr(round(float(row[time]) * time_factor, 6))
    new = [header, *(f"c{k}" for k in range(1, len(names)))]
    return "\n".join([",".join(new), *(",".join(row) for row in rows)]).encode()


@pytest.mark.timing
def test_the_first_paint_takes_less_than_a_second(bench: Any) -> None:
    page = bench.open()
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    bytes_ = page.evaluate("""performance.getEntriesByType('resource')
        .concat(performance.getEntriesByType('navigation'))
        .filter(({name}) => !name.includes('plotly')).reduce((sum, one) => sum + one.decodedBodySize, 0)""")
    print(f"first paint after {paint:.0f} ms, {bytes_ / 1e3:.0f} kB")
    assert paint < FIRST_PAINT_MS
    assert bytes_ < MOST_BYTES
    assert sum(file.stat().st_size for file in PAGE.rglob("*") if file.is_file()) < MOST_BYTES


def test_every_module_is_asked_for_at_once() -> None:
    index = (PAGE / "index.html").read_text()
    modules = [file.relative_to(PAGE).as_posix() for file in PAGE.rglob("*.js")]
    assert sorted(re.findall(r'modulepreload" href="/page/([^"]+)"', index)) == sorted(modules)


def test_the_page_asks_nobody_else(bench: Any) -> None:
    page = bench.open()
    hosts = page.evaluate("[...new Set(performance.getEntriesByType('resource').map(({name}) => new URL(name).host))]")
    assert hosts == [page.evaluate("location.host")]
    assert "token" not in page.url


def test_columns_are_named_by_choosing_and_kept(bench: Any, picture: Callable[..., None]) -> None:
    page = bench.open(tab="records")
    page.set_input_files("#choose-files", {"name": "foreign.csv", "mimeType": "text/csv", "buffer": table("t")})
    page.wait_for_selector("table.columns-map")
    page.select_option("[aria-label='Column of Time'], [aria-label='Column of time']", "t")
    page.select_option("[aria-label='Unit of time']", "ms")
    for channel, column in (("drive", "c1"), ("position", "c2")):
        page.select_option(f"[aria-label='Column of {channel}']", column)
    page.select_option("[aria-label='Unit of position']", "mm")
    page.wait_for_selector("#finish-import:not([disabled])")
    page.wait_for_selector("series-chart canvas")
    picture(page, "records-columns")
    page.click("#finish-import")
    page.wait_for_selector("table.records th:has-text('foreign')")
    page.wait_for_selector("[aria-label=Overlay] series-chart canvas")
    assert page.locator("table.records tr:has-text('foreign') :text('columns:')").count() == 1


def test_two_records_and_a_model_over_each_other(bench: Any, picture: Callable[..., None]) -> None:
    page = bench.open(tab="records")
    for name in ("multisine", "steps"):
        page.locator(f"table.records tr:has-text('{name}') input").check()
    drawn = (
        "count => document.querySelectorAll('[aria-label=Overlay] series-chart:first-of-type .legend').length === count"
    )
    until(page, drawn, 2)
    page.select_option("#overlay-model", label="sample_bench")
    until(page, drawn, 3)
    page.select_option("#overlay-other-model", label="moog_mcr_m_1002_bench")
    until(page, drawn, 4)
    picture(page, "records-overlay")
    page.uncheck("[aria-label='Show steps']")
    until(page, drawn, 3)
    titles = page.locator("[aria-label=Overlay] series-chart >> nth=0").locator(".legend span").all_inner_texts()
    assert titles == ["multisine", "sample_bench on multisine", "moog_mcr_m_1002_bench on multisine"]


def test_a_quick_look_is_what_is_asked_for(bench: Any, picture: Callable[..., None]) -> None:
    page = bench.open(tab="diagnose")
    page.check("#quick")
    page.evaluate("location.hash = '#/records'")
    row = page.locator("table.records tr:has-text('steps')")  # long enough to be cancelled
    with page.expect_request("**/api/jobs") as asked:
        row.get_by_role("button", name="Diagnose").click()
    assert asked.value.post_data_json["quick"] is True
    page.wait_for_selector("#cancel-job")
    picture(page, "diagnose-quick")
    until(page, "workbench.state.jobs[0].phase === 'running'")
    page.click("#cancel-job")
    until(page, "!['running', 'queued'].includes(workbench.state.jobs[0].phase)")
    assert page.evaluate("workbench.state.jobs[0].error") == "", "what was cancelled has not failed"


def test_files_are_dropped_onto_the_page(bench: Any, tmp_path: Path) -> None:
    lines = gzip.decompress((SAMPLE / "steps.csv.gz").read_bytes()).decode().splitlines()[:2001]
    (tmp_path / "dropped.csv").write_text("\n".join(lines))
    names = lines[0].split(",")
    values = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    short = ["t", "u", "x", "pa", "pb"]
    savemat(tmp_path / "matlab.mat", dict(zip(short, values.T, strict=True)))
    page = bench.open(tab="records")
    drop(page, "[aria-label='Bring a record']", tmp_path / "dropped.csv")
    page.wait_for_selector("[aria-label='Bring a record'] .notice.good:has-text('2000 samples')")  # its header says all
    page.click("#finish-import:not([disabled])")
    page.wait_for_selector("table.records th:has-text('dropped')")
    drop(page, "[aria-label='Bring a record']", tmp_path / "matlab.mat")
    page.wait_for_selector("table.columns-map")
    for channel, column in (("time", "t"), ("drive", "u"), ("position", "x")):
        page.select_option(f"[aria-label='Column of {channel}']", column)
    page.select_option("[aria-label='Unit of position']", "m")
    page.click("#finish-import:not([disabled])")
    page.wait_for_selector("table.records tr:has-text('matlab'):has-text('columns:')")
    found = {one["name"]: one for one in page.evaluate("workbench.state.records")}
    assert len(names) == len(short) and found["dropped"]["samples"] == found["matlab"]["samples"] == 2000
    assert {"drive", "position"} <= set(found["matlab"]["channels"])


def test_the_real_bench_asks_and_says_what_is_missing(bench: Any, picture: Callable[..., None]) -> None:
    page = bench.open(tab="plant")
    assert page.input_value("#real-bus") == "bench"
    assert page.input_value("#real-channel") == "can0"
    page.fill("#real-channel", " ")
    page.wait_for_selector("#start-real:disabled")  # it cannot be left open
    page.fill("#real-channel", "can97")
    page.click("#start-real")
    asked = page.inner_text("dialog")
    assert "can97" in asked and "emergency stop" in asked
    page.click("dialog .primary")
    until(page, "workbench.state.bench.plant.phase === 'failed'")
    said = page.inner_text(".banner[role=alert]")
    assert said.count("can97") == 1 and "Traceback" not in said and "[ERROR]" not in said
    picture(page, "real-bench-missing")
    page.evaluate("location.hash = '#/plant'")
    page.click("#stop-plant")
    until(page, "workbench.state.bench.plant.kind === 'none'")


def test_foreign_text_stays_text(bench: Any) -> None:
    page = bench.open(tab="records")
    page.set_input_files("#choose-files", {"name": "hostile.csv", "mimeType": "text/csv", "buffer": table(HOSTILE)})
    page.wait_for_selector("table.sample")
    assert HOSTILE in page.inner_text("table.sample")
    assert page.evaluate("window.hacked") is None
    page.click("[aria-label='Bring a record'] button:has-text('Cancel')")


def test_keys_go_through_the_tabs(bench: Any, picture: Callable[..., None]) -> None:
    page = bench.open()
    for number, tab in enumerate(TABS, 1):
        page.keyboard.press(str(number))
        page.wait_for_selector(f'.rail a[href="#/{tab}"][aria-current="page"]')
    page.keyboard.press("?")
    page.wait_for_selector("dialog[open]")
    picture(page, "help", whole=False)
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog", state="detached")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_no_serious_fault_of_accessibility(bench: Any, picture: Callable[..., None], dark: bool) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = bench.open(dark=dark)
    page.emulate_media(reduced_motion="reduce")  # colours at rest: a button that fades in is seen half-way
    found = []
    for tab in TABS:
        page.evaluate("tab => { location.hash = `#/${tab}`; }", tab)
        page.wait_for_selector(f'.rail a[href="#/{tab}"][aria-current="page"]')
        page.wait_for_timeout(300)
        picture(page, f"{tab}-{'dark' if dark else 'light'}")
        for fault in axe.run(page).response["violations"]:
            if fault["impact"] in ("serious", "critical"):
                found.append(f"{tab}: {fault['id']}: {[node['target'] for node in fault['nodes']][:4]}")
    assert not found, "\n".join(found)


def test_every_tab_fits_a_phone(bench: Any, picture: Callable[..., None]) -> None:
    page = bench.open(width=390, height=844)
    for tab in TABS:
        page.evaluate("tab => { location.hash = `#/${tab}`; }", tab)
        page.wait_for_selector(f'.rail a[href="#/{tab}"][aria-current="page"]')
        page.wait_for_timeout(300)
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, f"{tab}: the page is {wide} px too wide"
        assert page.locator("#stop").is_visible()
        if tab == "records":
            assert hidden_part(page, ".scroll:has(table.records)") <= 0, "Diagnose is cut off"
        picture(page, f"{tab}-phone")
