"""The workbench beside a plant: it shows and stops it, and whatever becomes of pages and server, the plant is safe."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

pytest.importorskip("rclpy")

PLAN = "plan-first_look"
WATCHDOG_S = 0.05
RATE = 125.0
PERIOD_NS = round(1e9 / RATE)


class Page:
    """What a page does, without a browser."""

    def __init__(self, log: str) -> None:
        self.base, self.token = re.search(r"open: (http://\S+)/\?token=(\S+)", log).groups()  # type: ignore[union-attr]
        self.state: dict[str, Any] = {}
        self.events: list[dict[str, Any]] = []
        self.samples = 0

    async def __aenter__(self) -> Page:
        self.session = aiohttp.ClientSession(self.base, headers={"Authorization": f"Bearer {self.token}"})
        self.socket = await self.session.ws_connect("/ws", max_msg_size=0)
        self.task = asyncio.create_task(self._read())
        return self

    async def __aexit__(self, *_: object) -> None:
        self.task.cancel()
        await self.session.close()

    async def _read(self) -> None:
        async for message in self.socket:
            if message.type is aiohttp.WSMsgType.BINARY:
                self.samples += int(np.frombuffer(message.data, "<u4", 1, 4)[0])
            elif message.type is aiohttp.WSMsgType.TEXT:
                event = message.json()
                self.events.append(event)
                self.state |= event.get("state", {})

    async def until(self, condition: Callable[[], Any], what: str, patience: float = 100.0) -> Any:
        deadline = time.monotonic() + patience
        while not (found := condition()):
            assert time.monotonic() < deadline, f"waited in vain for {what}: {self.state}"
            await asyncio.sleep(0.02)
        return found

    async def post(self, path: str, **body: Any) -> Any:
        async with self.session.post(f"/api/{path}", json=body) as answer:
            found = await answer.json()
            assert answer.status < 300, found
            return found

    async def stop(self) -> dict[str, Any]:
        """Press the stop button."""
        before = len(self.events)
        await self.socket.send_json({"type": "stop", "id": before})
        mine = lambda: [e for e in self.events[before:] if e["type"] == "stopped"]  # noqa: E731
        return dict((await self.until(mine, "the answer to the stop"))[0])

    async def start_experiment(self) -> None:
        job = (await self.post("experiments/rehearse", plan=PLAN))["job"]["id"]
        done = lambda: [  # noqa: E731
            e for e in self.events if e["type"] == "job" and e["job"]["id"] == job and e["job"]["phase"] == "finished"
        ]
        assert (await self.until(done, "the rehearsal"))[-1]["job"]["good"]
        await self.post("experiments/start", plan=PLAN, rehearsal=job)


def stamp(state: Any) -> int:
    """When the plant was in `state`, ns."""
    return int(state.header.stamp.sec * 10**9 + state.header.stamp.nanosec)


@pytest.fixture
def bench(launch: Any, client: Any, compiled_physics: None, tmp_path: Path) -> Any:
    """A plant that somebody else runs, and a workbench that is attached to it."""
    model = ("-p", "model:=moog_mcr_m_1002_bench", "-p", f"rate:={RATE}", "-p", f"watchdog:={WATCHDOG_S}")
    plant = launch("hydraulic_sim.nodes.simulator", "--autostart", "--ros-args", *model)
    server = launch(
        "hydraulic_workbench.nodes.workbench",
        "--attach",
        "--no-browser",
        "--port",
        "0",
        "--folder",
        str(tmp_path / "out"),
    )
    server.says("Ctrl-C ends it")
    return plant, server


def test_whatever_becomes_of_page_and_server_the_plant_is_safe(bench: Any, client: Any, wait_until: Any) -> None:
    plant, server = bench
    states, said = client.collect("state"), client.diagnostics()
    wait_until(lambda: states, "the first state")

    def drive() -> float:  # as the plant says eight times a second: the states may be seconds behind on a busy machine
        return float(said["applied_drive_V"] or 0.0)

    def drives(since_ns: int, until_ns: int) -> list[float]:
        """What was applied between two instants, which may not have come yet."""
        wait_until(lambda: stamp(states[-1]) > until_ns, "the states until then")
        return [s.effort[1] for s in states if since_ns < stamp(s) <= until_ns]

    async def use() -> list[int]:
        frozen = aiohttp.ClientSession()
        async with Page(server.output()) as page:
            stuck = await frozen.ws_connect(f"{page.base}/ws", headers={"Authorization": f"Bearer {page.token}"})
            await stuck.send_json({"type": "live", "history": 100.0})  # and never reads: a browser that is frozen
            await page.until(lambda: page.state.get("plant", {}).get("may_enable"), "the plant")
            await page.socket.send_json({"type": "live", "history": 1.0})
            await page.until(lambda: page.samples > 300, "samples")
            assert (await page.post("plant/enable", on=True))["ok"]
            await page.until(lambda: page.state["plant"]["enabled"], "enabled")
            await page.start_experiment()
            await page.until(lambda: abs(drive()) > 0.2, "the excitation")
            assert (await page.stop())["ok"]
            stopped = time.time_ns()
            await page.until(lambda: page.state["plant"]["stopped"], "the latch")
            await page.until(lambda: page.state["experiment"]["phase"] == "aborted", "the end of the experiment")
            assert page.state["experiment"]["record"], "what was recorded until then is kept"
            assert (await page.post("plant/reset"))["ok"]
            enabled = time.time_ns()
            assert (await page.post("plant/enable", on=True))["ok"]
            await page.until(lambda: page.state["plant"]["enabled"], "enabled again")
            found = await asyncio.to_thread(drives, stopped + PERIOD_NS, enabled + 300_000_000)
            assert set(found) == {0.0}, "0 V from the answer to the stop on, and nothing starts again by itself"
            await page.start_experiment()
            await page.until(lambda: abs(drive()) > 0.2, "the excitation")
        await frozen.close()  # all pages are closed, in the middle of the experiment
        await asyncio.sleep(1.0)
        return children_of(server.popen.pid)

    children = asyncio.run(asyncio.wait_for(use(), 300.0))
    assert len(children) >= 2
    os.kill(server.popen.pid, signal.SIGKILL)
    killed = time.time_ns()
    assert max(map(abs, drives(killed - 500_000_000, killed))) > 0.2, "without a page it goes on"
    assert set(drives(killed + 2_000_000_000, killed + 2_500_000_000)) == {0.0}, "0 V 2 s after the server was killed"
    wait_until(lambda: not any(alive(child) for child in children), "the end of what the server started", 20.0)
    ended = time.time_ns()
    assert set(drives(ended, ended + 500_000_000)) == {0.0}, "the plant goes on, at 0 V"
    assert plant.popen.poll() is None


@pytest.mark.timing
def test_the_stop_button_gives_0_v_within_50_ms(bench: Any, client: Any, wait_until: Any) -> None:
    """From the press to the stamp of the first state with 0 V, while another program keeps a core busy."""
    _, server = bench
    states, source = client.collect("state"), client.source("tester", 1.0)
    wait_until(lambda: states, "the first state")
    busy = subprocess.Popen([sys.executable, "-c", "while True: sum(range(1000))"])

    async def press() -> list[float]:
        found = []
        async with Page(server.output()) as page:
            await page.until(lambda: page.state.get("plant", {}).get("may_enable"), "the plant")
            for _ in range(11):
                await page.post("plant/reset")
                assert (await page.post("plant/enable", on=True))["ok"]
                await page.until(lambda: states[-1].effort[1] != 0.0, "a drive")
                number, pressed = len(states), time.time_ns()
                assert (await page.stop())["ok"]
                await page.until(lambda: states[-1].effort[1] == 0.0, "0 V", 5.0)
                first = next(s for s in states[number:] if s.effort[1] == 0.0)
                found.append((stamp(first) - pressed) * 1e-6)
        return found

    try:
        found = asyncio.run(asyncio.wait_for(press(), 200.0))
    finally:
        busy.kill()
        busy.wait()
        source.stop()
    print("stop to 0 V [ms]:", sorted(round(one, 1) for one in found))
    assert statistics.median(found) <= 50.0


def children_of(pid: int) -> list[int]:
    """Processes that it has started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(stat.parent.name))
    return found


def alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
