"""The demo as a user runs it: real processes on a domain of its own, from the excitation to the page."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_sysid.data.records import read_records

pytest.importorskip("rclpy")

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"
MARK = "HYDRAULIC_BENCH_TEST_RUN"
PATIENCE_S = 900.0  # a run takes most of a minute; on a machine that is busy besides, many times that

pytestmark = pytest.mark.timeout(PATIENCE_S + 60.0)


@dataclass
class Demo:
    """A demo that has been started; all its processes carry a mark of their own in their environment."""

    popen: subprocess.Popen[str]
    out: Path
    mark: str

    @classmethod
    def start(cls, folder: Path, *options: str, environment: dict[str, str] | None = None) -> Demo:
        mark = uuid.uuid4().hex
        paths = os.pathsep.join(path for path in sys.path if path)
        env = {**os.environ, MARK: mark, "PYTHONPATH": paths, "COLUMNS": "200", **(environment or {})}
        command = [sys.executable, "-m", "hydraulic_bringup.verbs.demo", "--out", str(folder / "run"), *options]
        pipe = subprocess.PIPE
        popen = subprocess.Popen(command, cwd=folder, env=env, stdout=pipe, stderr=pipe, text=True)
        return cls(popen, folder / "run", mark)

    def processes(self) -> dict[int, str]:
        """Command lines of all processes of this run, the demo's own among them."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if f"{MARK}={self.mark}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                    found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        return found

    def pid_of(self, module: str) -> int:
        """Process id of one node."""
        (pid,) = (pid for pid, line in self.processes().items() if f" {module} " in line)
        return pid

    def finish(self) -> tuple[int, str, str]:
        """Exit code, output and errors."""
        output, errors = self.popen.communicate(timeout=PATIENCE_S)
        return self.popen.returncode, output, errors

    def end(self) -> None:
        """Leave nothing behind, whatever the test found."""
        for pid in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired, ValueError):
            self.popen.communicate(timeout=10.0)


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Callable[..., Demo]]:
    """`demo("--quick")` starts a demo that is surely ended after the test."""
    started: list[Demo] = []

    def start(*options: str, environment: dict[str, str] | None = None) -> Demo:
        started.append(Demo.start(tmp_path, *options, environment=environment))
        return started[-1]

    yield start
    for one in started:
        one.end()


@dataclass(frozen=True)
class Finished:
    """What a whole run has left."""

    code: int
    output: str
    errors: str
    out: Path
    left: dict[int, str]

    def result(self, verb: str) -> dict[str, Any]:
        document: dict[str, Any] = json.loads((self.out / f"{verb}.json").read_text(encoding="utf-8"))
        return document


def finished(run: Demo) -> Finished:
    try:
        code, output, errors = run.finish()
        return Finished(code, output, errors, run.out, run.processes())
    finally:
        run.end()


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """One whole quick run, shared by the tests that look at what it left."""
    return finished(Demo.start(tmp_path_factory.mktemp("quick"), "--quick"))


def test_it_ends_well_and_leaves_no_process(quick: Finished) -> None:
    assert quick.code == 0, quick.errors + quick.output
    assert quick.errors == ""
    assert quick.left == {}
    assert str(quick.out / "report.html") in quick.output


def test_it_leaves_page_results_bags_and_logs(quick: Finished) -> None:
    left = {path.name for path in quick.out.iterdir()}
    assert {"report.html", "identify.json", "compare.json", "chirp", "multisine", "logs"} <= left
    page = (quick.out / "report.html").read_text(encoding="utf-8")
    assert "moog_mcr_m_1002_bench" in page
    assert "<script src" not in page  # self-contained


@pytest.mark.parametrize("name", ["chirp", "multisine"])
def test_the_bags_hold_what_was_asked_for_and_what_happened(quick: Finished, name: str) -> None:
    (record,) = read_records(quick.out / name)  # in which no sample is missing
    assert record.dt == pytest.approx(1e-3)
    assert {"command", "drive", "position", "velocity", "pressure_a", "pressure_b"} <= set(record.channels)
    assert record.description["experiment"]["event"] == "finished"
    assert record.duration > 4.0
    assert np.ptp(record["drive"]) > 2.0
    assert np.ptp(record["position"]) > 2e-3


def test_the_linear_model_is_judged_on_the_record_that_it_was_not_fitted_to(quick: Finished) -> None:
    identified = quick.result("identify")
    assert identified["schema"] == "hydraulic_sysid.identify/3"
    assert [r["name"] for r in identified["fit"]["records"]] == ["chirp"]
    assert [r["name"] for r in identified["test"]["records"]] == ["multisine"]
    assert identified["test"]["best_fit_one_step"] > 60.0
    assert identified["verdict"]["text"] in unwrapped(quick.output)


def test_the_data_sheet_misses_what_was_hidden(quick: Finished) -> None:
    compared = quick.result("compare")
    assert compared["schema"] == "hydraulic_sysid.compare/2"
    assert compared["model"]["name"] == "moog_mcr_m_1002_bench"
    assert "valve_deadband" not in compared["model"]["effects"]
    assert [r["name"] for r in compared["records"]] == ["chirp", "multisine"]
    assert compared["verdict"]["level"] == "off"
    assert compared["summary"]["velocity"]["horizon"]["ratio"] > 3.0
    assert compared["verdict"]["text"] in unwrapped(quick.output)


