"""What the workbench costs, and how fast its stop button is: one run, with a page in headless Chromium.

    python benchmarks/workbench.py [--seconds 60] [--stops 40] [--turns 6]

A simulator at 1 kHz by the wall clock, a source that drives it at every state, a recorder, the live model, and the
workbench, whose server and page show all columns of the live view. Printed are, each beside what is wanted:

- redraws per second of the page, processor time of the server, samples that the page lacks in what it holds;
- memory of server and page over ``--seconds`` (15 minutes: ``--seconds 900``), as growth in 10 minutes;
- from a press of the stop button to the stamp of the first state with 0 V, also while a diagnosis runs;
- jitter of the plant and messages lost by the recorder, without a page and with one, in turns;
- first paint, and size of the page without Plotly.

Exit code 1 where something that is wanted does not hold. Needs Chromium and Playwright (`.ci/run` installs both).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from domain_coordinator import domain_id
from playwright.sync_api import Page, sync_playwright
from scipy.stats import mannwhitneyu

from abuse.running import memory_mb
from hydraulic_node_utils.nodes import middleware
from soak import lost, slope

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "ros_ws/src/hydraulic_workbench/hydraulic_workbench/page"
STEPS = ROOT / "examples/sample_bench/steps.csv.gz"
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
PROBE = """
    window.probe = {
        drive: () => { const r = workbench.live.ring; return r.length ? r.values.get("drive")[r.end - 1] : NaN; },
        atRestSince: () => {
            const r = workbench.live.ring, d = r.values.get("drive");
            let i = r.end - 1;
            while (i > r.start && d[i - 1] === 0) i -= 1;
            return r.time[i] + workbench.live.base;
        },
        gaps: () => {
            const r = workbench.live.ring;
            let found = 0;
            for (let i = r.start + 1; i < r.end; i++) found += r.time[i] - r.time[i - 1] > 0.0015;
            return found + workbench.live.gaps;
        },
    };
