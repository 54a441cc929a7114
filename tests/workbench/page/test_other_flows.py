"""Flows beside the loop: a design, an experiment that is aborted, faults on the virtual CAN bench."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from page_steps import start_simulator, until


@pytest.fixture(scope="module")
def bench(start_bench: Callable[..., Any]) -> Iterator[Any]:
    yield start_bench()


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


def test_an_experiment_is_designed_run_and_aborted(page: Any, picture: Callable[..., None]) -> None:
    page.evaluate("location.hash = '#/plant'")
    page.click("#start-simulator")
    page.click("dialog .primary")  # it replaces the virtual bench
    page.wait_for_selector("#enable:not([disabled])")
    page.click("#enable")
    page.click("dialog .primary")
    page.wait_for_selector("#disable")
    page.evaluate("location.hash = '#/experiment'")
    page.click("#design")
    page.wait_for_selector(".plan.chosen:has-text('designed here')")
    page.click("#start-experiment:not([disabled])")
    until(page, "workbench.state.bench.experiment.progress > 0.02")
    picture(page, "experiment-designed")
    page.click("#abort")
    page.wait_for_selector("[aria-label=Result] .chip:has-text('aborted')")
    assert page.locator('#next:has-text("Diagnose")').count() == 0
    picture(page, "experiment-aborted")
