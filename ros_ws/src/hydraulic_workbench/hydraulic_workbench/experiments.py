"""An experiment from the check before it to the record after it: a recorder, an excitation, and how they go on."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from hydraulic_bringup.demo.processes import Child
from hydraulic_interfaces.contract import ABORTED, EXCITATION_NODE, FINISHED, STARTED
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_workbench.board import Board
from hydraulic_workbench.calls import Graph, NoAnswerError
from hydraulic_workbench.errors import NotNowError, WorkbenchError
from hydraulic_workbench.folder import Folder
from hydraulic_workbench.jobs import Job
from hydraulic_workbench.library import Entry
from hydraulic_workbench.plant import Plant
from hydraulic_workbench.processes import Processes

LISTENERS = 3  # to commands, before the excitation begins: plant, recorder, and this server
START_S = 60.0
SILENCE_S = 10.0  # of a plant in lockstep, until the excitation aborts
SAME_PLACE_M = 0.02
_LOOK_S = 0.1

Recorded = Callable[[Path, Entry, str], Awaitable[str]]
"""Takes the bag, the plan and how it ended; the identifier of the record."""


class Experiments:
    """One experiment at a time."""

    def __init__(
        self, board: Board, graph: Graph, processes: Processes, folder: Folder, plant: Plant, recorded: Recorded
    ) -> None:
        self._board, self._graph, self._processes = board, graph, processes
        self._folder, self._plant, self._recorded = folder, plant, recorded
        self._task: asyncio.Task[None] | None = None
        self._recorder: Child | None = None
        self._excitation: Child | None = None
        self._aborting = False
        self.recorder_status: dict[str, Any] = {}
        self.event: dict[str, Any] = {}

    @property
    def busy(self) -> bool:
        """Whether one is on."""
        return self._task is not None and not self._task.done()

    def start(self, plan: Entry, rehearsal: Job, name: str, position: float | None) -> None:
        """Play a plan whose rehearsal has passed, and record it. ``position`` [m]: where the piston stands now.

        :raises NotNowError: something is in the way; the text says what.
        """
        self._check(plan, rehearsal, position)
        bag = self._folder.new(self._folder.records, name)
        self._aborting, self.recorder_status, self.event = False, {}, {}
        self._put(phase="starting", plan=plan.id, plan_name=plan.name, record=None, progress=0.0, text="starting …",
                  seconds_left=plan.found["seconds"], bag=bag.name)  # fmt: skip
        self._task = asyncio.create_task(self._play(plan, bag))

    def _check(self, plan: Entry, rehearsal: Job, position: float | None) -> None:
        if self.busy:
            raise NotNowError("an experiment is on; abort it first")
        passed = rehearsal.verb == "rehearse" and rehearsal.phase == "finished" and rehearsal.exit_code == 0
        if not passed:
            raise NotNowError(
                "the check before the experiment has not been passed: rehearse the plan first", "rehearsal"
            )
        if rehearsal.line[1] != str(plan.file) or _changed(plan.file) > rehearsal.created:
            raise NotNowError("the plan is another one than was rehearsed: rehearse it again", "rehearsal")
        began = rehearsed_from(rehearsal, float(plan.found["centre"]))
        if position is not None and not plan.found["approach"] and abs(position - began) > SAME_PLACE_M:
            where = f"at {1e3 * position:.0f} mm, and the rehearsal began at {1e3 * began:.0f} mm"
            raise NotNowError(f"the piston stands {where}: rehearse the plan again", "rehearsal")
        now = self._board["plant"]
        if now["phase"] != "running":
            raise NotNowError("no plant runs")
        if not now.get("enabled"):
            raise NotNowError("the plant is not enabled: enable it first")
        if now.get("source"):
            raise NotNowError(f"{now['source']} commands the plant now: stop it first")

    async def abort(self) -> None:
        """Bring the drive to zero and end the record.

        :raises NotNowError: nothing is on.
        """
        if not self.busy:
            raise NotNowError("no experiment is on")
        self._aborting = True
        self._put(text="aborting …")
        try:
            await self._graph.trigger(f"{EXCITATION_NODE}/abort", 1.0)
        except NoAnswerError:  # it has not begun yet
            await self._processes.stop(self._excitation)

    async def stop(self) -> None:
        """End whatever is on, and wait until it has ended."""
        if self.busy and self._task is not None:
            self._aborting = True
            await self._processes.stop(self._excitation)
            await asyncio.wait({self._task}, timeout=START_S)

    async def _play(self, plan: Entry, bag: Path) -> None:
        text = ""
        try:
            text = await self._run(plan, bag)
            phase = "aborted" if text else "finished"
        except HydraulicError as error:
            phase, text = "failed", str(error)
        finally:
            await self._processes.stop(self._excitation)
            await self._processes.stop(self._recorder)
        record = await self._recorded(bag, plan, text) if (bag / "metadata.yaml").is_file() else None
        done = f"{plan.name} was played and recorded" if phase == "finished" else f"{plan.name} {phase}: {text}"
        self._put(phase=phase, record=record, progress=float(phase == "finished"), seconds_left=0.0, text=done)

    async def _run(self, plan: Entry, bag: Path) -> str:
        """Empty, or why the excitation aborted or did not start.

        :raises WorkbenchError: a process failed.
        """
        self._recorder = self._processes.start(
            "recorder", "hydraulic_sysid.nodes.recorder", "--ros-args", "-p", f"output:={bag.absolute()}",
            "-p", "stop_on_experiment_end:=true", "-p", "exit_when_done:=true",
        )  # fmt: skip
        self._put(phase="recording", text="starting the recorder …")
        await self._until(lambda: self.recorder_status.get("state") == "recording", self._recorder, START_S)
        patience = SILENCE_S if self._plant.chosen.lockstep else 0.5
        self._excitation = self._processes.start(
            "excitation", "hydraulic_sysid.nodes.excitation", "--ros-args", "-p", f"plan:={plan.file}",
            "-p", "autostart:=true", "-p", "exit_when_done:=true", "-p", f"start_timeout:={START_S}",
            "-p", f"listeners:={LISTENERS}", "-p", f"state_timeout:={patience}",
        )  # fmt: skip
        self._put(text="waiting for the plant to be ready …")
        while self._excitation.exit_code is None:
            self._show(plan)
            await asyncio.sleep(_LOOK_S)
        if self._excitation.exit_code == 0:
            await self._until(lambda: self._recorder is None or self._recorder.exit_code is not None, None, START_S)
            return ""
        words = self._excitation.tail()
        if f" {ABORTED}: " in words:
            await self._until(lambda: self._recorder is None or self._recorder.exit_code is not None, None, 10.0)
            return words.rpartition(f" {ABORTED}: ")[2].splitlines()[0]
        if self._aborting:
            return "ended before it began"
        raise WorkbenchError(f"the excitation {self._excitation.ending()}:\n{words}")

    def _show(self, plan: Entry) -> None:
        """Where the run is, by the plant's own time."""
        if self.event.get("event") not in (STARTED, FINISHED, ABORTED):
            return
        total = float(plan.found["seconds"])
        played = min(max((self.event.get("now_ns", 0) - self.event.get("started_ns", 0)) * 1e-9, 0.0), total)
        text = "aborting …" if self._aborting else f"playing {plan.name}"
        self._put(phase="running", progress=played / total, seconds_left=total - played, text=text)

    async def _until(self, condition: Callable[[], object], child: Child | None, patience: float) -> None:
        deadline = time.monotonic() + patience
        while not condition():
            if child is not None and child.exit_code is not None:
                raise WorkbenchError(f"the {child.name} {child.ending()}:\n{child.tail()}")
            if self._aborting and child is not None:
                raise WorkbenchError("ended before it began")
            if time.monotonic() > deadline:
                raise WorkbenchError(f"waited {patience:g} s in vain for recorder or plant")
            await asyncio.sleep(0.05)

    def _put(self, **values: Any) -> None:
        self._board.change("experiment", **values)


def rehearsed_from(rehearsal: Job, centre: float) -> float:
    """Where a rehearsal began [m]."""
    line = rehearsal.line
    return float(line[line.index("--position") + 1]) if "--position" in line else centre


def _changed(file: Path) -> float:
    try:
        return file.stat().st_mtime
    except OSError:
        return float("inf")