"""
"""What the page is asked for: the newest drive, since when it is 0 [s], and after how many samples one is missing."""
START_S = 180.0
TURN_S = 12.0  # of a recording with or without a page
WANTED = {
    "redraws": 25.0, "server": 15.0, "missing": 0, "growth": 2.0, "stop": 50.0, "paint": 1.0, "size": 1.0,
}  # fmt: skip
_TICKS = os.sysconf("SC_CLK_TCK")


class Workbench:
    """The server as a process of its own, and its interface."""

    def __init__(self, folder: Path) -> None:
        self.log = folder / "workbench.log"
        command = [sys.executable, "-m", "hydraulic_workbench.nodes.workbench", "--no-browser", "--port", "0"]
        with self.log.open("wb") as sink:
            self.popen = subprocess.Popen([*command, "--folder", str(folder / "out")], stdout=sink, stderr=sink)
        wait(lambda: "Ctrl-C ends it" in self.log.read_text(), "the workbench")
        self.address = re.search(r"open: (\S+)", self.log.read_text()).group(1)  # type: ignore[union-attr]
        self.base, _, self.token = self.address.partition("/?token=")

    def ask(self, path: str, body: Any = None, raw: bytes | None = None, method: str | None = None) -> Any:
        """A request to the interface."""
        data = raw if raw is not None else None if body is None else json.dumps(body).encode()
        kind = "application/octet-stream" if raw is not None else "application/json"
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": kind}
        request = urllib.request.Request(f"{self.base}/api/{path}", data, headers, method=method)
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            return json.load(answer)

    def state(self) -> dict[str, Any]:
        """What the board says."""
        return dict(self.ask("state"))

    def processor_s(self) -> float:
        """Processor time of the server itself."""
        fields = Path(f"/proc/{self.popen.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICKS

    def close(self) -> None:
        """End it."""
        self.popen.terminate()
        self.popen.wait(30.0)


def wait(condition: Callable[[], Any], what: str, patience: float = START_S) -> Any:
    """Until a condition holds."""
    deadline = time.monotonic() + patience
    while not (found := condition()):
        if time.monotonic() > deadline:
            raise SystemExit(f"waited {patience:g} s in vain for {what}")
        time.sleep(0.02)
    return found


def until(page: Page, condition: str) -> None:
    """Until something holds in the page, whose policy forbids to evaluate texts there."""
    wait(lambda: page.evaluate(condition), condition)


def opened(browser: Any, bench: Workbench) -> tuple[Page, float]:
    """A page of the live view, and when it was first painted [s]."""
    page = browser.new_page(viewport={"width": 1360, "height": 860})
    page.add_init_script(PROBE)
    page.goto(f"{bench.address}#/live")
    until(page, "window.workbench && workbench.live && workbench.live.ring.length > 500")
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN")
    return page, float(paint) / 1e3


def watched(bench: Workbench, page: Page, seconds: float) -> dict[str, Any]:
    """Redraws, processor time, samples that are missing, and memory, while the page shows everything."""
    counts = "[workbench.live.redraws, workbench.live.samples]"
    (redraws, samples), begun, used = page.evaluate(counts), time.monotonic(), bench.processor_s()
    renderer = Path(f"/proc/{bench.popen.pid}")
    times, server, script = [], [], []
    while (passed := time.monotonic() - begun) < seconds and renderer.exists():
        times.append(passed)
        server.append(memory_mb(bench.popen.pid))
        script.append(page.evaluate("performance.memory ? performance.memory.usedJSHeapSize / 1e6 : NaN"))
        page.wait_for_timeout(1e3 * min(5.0, seconds / 8.0))
    passed = time.monotonic() - begun
    drawn, received = page.evaluate(counts)
    return {
        "redraws": (drawn - redraws) / passed,
        "rate": (received - samples) / passed,
        "server": 100.0 * (bench.processor_s() - used) / passed,
        "missing": page.evaluate("probe.gaps()"),
        "lost": bench.state()["health"]["lost"],
        "memory": server[-1],
        "growth": slope(times, server),
        "by_minute": floor(times, server)[1],
        "script": statistics.median(script[-3:]),
        "script_growth": slope(*floor(times, script)),
    }


def floor(times: list[float], values: list[float]) -> tuple[list[float], list[float]]:
    """The least value of every minute: what a collected heap holds, between the heights of its garbage."""
    minutes = sorted({int(t // 60.0) for t in times})
    lowest = [min((v, t) for t, v in zip(times, values, strict=True) if t // 60.0 == minute) for minute in minutes]
    return [t for _, t in lowest], [v for v, _ in lowest]


def stops(bench: Workbench, page: Page, count: int) -> list[float]:
    """Milliseconds from a press of the button to the stamp of the first state with 0 V."""
    found = []
    for _ in range(count):
        bench.ask("plant/reset", {})
        bench.ask("plant/enable", {"on": True})
        until(page, "Math.abs(probe.drive()) > 0.5")
        page.wait_for_timeout(60.0 + 7.0 * len(found) % 50)
        pressed = page.evaluate(
            "() => { const now = Date.now(); document.querySelector('#stop').click(); return now; }"
        )
        until(page, "probe.drive() === 0")
        stamp = page.evaluate("probe.atRestSince()")
        found.append(1e3 * stamp - pressed)
    return found


def recorded(bench: Workbench, folder: Path, name: str) -> tuple[float, float, int]:
    """Jitter of the plant (median, p99) [ms] over a recording, and messages that its recorder lacks."""
    bag = folder / name
    command = [sys.executable, "-m", "hydraulic_sysid.nodes.recorder", "--ros-args", "-p", f"output:={bag}"]
    recorder = subprocess.Popen(
        [*command, "-p", f"max_duration:={TURN_S}", "-p", "exit_when_done:=true"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    medians, worst = [], []
    while recorder.poll() is None:
        time.sleep(1.0)
        rows = {row["name"]: row["values"] for row in bench.state()["health"]["rows"]}
        timing = rows.get("/actuator/plant: timing", {})
        medians.append(float(timing.get("jitter_p50_ms", "nan")))
        worst.append(float(timing.get("jitter_p99_ms", "nan")))
    return float(np.nanmedian(medians)), float(np.nanmedian(worst)), sum(n for _, n in lost(bag).values())


def diagnosis(bench: Workbench) -> str:
    """Start one that takes a while; its job."""
    upload = bench.ask("uploads", {"name": STEPS.name})["upload"]
    bench.ask(f"uploads/{upload}/file/{STEPS.name}", raw=STEPS.read_bytes(), method="PUT")
    record = bench.ask(f"uploads/{upload}/finish", {})["record"]["id"]
    return str(bench.ask("jobs", {"verb": "diagnose", "records": [record], "model": "mod-sample_bench"})["job"]["id"])


def main() -> int:
    """Run and print; 1 where something that is wanted does not hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="that the page is watched (default 60)")
    parser.add_argument("--stops", type=int, default=40, help="presses of the stop button (default 40)")
    parser.add_argument("--turns", type=int, default=6, help="recordings without and with a page (default 6 of each)")
    options = parser.parse_args()
    if min(options.seconds, options.stops, options.turns) <= 0:
        parser.error("--seconds, --stops and --turns must be positive")
    middleware.set_up()
    with domain_id() as domain, tempfile.TemporaryDirectory() as name:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        folder = Path(name)
        bench = Workbench(folder)
        source = None
        try:
            bench.ask("plant/start", {"kind": "simulator", "lockstep": False})
            wait(lambda: bench.state()["plant"]["phase"] == "running", "the plant")
            bench.ask("live_model", {"model": "mod-moog_mcr_m_1002_bench"})
            source = subprocess.Popen(
                [sys.executable, str(ROOT / "benchmarks/emergency_stop.py"), "--role", "source"], stdin=subprocess.PIPE
            )
            bench.ask("plant/enable", {"on": True})
            wait(lambda: bench.state()["live_model"]["phase"] == "running", "the live model")
            failed = measured(bench, folder, options)
        finally:
            if source is not None:
                source.kill()
                source.wait()
            bench.close()
    return int(failed)


