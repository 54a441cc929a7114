"""What a user does on the page of the workbench in several tests."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

PATIENCE_MS = 300_000  # a diagnosis on a slow machine that runs other tests beside: 180 s have been seen


def until(page: Any, condition: str, argument: Any = None) -> Any:
    """Wait for an expression of the page to be true. (Playwright's own wait needs what the page's policy forbids.)"""
    deadline = time.monotonic() + PATIENCE_MS / 1000
    while not (value := page.evaluate(condition, argument)):
        if time.monotonic() > deadline:
            pytest.fail(f"waited in vain for {condition}")
        page.wait_for_timeout(50)
    return value


def start_simulator(page: Any, button: str = "#start-simulator") -> None:
    """Start a plant from its tab, and enable it."""
    page.click(button)
    page.click("#enable")
    page.click("dialog .primary")
    page.wait_for_selector("#disable")


def drop(page: Any, selector: str, *files: Path) -> None:
    """Drop files or folders of this machine onto an element, as from a file manager."""
    box = page.locator(selector).bounding_box()
    place = {"x": box["x"] + box["width"] / 3, "y": box["y"] + box["height"] / 2}
    data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
    devtools = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        devtools.send("Input.dispatchDragEvent", {"type": kind, **place, "data": data})
    devtools.detach()


def hidden_part(page: Any, selector: str) -> float:
    """By how many pixels the widest of the elements that scroll sideways is wider than what is seen of it."""
    wider = "all => Math.max(...all.map((one) => one.scrollWidth - one.clientWidth))"
    return float(page.eval_on_selector_all(selector, wider))


def figure(text: str) -> float:
    """The first number of a text of the page."""
    number = "".join(c for c in text.replace("−", "-") if c in "0123456789.- ").split()
    return float(number[0])
