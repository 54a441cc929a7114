"""The live tab on a simulator: zoom, cursors, overlays, stop, gains; on phones, in the dark."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from page_steps import hidden_part, start_simulator, until


@pytest.fixture(scope="module")
def bench(start_bench: Callable[..., Any]) -> Iterator[Any]:
    yield start_bench(eager=True)


@pytest.fixture(scope="module")
def page(bench: Any) -> Iterator[Any]:
    page = bench.open()
    start_simulator(page)
    yield page
    bench.close()


def test_a_controller_is_tuned_live_and_taken_back(page: Any, picture: Callable[..., None]) -> None:
    page.click("#start-controller")
    page.wait_for_selector(".gains .slider input")
    page.click("#start-reference")
    slider = page.locator(".gains .slider input").first
    value = page.locator(".gains .slider b").first
    before = value.inner_text()
    slider.evaluate("e => { e.value = Number(e.min) + 0.7 * (e.max - e.min); }")
    slider.dispatch_event("input")
    until(page, "before => document.querySelector('.gains .slider b').innerText !== before", before)
    page.click("#undo-gains:not([disabled])")
    until(page, "before => document.querySelector('.gains .slider b').innerText === before", before)
    until(page, "workbench.live.ring.has('reference')")
    page.wait_for_timeout(2500)
    picture(page, "live-controller")


def test_zoom_shows_every_sample_and_cursors_read(page: Any, picture: Callable[..., None]) -> None:
    plot = page.locator("live-strips .u-over").first.bounding_box()
    middle = plot["y"] + plot["height"] / 2
    page.mouse.move(plot["x"] + 0.70 * plot["width"], middle)
    page.mouse.down()
    page.mouse.move(plot["x"] + 0.74 * plot["width"], middle, steps=4)
    page.mouse.up()
    page.wait_for_selector('#pause[aria-pressed="true"]')
    span, drawn, kept = page.evaluate("""() => {
        const strips = document.querySelector("live-strips");
        const [from, to] = strips.span;
        const drawn = Array.from(strips.panels[0].plot.data[0]).filter((t) => t >= from && t < to);
        return [to - from, drawn.length, strips.frozen.place(to) - strips.frozen.place(from)];
    }""")
    assert 0.2 < span < 1.0
    assert drawn == kept > 20, "a sample is not drawn"
    assert page.evaluate("workbench.live.gaps") == 0, "a sample did not arrive"
    page.mouse.click(plot["x"] + 0.3 * plot["width"], middle)
    page.mouse.click(plot["x"] + 0.6 * plot["width"], middle)
    assert page.locator("h2:has-text('Cursors')").count() == 1
    assert page.evaluate("Object.values(document.querySelector('live-strips').marks).every(Number.isFinite)")
    assert hidden_part(page, ".scroll:has(table.cursors)") <= 0, "a reading is cut off"
    picture(page, "live-cursors")
    page.keyboard.press("Escape")
    page.wait_for_selector('#pause[aria-pressed="false"]')


def test_any_two_channels_are_laid_over_each_other(page: Any, picture: Callable[..., None]) -> None:
    page.click("summary:has-text('Overlay')")
    page.click(".popup button:has-text('Overlay')")
    page.wait_for_selector("live-strips h3:has-text('Overlay')")
    page.wait_for_timeout(300)
    picture(page, "live-overlay")
    page.click("live-strips button:has-text('Remove')")


def test_the_page_fits_a_phone_and_the_dark(bench: Any, page: Any, picture: Callable[..., None]) -> None:
    for name, shape in (("phone", {"width": 390, "height": 844}), ("dark", {"dark": True})):
        other = bench.open(**shape, tab="live")
        until(other, "workbench.live.redraws > 3")
        wide = other.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, f"{name}: the page is {wide} px too wide"
        assert other.locator("#stop").is_visible()
        picture(other, f"live-{name}")
        other.close()


def test_the_stop_button_and_the_space_bar(page: Any, picture: Callable[..., None]) -> None:
    page.focus("#pause")  # the space bar would press it
    page.keyboard.press("Space")
    page.wait_for_selector(".banner.stop #reset")
    assert page.locator('#pause[aria-pressed="true"]').count() == 0
    assert page.evaluate("workbench.state.stop.phase") == "done"
    picture(page, "stopped")
    page.click("#reset")
    page.click("dialog .primary")
    page.wait_for_selector("#enable")
    assert not page.evaluate("workbench.state.bench.plant.enabled"), "nothing moves again by itself"
    page.click("#enable")
    page.click("dialog .primary")
    page.wait_for_selector("#disable")
    page.click("#stop")
    page.wait_for_selector(".banner.stop #reset")
    assert page.evaluate("workbench.state.stop.phase") == "done"


def test_who_only_watches_can_still_stop(bench: Any, page: Any) -> None:
    watcher = bench.open(bench.watching, tab="live")
    assert watcher.locator("text=watching only").count() == 1
    assert watcher.locator("#reset").is_disabled()
    assert watcher.locator("#stop").is_enabled()
    watcher.click("#stop")
    until(watcher, "workbench.state.stop.phase === 'done'")
    watcher.close()
