"""The server over HTTP, with a graph that answers and no ROS: who is let in, what is refused, records, jobs, models."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

from hydraulic_sim.model_file import presets
from hydraulic_workbench.access import Access
from hydraulic_workbench.bench import Bench, Settings
from hydraulic_workbench.calls import NoAnswerError, NodeParameter, Said
from hydraulic_workbench.columns import COLUMNS
from hydraulic_workbench.diagnostics import Row
from hydraulic_workbench.sample_ring import SampleRing
from hydraulic_workbench.server import Server, listen
from hydraulic_workbench.workers import Workers

ROOT = Path(__file__).resolve().parents[2]
STEPS = ROOT / "examples" / "sample_bench" / "steps.csv.gz"
PATIENCE_S = 120.0
Client = aiohttp.ClientSession
MS = 1_000_000


class AnsweringGraph:
    """A graph with a plant that says yes, and remembers what it was asked."""

    namespace = "/actuator"

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.silent = False
        self.slow = asyncio.Event()
        self.slow.set()

    async def trigger(self, name: str, patience: float = 5.0) -> Said:
        if self.silent:
            raise NoAnswerError(f"nobody serves {name}")
        self.asked.append(name)
        return Said(True, "done")

    async def switch(self, name: str, on: bool, patience: float = 5.0) -> Said:
        self.asked.append(f"{name} {on}")
        await self.slow.wait()
        if self.silent:
            raise NoAnswerError(f"nobody serves {name}")
        return Said(on, "enabled" if on else "disabled")

    async def change_state(self, node: str, transition: str, patience: float) -> bool:
        return True

    async def parameters(self, node: str) -> list[NodeParameter]:
        return []

    async def set_parameters(self, node: str, values: dict[str, Any], patience: float = 5.0) -> Said:
        return Said(True, "")


class Streams:
    """Streams that are well."""

    age, missing, newest_ns = 0.001, 0, 0


class Rig:
    """A server in this process, and a client that holds a token."""

    def __init__(self, bench: Bench, server: Server, graph: AnsweringGraph, ring: SampleRing) -> None:
        self.bench, self.server, self.graph, self.ring = bench, server, graph, ring
        self.base = f"http://127.0.0.1:{server.access.port}"

    def client(self, token: str | None = None, **headers: str) -> Client:
        token = self.server.access.operate if token is None else token
        given = {"Authorization": f"Bearer {token}"} if token else {}
        return Client(self.base, headers={**given, **headers})

    async def finished(self, client: Client, identifier: str) -> dict[str, Any]:
        for _ in range(int(PATIENCE_S * 20)):
            async with client.get(f"/api/jobs/{identifier}") as answer:
                job = await answer.json()
            if job["phase"] not in ("queued", "running"):
                return dict(job)
            await asyncio.sleep(0.05)
        raise AssertionError(f"{identifier} does not end")


@asynccontextmanager
async def rig(folder: Path, read_only: bool = False, processes: bool = False, **settings: Any) -> Any:
    """A server; files are read in a thread unless the ``processes`` are wanted that take a second to start."""
    sock, ring, graph = listen(0), SampleRing(5000, len(COLUMNS), 200 * MS), AnsweringGraph()
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    workers = None if processes else Workers(lambda: ThreadPoolExecutor(1))
    bench = Bench(Settings(folder, **settings), graph, ring, Streams(), env, workers)
    server = Server(bench, Access(sock.getsockname()[1], read_only), sock)
    await server.begin()
    await bench.begin()
    try:
        yield Rig(bench, server, graph, ring)
    finally:
        await server.end()
        await bench.end()


def run(test: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(test(), 2 * PATIENCE_S))


async def json_of(answer: Any, status: int = 200) -> Any:
    async with answer as given:
        found = await given.json()
        assert given.status == status, found
        return found


@pytest.fixture(autouse=True)
def paths_of_children(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))


def test_nobody_comes_in_without_a_token_or_from_elsewhere(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench:
            own = bench.base
            refused = {
                ("GET", "/", ""): {},
                ("GET", "/?token=guessed", ""): {},
                ("GET", "/api/state", ""): {},
                ("GET", "/page/app.js", ""): {},
                ("GET", "/ws", ""): {},
                ("POST", "/api/stop", ""): {},
            }
            async with bench.client("") as nobody:
                for method, path, _ in refused:
                    async with nobody.request(method, path, json={} if method == "POST" else None) as answer:
                        assert answer.status == 401, path
            for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example:1"}):
                async with bench.client(**headers) as stranger:
                    for method, path in (("GET", "/api/state"), ("POST", "/api/stop"), ("GET", "/ws")):
                        async with stranger.request(method, path, json={} if method == "POST" else None) as answer:
                            assert answer.status == 403, (headers, path)
            assert bench.graph.asked == []
            async with Client(own, cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
                async with browser.get(f"/?token={bench.server.access.operate}") as page:
                    assert page.status == 200 and "default-src 'self'" in page.headers["Content-Security-Policy"]
                    cookie = page.headers["Set-Cookie"]
                    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
                async with browser.get("/api/state") as answer:
                    assert answer.status == 200
                async with browser.post("/api/stop", json={}) as answer:
                    assert answer.status == 403, "a form of another page sends the cookie, but no origin of ours"
                async with browser.post("/api/stop", json={}, headers={"Origin": own}) as answer:
                    assert answer.status == 200

    run(test)


def test_it_listens_on_this_machine_only(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench:
            assert bench.server.socket.getsockname()[0] == "127.0.0.1"

    run(test)


def test_who_only_watches_changes_nothing_but_may_stop(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client(bench.server.access.watch) as watcher:
            await json_of(watcher.get("/api/records"))
            for path in ("/api/plant/start", "/api/plant/enable", "/api/jobs", "/api/timeline/undo"):
                await json_of(watcher.post(path, json={}), 403)
            assert bench.graph.asked == []
            assert (await json_of(watcher.post("/api/stop", json={})))["ok"]
            async with watcher.ws_connect("/ws") as socket:
                assert (await socket.receive_json())["role"] == "watch"
                await socket.send_json({"type": "stop", "id": 4})
                while (event := await socket.receive_json())["type"] != "stopped":
                    pass
                assert event["id"] == 4 and event["ok"]
            assert bench.graph.asked == ["emergency_stop"] * 2

    run(test)


def test_read_only_lets_nobody_operate(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path, read_only=True) as bench:
            assert list(bench.server.addresses()) == ["watch"]
            token = bench.server.access.operate
            async with bench.client(token) as operator, operator.get("/api/state") as answer:
                assert answer.status == 401

    run(test)


REFUSED = (
    ("/api/plant/start", {"kind": "rocket"}, 400, "kind is 'rocket'; allowed are simulator, guess"),
    ("/api/plant/start", {"kind": "simulator", "model": "mod-none"}, 404, "there is no model 'mod-none'"),
    ("/api/plant/start", {"kind": "simulator", "hidden": {"x": 1}}, 400, "hidden is"),
    ("/api/plant/start", {"kind": "can", "bus": "nowhere"}, 400, "nowhere"),
    ("/api/plant/fault", {"fault": "emergency", "node": "valve", "on": True}, 400, "cannot be given the fault"),
    ("/api/guess/answer", {"effect": "valve_deadband"}, 409, "there is no riddle"),
    ("/api/controller/start", {"gains": "../secret"}, 400, "gains is '../secret'"),
    ("/api/controller/gains", {"values": {"kp": 1}}, 409, "no controller runs"),
    ("/api/reference/start", {"kind": "a b"}, 400, "kind is 'a b'"),
    ("/api/experiments/start", {"plan": "plan-chirp", "rehearsal": "none"}, 404, "there is no job"),
    ("/api/experiments/abort", {}, 409, "no experiment is on"),
    ("/api/jobs", {"verb": "rm"}, 400, "verb is 'rm'; allowed are"),
    ("/api/jobs", {"verb": "compare", "records": ["rec-none"]}, 404, "there is no record"),
    ("/api/jobs", {"verb": "compare", "records": []}, 400, "choose at least one record"),
    ("/api/timeline/undo", {}, 409, "nothing to undo"),
    ("/api/uploads", {"name": "../../x"}, 400, "name is '../../x'"),
    ("/api/models/current", {"model": ["x"]}, 404, "there is no model"),
)
"""Path, body, status, and words of the answer."""


def test_what_cannot_be_is_refused_in_words(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client() as client:
            for path, body, status, words in REFUSED:
                assert words in (await json_of(client.post(path, json=body), status))["error"]

    run(test)


def test_bodies_that_are_no_json_objects_are_refused(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client() as client:
            for data, kind in ((b"{", "application/json"), (b"[]", "application/json"), (b"{}", "text/plain")):
                await json_of(client.post("/api/jobs", data=data, headers={"Content-Type": kind}), 400)
            for query in ("from=x", "to=inf", "points=many"):
                await json_of(client.get(f"/api/records/none/traces?{query}"), 404)
            for path in ("/page/..%2f..%2fsetup.py", "/page/../bench.py", "/page/nothing.js"):
                async with client.get(path) as answer:
                    assert answer.status == 404

    run(test)


def test_samples_come_once_each_in_binary_frames(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client() as client, client.ws_connect("/ws", max_msg_size=0) as socket:
            state = [i for i, c in enumerate(COLUMNS) if c.topic == "state"]

            def more(first: int, count: int) -> None:
                stamps = np.arange(first, first + count, dtype=np.int64) * MS
                bench.ring.append(state, stamps, np.tile(stamps.astype(np.float32), (len(state), 1)))
                bench.bench.heard("samples", bench.ring.complete([]))

            more(1, 300)
            await socket.send_json({"type": "live", "history": 0.1})
            times: list[float] = []
            for start in range(301, 1301, 100):
                await asyncio.sleep(0.02)
                more(start, 100)
            while len(times) < 1101:
                message = await socket.receive(timeout=10.0)
                if message.type is aiohttp.WSMsgType.BINARY:
                    count = int(np.frombuffer(message.data, "<u4", 1, 4)[0])
                    times += np.frombuffer(message.data, "<f8", count, 16).tolist()
            assert np.diff(times) == pytest.approx(0.001) and len(times) == 1101
            assert times[-1] - times[0] == pytest.approx(1.1), "the last 0.1 s from before, and all since"

    run(test)


def test_the_board_says_what_enabling_will_do(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path, attach=True) as bench, bench.client() as client:

            async def shown(**values: Any) -> dict[str, Any]:
                text = {k: str(v) for k, v in values.items()}
                rows = [
                    Row(f"/actuator/plant: {part}", 0, "said", text, asyncio.get_running_loop().time())
                    for part in ("plant", "command")
                ]
                bench.bench.heard("diagnostics", rows)
                await asyncio.sleep(0.5)
                return dict((await json_of(client.get("/api/state")))["plant"])

            rest = await shown(enabled=False, emergency_stop=False, source="")
            assert rest["may_enable"] and "stays at 0 V" in rest["enable_does"] and rest["real"]
            moved = await shown(enabled=False, emergency_stop=False, source="controller")
            assert "controller commands it now and moves it at once" in moved["enable_does"]
            stopped = await shown(enabled=False, emergency_stop=True, stop_reason="emergency stop")
            assert not stopped["may_enable"] and stopped["may_reset"] and "reset it first" in stopped["enable_does"]
            assert (await json_of(client.post("/api/plant/enable", json={"on": True})))["ok"]
            assert bench.graph.asked == ["enable True"]
            await json_of(client.post("/api/plant/stop", json={}), 409)
            bench.graph.slow.clear()
            waiting = asyncio.create_task(json_of(client.post("/api/plant/enable", json={"on": True})))
            await asyncio.sleep(0.2)
            assert (await json_of(client.post("/api/stop", json={})))["ok"]
            assert await waiting == {"ok": False, "message": "taken back before the plant had answered"}
            bench.graph.slow.set()
            bench.graph.silent = True
            bench.graph.asked.clear()
            told = await json_of(client.post("/api/plant/enable", json={"on": True}), 503)
            assert "nobody serves enable" in told["error"] and bench.graph.asked == ["enable True", "enable False"]
            answer = await json_of(client.post("/api/stop", json={}))
            assert not answer["ok"] and "watchdog" in answer["message"]

    run(test)


@pytest.fixture
def table(tmp_path: Path) -> Iterator[bytes]:
    time = np.arange(400) * 1e-3
    rows = np.column_stack([time * 1e3, np.sin(7 * time), 5.0 * np.cos(7 * time), 70.0 + time])
    yield b"t [ms];u;x [mm];p_a_bar\n" + b"\n".join(b";".join(b"%.6f" % v for v in row) for row in rows)


def test_a_table_becomes_a_record_by_choosing_columns(tmp_path: Path, table: bytes) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client() as client:
            upload = (await json_of(client.post("/api/uploads", json={"name": "my log.csv"})))["upload"]
            await json_of(client.put(f"/api/uploads/{upload}/file/my log.csv", data=table))
            seen = await json_of(client.post(f"/api/uploads/{upload}/preview", json={"columns": None}))
            assert (
                seen["needs_map"] and seen["header"] == ["t [ms]", "u", "x [mm]", "p_a_bar"] and len(seen["rows"]) == 8
            )
            guess = seen["guess"]
            assert guess["time"] == {"column": "t [ms]", "unit": "ms"}
            assert guess["channels"]["position"] == {"column": "x [mm]", "unit": "mm"}
            assert guess["channels"]["pressure_a"] == {"column": "p_a_bar", "unit": "bar"}
            wrong = {**guess, "channels": {"position": {"column": "u", "unit": "bar"}}}
            told = await json_of(client.post(f"/api/uploads/{upload}/preview", json={"columns": wrong}))
            assert "does not convert to m" in told["problem"] and told["record"] is None
            await json_of(client.post(f"/api/uploads/{upload}/finish", json={"columns": wrong}), 400)
            told = await json_of(client.post(f"/api/uploads/{upload}/preview", json={"columns": guess}))
            assert told["record"]["samples"] == 400 and max(told["traces"]["position"]["value"]) == pytest.approx(5e-3)
            made = await json_of(client.post(f"/api/uploads/{upload}/finish", json={"columns": guess, "name": "mine"}))
            record = made["record"]
            assert record["channels"] == ["drive", "position", "pressure_a"] and not record["problem"]
            text = Path(made["columns_file"]).read_text()
            assert "position: {column: 'x [mm]', unit: mm}" in text and Path(record["file"]).read_bytes() == table
            found = await json_of(client.get(f"/api/records/{record['id']}/traces?channels=position&from=0.1&to=0.2"))
            assert not found["decimated"] and len(found["channels"]["position"]["time"]) in (101, 102, 103)
            await json_of(client.get(f"/api/records/{record['id']}/traces?channels=nothing"), 400)
        async with rig(tmp_path) as again, again.client() as client:
            known = (await json_of(client.get("/api/records")))["records"]
            assert [r["name"] for r in known] == ["mine"] and known[0]["channels"] == record["channels"]

    run(test)


def test_uploads_take_no_place_outside(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client() as client:
            upload = (await json_of(client.post("/api/uploads", json={"name": "x"})))["upload"]
            for path in ("..%2f..%2fx", "%2fetc%2fx", "a/b/c/d", ".hidden"):
                async with client.put(f"/api/uploads/{upload}/file/{path}", data=b"x") as answer:
                    assert answer.status in (400, 404), path
            await json_of(client.post(f"/api/uploads/{upload}/preview", json={}), 400)
            await json_of(client.delete(f"/api/uploads/{upload}"))
            await json_of(client.post(f"/api/uploads/{upload}/preview", json={}), 404)

    run(test)


def test_a_comparison_from_the_click_to_the_samples_behind_its_map(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path, processes=True) as bench, bench.client() as client:
            upload = (await json_of(client.post("/api/uploads", json={"name": STEPS.name})))["upload"]
            await json_of(client.put(f"/api/uploads/{upload}/file/{STEPS.name}", data=STEPS.read_bytes()))
            record = (await json_of(client.post(f"/api/uploads/{upload}/finish", json={})))["record"]["id"]
            asked = {"verb": "compare", "records": [record], "model": "mod-sample_bench"}
            job = (await json_of(client.post("/api/jobs", json=asked), 202))["job"]
            done = await bench.finished(client, job["id"])
            assert done["phase"] == "finished" and done["good"], done
            run_id = done["run"]
            document = await json_of(client.get(f"/api/runs/{run_id}"))
            file = json.loads((tmp_path / "runs" / run_id / "compare.json").read_text())
            assert document["verdict"] == file["verdict"] and document["error_maps"] == file["error_maps"]
            figures = (await json_of(client.get(f"/api/runs/{run_id}/figures")))["figures"]
            assert len(figures) > 3 and all(f["title"] for f in figures)
            first = await json_of(client.get(f"/api/runs/{run_id}/figures/0"))
            assert first["data"] and first["layout"]
            await json_of(client.get(f"/api/runs/{run_id}/figures/99"), 400)
            over = file["error_maps"]["position"]["velocity"]
            for low, high, count in zip(over["start"], over["end"], over["count"], strict=True):
                path = f"/api/runs/{run_id}/samples?channel=position&variable=velocity&low={low!r}&high={high!r}"
                behind = await json_of(client.get(path))
                assert behind["count"] == count and behind["segments"][0]["record"] == "steps"
            async with client.get(f"/api/runs/{run_id}/report") as page:
                assert (
                    "sandbox" in page.headers["Content-Security-Policy"]
                    and "hydraulic_sysid report" in await page.text()
                )
            items = f"record:{record},model:mod-sample_bench@record:{record}"
            series = (await json_of(client.get(f"/api/overlay?items={items}&channels=position")))["series"]
            assert [set(s["channels"]) for s in series] == [{"position"}] * 2

    run(test)


def test_the_model_of_an_opened_diagnosis_is_applied_and_undone(tmp_path: Path) -> None:
    folder = tmp_path / "demo"
    folder.mkdir()
    residual = {"before": {"validation": 3.0}, "after": {"validation": 1.0}, "after_each_effect": [{"name": "leak"}]}
    document = {
        "schema": "hydraulic_sysid.diagnose/2",
        "created": "2026",
        "verdict": {"text": "so"},
        "residual": residual,
    }
    (folder / "diagnose.json").write_text(json.dumps(document))
    (folder / "other.json").write_text("[1, 2]")
    (folder / "report.html").write_text("<!-- hydraulic_sysid report -->")
    (folder / "model.yaml").write_text(presets()["sample_bench"].read_text())

    async def test() -> None:
        async with rig(tmp_path / "out", open=[folder]) as bench, bench.client() as client:
            (run_found,) = (await json_of(client.get("/api/runs")))["runs"]
            assert (run_found["verb"], run_found["verdict"]) == ("diagnose", "so")
            before = (await json_of(client.get("/api/models")))["current"]
            applied = (await json_of(client.post(f"/api/runs/{run_found['id']}/apply", json={})))["current"]
            step = (await json_of(client.get("/api/timeline")))["steps"][-1]
            assert applied != before and step["model"] == applied and step["file"] == str(folder / "model.yaml")
            assert (step["what"], step["effect"], step["error_before"], step["error_after"]) == (
                "applied",
                "leak",
                3.0,
                1.0,
            )
            assert (await json_of(client.post("/api/timeline/undo", json={})))["current"] == before
            await json_of(client.post("/api/runs/none/apply", json={}), 404)

    run(test)


def test_a_job_outlives_its_page_and_can_be_cancelled(tmp_path: Path) -> None:
    async def test() -> None:
        async with rig(tmp_path) as bench, bench.client() as client:
            upload = (await json_of(client.post("/api/uploads", json={"name": STEPS.name})))["upload"]
            await json_of(client.put(f"/api/uploads/{upload}/file/{STEPS.name}", data=STEPS.read_bytes()))
            record = (await json_of(client.post(f"/api/uploads/{upload}/finish", json={})))["record"]["id"]
            asked = {"verb": "calibrate", "records": [record], "model": "mod-sample_bench"}
            async with client.ws_connect("/ws"):
                first = (await json_of(client.post("/api/jobs", json=asked), 202))["job"]["id"]
                waits = (await json_of(client.post("/api/jobs", json=asked), 202))["job"]["id"]
            assert len(bench.bench.hub) == 0, "the page is closed"
            await json_of(client.post(f"/api/jobs/{waits}/cancel", json={}))
            await json_of(client.post(f"/api/jobs/{first}/cancel", json={}))
            ended = await bench.finished(client, first)
            assert ended["phase"] == "cancelled" and (await bench.finished(client, waits))["phase"] == "cancelled"
            await json_of(client.post(f"/api/jobs/{first}/cancel", json={}), 400)
            assert not list((tmp_path / "runs").glob("*/model.yaml"))
        async with rig(tmp_path) as again, again.client() as client:
            known = (await json_of(client.get("/api/jobs")))["jobs"]
            assert {job["id"]: job["phase"] for job in known} == {first: "cancelled", waits: "cancelled"}

    run(test)
