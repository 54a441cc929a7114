"""Results of runs as the page shows them: documents and figures come from the verbs, nothing is computed here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hydraulic_sysid.data.results import PAGE, read_folder, verb_of
from hydraulic_workbench.errors import UnknownError
from hydraulic_workbench.folder import Folder
from hydraulic_workbench.jobs import Jobs
from hydraulic_workbench.reading import results
from hydraulic_workbench.workers import Workers


class Results:
    """Runs of this workbench, and those of folders that were opened."""

    def __init__(self, jobs: Jobs, folder: Folder, workers: Workers) -> None:
        self._jobs, self._own, self._workers = jobs, folder, workers
        self._opened: dict[str, Path] = {}

    def open(self, folder: Path) -> None:
        """List the runs that a folder holds, itself included."""
        for page in sorted({folder / PAGE, *folder.rglob(PAGE)}):
            if page.is_file() and page.parent.parent != self._own.runs:
                identifier = f"opened-{len(self._opened) + 1}"
                self._opened[identifier] = page.parent

    def folder(self, identifier: Any) -> Path:
        """The folder of a run.

        :raises UnknownError: there is none, or it has no result.
        """
        if identifier in self._opened:
            return self._opened[identifier]
        job = self._jobs[str(identifier)]
        if job.phase != "finished":
            raise UnknownError(f"{job.title} has no result: it is {job.phase}", "run")
        return job.folder

    async def list(self) -> list[dict[str, Any]]:
        """All runs, the newest first."""
        rows = []
        for job in self._jobs.newest_first():
            if job.phase == "finished":
                own = {"id": job.id, "verb": job.verb, "title": job.title, "created": job.created, "model": job.model,
                       "records": job.records, "folder": str(job.folder)}  # fmt: skip
                rows.append(own | await self._workers.run(results.summary, job.folder))
        for identifier, folder in self._opened.items():
            found = await self._workers.run(results.summary, folder)
            rows.append({"id": identifier, "title": folder.name, "folder": str(folder), "model": None, "records": [],
                         "created": folder.stat().st_mtime, "verb": "", **found})  # fmt: skip
        return rows

    async def document(self, identifier: Any, whole: bool) -> dict[str, Any]:
        """A run's document, without what only plots need unless the whole is asked for."""
        return await self._workers.run(results.document, self.folder(identifier), whole)


def errors_of(folder: Path) -> tuple[float | None, float | None, str | None]:
    """Residual over noise before and after the last run in it, and the effects that it has added.

    On validation data where effects were added; of a calibration on its test records, else on those it was fitted to.
    """
    found = read_folder(folder)[-1]
    if verb_of(found) == "calibrate":
        judged = found.get("test") or found["fit"]
        return float(judged["before"]), float(judged["after"]), None
    residual = found.get("residual")
    if not isinstance(residual, dict):
        return None, None, None
    effects = [row["name"] for row in residual.get("after_each_effect", [])]
    sides = (residual.get(side, {}).get("validation") for side in ("before", "after"))
    before, after = (None if value is None else float(value) for value in sides)
    return before, after, " + ".join(effects) or None
