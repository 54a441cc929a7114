"""Flows beside the loop: faults on the virtual CAN bench, effects chosen by hand, the gate, an abort, a closed page."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from page_steps import drop, start_simulator, until

from hydraulic_sim.model_file import load_model, save_model
from hydraulic_workbench.library import OWN_PLANS

pytestmark = pytest.mark.thorough

SAMPLE = Path(__file__).parents[3] / "examples" / "sample_bench"
TIED = ("spool_dynamics", "command_delay")
FINISHES = "id => workbench.state.jobs.find((job) => job.id === id)?.phase === 'finished'"


@pytest.fixture(scope="module")
def bench(start_bench: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """With the sample records, and a plan that may move the piston by 1 mm and does not keep to it."""
    folder = tmp_path_factory.mktemp("opened")
    (folder / "plans").mkdir()
    plan = (OWN_PLANS / "first_look.yaml").read_text()
    too_far = plan.replace("travel_limit: 0.6 ", "travel_limit: 0.001 ").replace("name: first_look", "name: too_far")
    assert too_far.count("too_far") == 1 and "0.001" in too_far
    (folder / "plans" / "too_far.yaml").write_text(too_far)
    leave_a_tie(folder / "earlier" / "runs" / "001-diagnose")
    yield start_bench("--folder", str(folder / "earlier"), "--open", str(SAMPLE), str(folder / "plans"))


def leave_a_tie(run: Path) -> None:
    """A diagnosis of an earlier workbench in this folder that two effects explain alike."""
    run.mkdir(parents=True)
    over = {"fit": 1.0, "validation": 1.0}
    verdict = {"kind": "indistinguishable", "level": "close", "effects": list(TIED), "text": f"One of {TIED}."}
    document = {
        "schema": "hydraulic_sysid.diagnose/2", "created": "2026-01-01T00:00:00+00:00", "verdict": verdict,
        "settings": {"segment_length": 0.5}, "noise_std": {"position": {"record": 2e-5}}, "effects": [],
        "residual": {"before": {"fit": 3.0, "validation": 3.0}, "after": over, "after_each_effect": []},
    }  # fmt: skip
    (run / "diagnose.json").write_text(json.dumps(document))
    for name in TIED:
        save_model(load_model("sample_bench").with_effect(name), run / f"competing_{name}.yaml")
    job = {
        "id": run.name, "verb": "diagnose", "title": "diagnose", "line": [], "model": "mod-sample_bench", "records": [],
        "plan": None, "phase": "finished", "error": "", "exit_code": 0, "created": 1.0, "seconds": 1.0, "residual": [],
        "candidates": [],
    }  # fmt: skip
    (run / "job.json").write_text(json.dumps(job))


@pytest.fixture(scope="module")
def page(bench: Any) -> Iterator[Any]:
    page = bench.open()
    start_simulator(page, "#start-virtual")
    yield page
    bench.close()


def test_a_fault_of_the_virtual_bench_is_reported_and_disables(page: Any, picture: Callable[..., None]) -> None:
    page.evaluate("location.hash = '#/plant'")
    page.locator("button.fault").first.click()
    page.wait_for_selector('button.fault[aria-pressed="true"]')
    page.evaluate("location.hash = '#/live'")
    page.wait_for_selector("[aria-label=Health] .notice.poor")
    until(page, "!workbench.state.bench.plant.enabled")
    picture(page, "can-fault")
    page.evaluate("location.hash = '#/plant'")
    picture(page, "can-plant")
    page.locator('button.fault[aria-pressed="true"]').click()
    page.wait_for_selector('button.fault[aria-pressed="true"]', state="detached")


def test_a_simulator_hides_the_effects_that_are_chosen(page: Any, picture: Callable[..., None]) -> None:
    page.evaluate("location.hash = '#/plant'")
    page.select_option(".choice:has(#start-simulator) select", label="sample_bench")
    page.click("summary:has-text('Hidden effects')")
    for effect in ("valve deadband", "stribeck friction"):
        page.check(f".effects label:has-text('{effect}') input")
    page.locator(".effects .inset input").first.press("ArrowRight")
    picture(page, "plant-hidden-effects")
    page.click("#start-simulator")
    page.click("dialog .primary")  # it replaces the virtual bench
    until(page, "workbench.state.bench.plant.effects?.includes('valve_deadband')")  # not what the one before said last
    page.wait_for_selector("#enable:not([disabled])")
    plant = page.evaluate("workbench.state.bench.plant")
    assert plant["model"] == "mod-sample_bench"
    assert {"valve_deadband", "stribeck_friction"} <= set(plant["effects"].replace(",", " ").split())
    page.click("#enable")
    page.click("dialog .primary")
    page.wait_for_selector("#disable")


def test_a_plan_that_leaves_its_limits_cannot_be_started(page: Any, picture: Callable[..., None]) -> None:
    page.evaluate("location.hash = '#/experiment'")
    page.click(".plan:has-text('too_far')")
    page.wait_for_selector("[aria-label=Gate] .chip:has-text('rehearsal failed')")
    assert page.locator("#start-experiment").is_disabled()
    first, *others = page.locator("ul.gate .gate-poor strong").all_inner_texts()
    # The last sample before the end lies on the one or the other side of the limit.
    assert first == "Plays to its end" and set(others) <= {"Travel"}, "all else is well"
    picture(page, "experiment-refused")
    rehearsal = page.evaluate("workbench.state.jobs.find((one) => one.plan === 'plan-too_far')")
    assert rehearsal["good"] is False
    own = page.evaluate("location.origin")
    asked = {"plan": rehearsal["plan"], "rehearsal": rehearsal["run"]}
    answer = page.request.post(f"{own}/api/experiments/start", data=asked, headers={"Origin": own})
    assert answer.status == 409 and answer.json()["field"] == "rehearsal", "the server asks the same again"


def test_an_experiment_is_designed_run_and_aborted(page: Any, picture: Callable[..., None]) -> None:
    page.evaluate("location.hash = '#/experiment'")
    page.click("#design")
    page.wait_for_selector(".plan.chosen:has-text('designed here'):has-text('chirp')")
    page.click("#start-experiment:not([disabled])")
    until(page, "workbench.state.bench.experiment.progress > 0.02")
    picture(page, "experiment-designed")
    page.click("#abort")
    page.wait_for_selector("[aria-label=Result] .chip:has-text('aborted')")
    assert page.locator('#next:has-text("Diagnose")').count() == 0
    picture(page, "experiment-aborted")


def test_the_next_experiment_goes_to_its_tab(page: Any, picture: Callable[..., None]) -> None:
    page.evaluate("location.hash = '#/diagnose'")
    page.click("#next-experiment:not([disabled])")
    page.wait_for_selector("[aria-label='Next experiment'] tbody tr")
    assert all(page.locator("[aria-label='Next experiment'] li").all_inner_texts()), "every movement in words"
    picture(page, "next-experiment")
    page.click("#to-experiment")
    page.wait_for_selector(".plan.chosen:has-text('proposed by a diagnosis')")
    page.wait_for_selector("[aria-label=Rehearsal] canvas")


def test_the_folder_of_a_bag_is_dropped(page: Any) -> None:
    page.evaluate("location.hash = '#/records'")
    until(page, "workbench.state.records.some(({kind}) => kind === 'bag')")
    bag = page.evaluate("workbench.state.records.find(({kind}) => kind === 'bag')")
    drop(page, "[aria-label='Bring a record']", Path(bag["file"]))
    page.wait_for_selector("[aria-label='Bring a record'] .chip:has-text('bag')")
    page.click("#finish-import:not([disabled])")
    page.wait_for_selector("table.records tr:has-text('brought')")
    brought = page.evaluate("workbench.state.records.find(({source}) => source === 'imported')")
    assert [brought[key] for key in ("kind", "samples")] == ["bag", bag["samples"]]


def test_a_diagnosis_outlives_its_page_and_ends_when_asked(bench: Any, page: Any) -> None:
    page.evaluate("location.hash = '#/records'")
    page.locator("table.records tr:has-text('steps')").get_by_role("button", name="Diagnose").click()
    page.wait_for_selector("table.candidates tbody tr")
    job = page.evaluate("workbench.state.jobs.find((one) => one.verb === 'diagnose').id")
    bench.close()
    second = bench.open(tab="diagnose")
    assert second.evaluate("id => workbench.state.jobs.find((one) => one.id === id).phase", job) == "running"
    second.wait_for_selector("table.candidates tbody tr")
    second.click("#cancel-job")  # it ends with the best so far
    until(second, "id => workbench.state.jobs.find((one) => one.id === id).progress.includes('ending')", job)
    bench.close()
    third = bench.open(tab="diagnose")
    until(third, FINISHES, job)
    third.wait_for_selector("[aria-label=Verdict] .verdict")
    third.wait_for_selector("[aria-label=Candidates] table.candidates tbody tr >> nth=5")  # all that it had scored
