"""A workbench of its own per file, and headless Chromium on its page; every page must run without an error."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import Process
from page_steps import PATIENCE_MS, until

REQUIRED = "BENCH_REQUIRE_BROWSER"
"""Set where a browser has been installed: a test without it is then a failure."""
FLAGS = [
    "--no-sandbox",  # as root, in a container
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
EAGER = Path(__file__).with_name("eager_workbench.py")
PICTURES = Path(__file__).parents[3] / "runs" / "page_pictures"
COUNT_INPUT = """
    window.counted = {clicks: 0, keys: 0};
    addEventListener("click", (event) => { if (event.isTrusted && event.detail) counted.clicks += 1; }, true);
    addEventListener("keydown", (event) => { if (event.isTrusted) counted.keys += 1; }, true);
"""


def find_browser() -> str | None:
    """The distribution's Chromium, or a Chrome."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    return None


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """The browser, headless; a skip without one, unless one is required. (While it is there, no other loop can run.)"""
    path = find_browser()
    if path is None:
        if os.environ.get(REQUIRED):
            pytest.fail("no Chromium on this machine, and BENCH_REQUIRE_BROWSER is set")
        pytest.skip("no Chromium on this machine (apt install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


class Bench:
    """A running workbench and the pages that were opened on it."""

    def __init__(self, process: Process, browser: Any) -> None:
        self.process = process
        self.browser = browser
        self.contexts: list[Any] = []
        self.errors: list[str] = []
        process.says("to watch only:")
        self.address, self.watching = re.findall(r"http://127\.0\.0\.1:\d+/\?token=\S+", process.output())[:2]

    def open(self, address: str = "", width: int = 1360, height: int = 860, dark: bool = False, tab: str = "") -> Any:
        """A new page, with nothing remembered."""
        scheme = "dark" if dark else "light"
        context = self.browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, reduced_motion="reduce"
        )
        context.add_init_script(COUNT_INPUT)
        self.contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        page.goto(address or self.address)
        until(page, "window.workbench && workbench.state.loaded")
        if tab:
            page.evaluate("tab => { location.hash = `#/${tab}`; }", tab)
            page.wait_for_selector(f'.rail a[href="#/{tab}"][aria-current="page"]')
        return page

    def close(self) -> None:
        """Close all pages; none may have met an error."""
        for context in self.contexts:
            context.close()
        self.contexts = []
        errors, self.errors = self.errors, []
        assert not errors, errors


@pytest.fixture(scope="module")
def start_bench(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Bench]]:
    """Starts a workbench in a ROS domain of its own: `start_bench("--hide", "valve_deadband")`.

    ``eager``: as `eager_workbench` runs it.
    """
    folder = tmp_path_factory.mktemp("workbench")
    started: list[Process] = []
    environment = pytest.MonkeyPatch()
    environment.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))
    environment.setenv("PYTHONUNBUFFERED", "1")

    def start(*arguments: str, eager: bool = False) -> Bench:
        started_by = [str(EAGER)] if eager else ["-m", "hydraulic_workbench.nodes.workbench"]
        command = [sys.executable, *started_by, "--no-browser"]
        command += ["--folder", str(folder / f"bench_{len(started)}"), *arguments]
        started.append(Process(command, folder / f"bench_{len(started)}.log"))
        return Bench(started[-1], chromium)

    yield start
    for process in started:
        process.end()
    environment.undo()


@pytest.fixture
def picture() -> Callable[..., None]:
    """`picture(page, "live")` keeps what a user sees, for somebody to look at."""
    PICTURES.mkdir(parents=True, exist_ok=True)

    def take(page: Any, name: str, whole: bool = True) -> None:
        if whole:
            page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=PICTURES / f"{name}.png", full_page=whole)

    return take