def test_the_sensors_are_not_blamed(quick: Finished) -> None:
    """What is the same in both is explained down to the noise, and the noise is estimated as it was set."""
    summary = quick.result("compare")["summary"]
    assert summary["pressure_supply"]["horizon"]["ratio"] < 1.5
    assert summary["pressure_supply"]["noise_std"] == pytest.approx(15e3, rel=0.2)
    assert summary["position"]["noise_std"] == pytest.approx(21e-6, rel=0.2)  # 20 µm, and steps of 24 µm


def test_the_hidden_dead_band_shows_over_the_valve(quick: Finished) -> None:
    found = [f for f in quick.result("compare")["findings"] if f["kind"] == "depends_on"]
    assert found
    assert found[0]["channel"] == "velocity"
    assert found[0]["numbers"]["variable"] in ("spool", "drive")
    # The measured piston is slower than the simulated one, whichever way the valve opens.
    assert found[0]["numbers"]["mean_above_zero"] < -2e-3
    assert found[0]["numbers"]["mean_below_zero"] > 2e-3


def unwrapped(text: str) -> str:
    return " ".join(text.split())


def excited(run: Demo, wait_until: Callable[..., Any], log: str = "excitation_chirp.log") -> None:
    """Wait until the plant is being excited."""

    def started() -> bool:
        assert run.popen.poll() is None, run.finish()
        path = run.out / "logs" / log
        return path.exists() and "started" in path.read_text()

    wait_until(started, f"the excitation to start ({log})", PATIENCE_S)


@pytest.mark.thorough
@pytest.mark.parametrize("node", ["recorder", "excitation"])
def test_a_node_that_dies_fails_its_step_and_ends_the_run(demo: Any, wait_until: Any, node: str) -> None:
    run = demo("--quick", "--no-lockstep")  # which leaves time to kill it
    excited(run, wait_until)
    os.kill(run.pid_of(f"hydraulic_sysid.nodes.{node}"), signal.SIGKILL)
    code, _, errors = run.finish()
    assert code == 1
    assert "demo: failed at step 'chirp: excite and record'" in errors
    assert f"process {node}_chirp: it was killed by SIGKILL" in errors
    assert str(run.out / "logs" / f"{node}_chirp.log") in errors
    assert "Traceback" not in errors
    assert run.processes() == {}
    assert not (run.out / "report.html").exists()


@pytest.mark.thorough
def test_an_abort_is_answered_by_another_run_and_ctrl_c_by_an_end(demo: Any, wait_until: Any) -> None:
    run = demo()  # in lockstep, so that a busy machine aborts nothing; the long experiments leave time to do so
    excited(run, wait_until)
    # A second into the run every node has found every other: who leaves sooner may not be heard leaving.
    bag = run.out / "chirp"
    wait_until(lambda: sum(f.stat().st_size for f in bag.glob("*.mcap")) > 200_000, "a second of the record", 30.0)
    os.kill(run.pid_of("hydraulic_sysid.nodes.excitation"), signal.SIGINT)  # which makes it abort the experiment
    excited(run, wait_until, "excitation_chirp_2.log")
    aborted = read_records(run.out / "chirp.aborted", "resample")[0]
    assert aborted.description["experiment"]["event"] == "aborted"
    os.kill(run.popen.pid, signal.SIGINT)
    code, output, errors = run.finish()
    assert code == 130, output + errors
    assert "chirp was aborted: interrupted by SIGINT" in output
    assert "interrupted" in errors
    assert "Traceback" not in errors + output
    assert run.processes() == {}


def test_a_plant_that_cannot_start_is_told_at_once(demo: Any, tmp_path: Path) -> None:
    """It dies before any of its services is there, and nobody waits for them. (Only nodes need these types.)"""
    package = tmp_path / "elsewhere" / "diagnostic_msgs"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise ImportError('a broken set-up')\n")
    run = demo("--quick", environment={"PYTHONPATH": os.pathsep.join([str(package.parent), *filter(None, sys.path)])})
    code, _, errors = run.finish()
    assert code == 1
    assert "demo: failed at step 'start the plant'" in errors
    assert "a broken set-up" in errors
    assert run.processes() == {}


@pytest.mark.thorough
def test_records_of_ones_own_need_no_graph(tmp_path: Path) -> None:
    run = finished(Demo.start(tmp_path, "--record", str(SAMPLE), "--model", "sample_bench"))
    assert run.code == 0, run.errors
    assert run.left == {}
    assert {path.name for path in run.out.iterdir()} == {
        "report.html",
        "identify.json",
        "compare.json",
        "diagnose.json",
        "model.yaml",
    }
    compared = run.result("compare")
    assert [r["name"] for r in compared["records"]] == ["multisine", "steps", "triangle"]
    assert compared["model"]["name"] == "sample_bench"
    assert compared["summary"]["velocity"]["horizon"]["ratio"] > 1.5
    assert len(run.result("identify")["test"]["records"]) == 3
