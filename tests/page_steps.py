"""What a user does on the page of the workbench in several tests."""

from __future__ import annotations

import time
from typing import Any

import pytest

PATIENCE_MS = 300_000  # a diagnosis on a slow machine that runs other tests beside


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


def figure(text: str) -> float:
    """The first number of a text of the page."""
    number = "".join(c for c in text.replace("−", "-") if c in "0123456789.- ").split()
    return float(number[0])
