"""How often the live plots of a simulator at its usual rate are drawn, and that no sample is missing in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from page_steps import start_simulator, until

REDRAWS = 25.0  # per second, wanted of the machine that benchmarks/workbench.py runs on
SLOW_MACHINE = 0.5  # of that


def redraws_per_second(page: Any, seconds: float = 3.0) -> float:
    read = "[workbench.live.redraws, performance.now()]"
    before, then = page.evaluate(read)
    page.wait_for_timeout(1000 * seconds)
    after, now = page.evaluate(read)
    return float((after - before) / (now - then) * 1000)


@pytest.mark.timing
def test_live_plots_run(start_bench: Callable[..., Any], picture: Callable[..., None]) -> None:
    bench = start_bench()
    page = bench.open()
    start_simulator(page)
    until(page, "workbench.live.ring.length > 2000")
    rate = redraws_per_second(page)
    print(f"{rate:.1f} redraws/s")
    assert rate > SLOW_MACHINE * REDRAWS
    assert page.evaluate("workbench.live.gaps") == 0
    picture(page, "live")
    bench.close()
