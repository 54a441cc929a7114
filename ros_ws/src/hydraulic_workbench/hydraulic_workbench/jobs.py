"""Runs of verbs in processes of their own: they outlive a page that is closed, and can be cancelled."""

from __future__ import annotations

import asyncio
import json
import shlex
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_bringup.demo.processes import Child
from hydraulic_node_utils.cli import NEGATIVE, OK
from hydraulic_node_utils.whole_file import write_text
from hydraulic_workbench.errors import UnknownError, WorkbenchError
from hydraulic_workbench.folder import Folder
from hydraulic_workbench.hub import Hub
from hydraulic_workbench.processes import Processes, interrupt, nicer
from hydraulic_workbench.progress_log import ProgressLog
from hydraulic_workbench.verbs_of_jobs import VERBS, Asked, command

PACKAGE = "hydraulic_sysid"
NICE = 10  # the plant and what drives it come first
LOG, NOTE = "output.log", "job.json"
_LOOK_S = 0.15
_KEPT = 200  # jobs that the page lists


@dataclass
class Job:
    """One run: what was asked, how it goes, and what it said."""

    id: str
    verb: str
    title: str
    folder: Path
    line: list[str]
    model: str | None = None
    records: list[str] = field(default_factory=list)
    plan: str | None = None
    phase: str = "queued"
    progress: str = ""
    error: str = ""
    exit_code: int | None = None
    created: float = field(default_factory=time.time)
    seconds: float = 0.0
    residual: list[float] = field(default_factory=list)
    candidates: list[dict[str, Any]] = field(default_factory=list)
    cancelled: bool = False
    child: Child | None = field(default=None, repr=False)

    @property
    def over(self) -> bool:
        """Whether nothing more will come of it."""
        return self.phase not in ("queued", "running")

    def document(self) -> dict[str, Any]:
        """For the page."""
        same = ("id", "verb", "title", "model", "records", "plan", "phase", "progress", "error", "exit_code", "created",
                "residual")  # fmt: skip
        good = None if self.phase != "finished" else self.exit_code == OK
        run = self.id if self.phase == "finished" else None
        shown = " ".join([f"./bench run {PACKAGE}", *map(shlex.quote, self.line)])
        return {key: getattr(self, key) for key in same} | {
            "good": good, "run": run, "command": shown, "seconds": round(self.seconds, 2)
        }  # fmt: skip


Finished = Callable[[Job], Awaitable[None]]


class Jobs:
    """The jobs of this server, and those that an earlier one has left in the folder."""

    def __init__(self, folder: Folder, processes: Processes, hub: Hub, finished: Finished) -> None:
        self._folder, self._processes, self._hub, self._finished = folder, processes, hub, finished
        self._jobs: dict[str, Job] = {}
        self._lanes = {True: asyncio.Lock(), False: asyncio.Lock()}
        self._tasks: set[asyncio.Task[None]] = set()
        for note in sorted(folder.runs.glob(f"*/{NOTE}")):
            self._remember(note)

    def _remember(self, note: Path) -> None:
        try:
            kept = json.loads(note.read_text("utf-8"))
            job = Job(folder=note.parent, **kept)
        except (OSError, ValueError, TypeError):
            return
        job.phase = job.phase if job.over else "interrupted"
        self._jobs[job.id] = job

    def __getitem__(self, identifier: str) -> Job:
        """:raises UnknownError: there is none."""
        if identifier not in self._jobs:
            raise UnknownError(f"there is no job {identifier!r}", "job")
        return self._jobs[identifier]

    def newest_first(self) -> list[Job]:
        """Those that the page lists."""
        return list(reversed(self._jobs.values()))[:_KEPT]

    def start(
        self, verb: str, title: str, asked: Asked, model: str | None, records: list[str], plan: str | None = None
    ) -> Job:
        """Have a verb run as soon as those before it in its lane are done.

        :raises WorkbenchError: it cannot be run like that.
        """
        number = f"{len(list(self._folder.runs.iterdir())) + 1:03d}"
        out = self._folder.new(self._folder.runs, f"{number}-{verb}")
        line = command(verb, asked, out)
        out.mkdir()
        job = Job(out.name, verb, title, out, line, model, records, plan)
        self._jobs[job.id] = job
        self._note(job)
        task = asyncio.create_task(self._run(job))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        self._tell(job)
        return job

    async def cancel(self, job: Job) -> None:
        """End it: at once where it waits. A diagnosis may take its time to end with the best so far, until asked twice.

        :raises WorkbenchError: it is over.
        """
        if job.over:
            raise WorkbenchError(f"{job.title} is over")
        again, job.cancelled = job.cancelled, True
        if job.child is not None:
            job.progress = "ending …"
            self._tell(job)
            child = job.child
            if VERBS[job.verb].ends_early and not again:
                interrupt(child)
                return
            task = asyncio.create_task(self._processes.stop(child))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def stop(self) -> None:
        """The server ends: so do the jobs."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for job in self._jobs.values():
            if not job.over:
                job.phase = "interrupted"
                self._note(job)

    async def _run(self, job: Job) -> None:
        async with self._lanes[VERBS[job.verb].heavy]:
            if job.cancelled:
                job.phase = "cancelled"
                self._note(job)
                self._tell(job)
                return
            job.phase, begun = "running", time.monotonic()
            self._note(job)
            log = ProgressLog(job.folder / LOG)
            job.child = self._processes.start(job.verb, PACKAGE, *job.line, "--progress", log=job.folder / LOG)
            nicer(job.child, NICE)
            while job.child.exit_code is None:
                await asyncio.sleep(_LOOK_S)
                job.seconds = time.monotonic() - begun
                self._take(job, log.news())
            self._take(job, log.news())
            job.exit_code, job.child = job.child.exit_code, None
        wrote = any(file.name != NOTE for file in job.folder.glob("*.json"))
        done = wrote and job.exit_code in (OK, NEGATIVE)
        if done:
            await self._finished(job)
        job.phase = "finished" if done else "cancelled" if job.cancelled else "failed"
        job.error = "" if done or job.cancelled else log.words()  # who cancels is not told where that struck
        job.progress = ""
        self._note(job)
        self._tell(job)

    def _take(self, job: Job, news: list[dict[str, Any]]) -> None:
        for told in news:
            if isinstance(text := told.get("progress"), str):
                job.progress = text if not job.cancelled else "ending …"
            if isinstance(left := told.get("residual"), int | float):
                job.residual.append(float(left))
            if isinstance(rows := told.get("candidates"), list):
                job.candidates = rows
                self._hub.tell("candidates", job=job.id, rows=rows)
        self._tell(job)

    def _tell(self, job: Job) -> None:
        self._hub.tell("job", job=job.document())

    def _note(self, job: Job) -> None:
        kept = ("id", "verb", "title", "line", "model", "records", "plan", "phase", "error", "exit_code", "created",
                "seconds", "residual", "candidates")  # fmt: skip
        write_text(job.folder / NOTE, json.dumps({key: getattr(job, key) for key in kept}) + "\n")