def measured(bench: Workbench, folder: Path, options: argparse.Namespace) -> bool:
    """Everything, in turn; whether something does not hold."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    size = sum(f.stat().st_size for f in PAGE.rglob("*") if f.is_file()) / 1e6
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page, paint = opened(browser, bench)
        seen = watched(bench, page, options.seconds)
        page.close()
        without, with_page = [], []
        for turn in range(options.turns):
            without.append(recorded(bench, folder, f"without_{turn}"))
            page, _ = opened(browser, bench)
            with_page.append(recorded(bench, folder, f"with_{turn}"))
            if turn + 1 < options.turns:
                page.close()
        quiet = stops(bench, page, options.stops)
        job = diagnosis(bench)
        wait(lambda: bench.ask(f"jobs/{job}")["phase"] == "running", "the diagnosis")
        busy = []
        while len(busy) < options.stops and bench.ask(f"jobs/{job}")["phase"] == "running":
            busy += stops(bench, page, 1)
        browser.close()
    rows = [
        ("redraws per second", f"{seen['redraws']:.1f}", ">= 25", seen["redraws"] >= WANTED["redraws"]),
        ("samples per second, in every column", f"{seen['rate']:.1f}", "", True),
        ("server, % of one core", f"{seen['server']:.1f}", "<= 15", seen["server"] <= WANTED["server"]),
        ("samples that the page lacks", f"{seen['missing']:.0f}", "0", seen["missing"] == WANTED["missing"]),
        ("messages that the server lacks", f"{seen['lost']:.0f}", "0", seen["lost"] == 0),
        (f"memory of the server {seen['memory']:.0f} MB, growth in 10 min", f"{seen['growth']:.2f} MB", "<= 2",
         options.seconds < 600.0 or seen["growth"] <= WANTED["growth"]),
        (f"memory of the page's script {seen['script']:.0f} MB, growth in 10 min", f"{seen['script_growth']:.2f} MB",
         "<= 2", options.seconds < 600.0 or seen["script_growth"] <= WANTED["growth"]),
        ("stop to 0 V, median of " + str(len(quiet)), f"{statistics.median(quiet):.1f} ms", "<= 50",
         statistics.median(quiet) <= WANTED["stop"]),
        (f"… while a diagnosis runs, median of {len(busy)}", f"{statistics.median(busy):.1f} ms", "<= 50",
         statistics.median(busy) <= WANTED["stop"]),
        ("… the slowest of all", f"{max(quiet + busy):.1f} ms", "", True),
        ("first paint", f"{paint:.2f} s", "<= 1", paint <= WANTED["paint"]),
        ("page without Plotly", f"{size:.2f} MB", "<= 1", size <= WANTED["size"]),
    ]  # fmt: skip
    for what, found, wanted, good in rows:
        print(f"{'' if good else 'NOT '}{what:60} {found:>12}  {wanted}")
    print("memory of the server by minute [MB]:", " ".join(f"{mb:.1f}" for mb in seen["by_minute"]))
    for what, turns in (("without a page", without), ("with a page", with_page)):
        medians, worst, missing = zip(*turns, strict=True)
        each = " ".join(f"{p:.3f}" for p in worst)
        print(
            f"{what}: jitter {statistics.median(medians):.3f} ms, p99 {statistics.median(worst):.3f} ms"
            f" (turns: {each}); the recorder lost {sum(missing)}"
        )
    chance = mannwhitneyu([p for _, p, _ in with_page], [p for _, p, _ in without], alternative="greater").pvalue
    print(f"p99 of that many turns would differ so, or more, by chance with a probability of {chance:.2f}")
    return not all(good for *_, good in rows) or sum(n for *_, n in with_page) > sum(n for *_, n in without)


if __name__ == "__main__":
    sys.exit(main())
