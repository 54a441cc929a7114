"""What the page can choose from: records, models and plans, with what the process beside the server finds in them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_sim.model_file import presets
from hydraulic_sysid.excitation.plan import shipped_plans
from hydraulic_workbench import reading
from hydraulic_workbench.errors import WorkbenchError
from hydraulic_workbench.folder import Folder
from hydraulic_workbench.hub import Hub
from hydraulic_workbench.reading import models, plans, records
from hydraulic_workbench.shelf import Shelf
from hydraulic_workbench.workers import Workers

DEFAULT_MODEL = "moog_mcr_m_1002_bench"
RECOMMENDED_PLAN = "first_look"
OWN_PLANS = Path(reading.__file__).parents[1] / "plans"
_TABLES = ("*.csv", "*.csv.gz", "*.mat", "*.h5", "*.hdf5", "*.parquet")


@dataclass
class Entry:
    """A record, model or plan: its file, where it comes from, what was found in it, or why it cannot be read."""

    id: str
    name: str
    file: Path
    source: str
    created: float = field(default_factory=time.time)
    found: dict[str, Any] = field(default_factory=dict)
    more: dict[str, Any] = field(default_factory=dict)
    problem: str = ""

    def document(self) -> dict[str, Any]:
        """For the page."""
        return {"id": self.id, "file": str(self.file), "source": self.source, "created": self.created,
                "problem": self.problem, "name": self.name, **self.more, **self.found}  # fmt: skip

    def usable(self) -> Entry:
        """Itself.

        :raises WorkbenchError: it cannot be read.
        """
        if self.problem:
            raise WorkbenchError(f"{self.name} cannot be used: {self.problem}")
        return self

    @property
    def columns(self) -> Path | None:
        """Of a record: its column map."""
        return Path(named) if (named := self.found.get("columns")) else None


class Library:
    """The three shelves."""

    def __init__(self, folder: Folder, workers: Workers, hub: Hub) -> None:
        self._folder, self._workers = folder, workers
        self.records: Shelf[Entry] = Shelf("rec", "record", lambda: hub.tell("records"))
        self.models: Shelf[Entry] = Shelf("mod", "model", lambda: hub.tell("models"))
        self.plans: Shelf[Entry] = Shelf("plan", "plan", lambda: hub.tell("plans"))

    async def begin(self) -> None:
        """Put on the shelves what ships, and what the folder holds from before."""
        for name, file in presets().items():
            await self.add_model(file, "preset", name)
        for file in (*sorted(OWN_PLANS.glob("*.yaml")), *shipped_plans().values()):
            await self.add_plan(file, "shipped")
        await self.open(self._folder.root, "opened", deep=True)

    async def open(self, folder: Path, source: str, deep: bool = False) -> None:
        """Take what a folder holds: bags, tables with their maps, models, plans."""
        places = [folder, *(sorted(p for p in folder.rglob("*") if p.is_dir()) if deep else ())]
        for place in places:
            for bag in sorted({meta.parent for meta in place.glob("*/metadata.yaml")}):
                await self.add_record(bag, source)
            for table in sorted(file for kind in _TABLES for file in place.glob(kind)):
                if place == self._folder.records or self._folder.root not in (place, *place.parents):
                    await self.add_record(table, source, map_of(table))
            for model in sorted(place.glob("model.yaml")):
                await self.add_model(model, source)
            for plan in sorted(place.glob("*.yaml")) if place.name == self._folder.plans.name else ():
                await self.add_plan(plan, "designed")

    async def add_record(self, file: Path, source: str, columns: Path | None = None, **more: Any) -> Entry:
        """A record on its shelf, described."""
        kind = "bag" if file.is_dir() or file.suffix in (".mcap", ".db3") else "table"
        more = {"kind": kind, **more}
        return await self._add(self.records, file, source, _stem(file), more, records.describe, columns)

    async def add_model(self, file: Path, source: str, name: str = "", **more: Any) -> Entry:
        """A model on its shelf, described."""
        more = {"preset": source == "preset", **more}
        return await self._add(self.models, file, source, name or _stem(file), more, models.describe)

    async def add_plan(self, file: Path, source: str, **more: Any) -> Entry:
        """A plan on its shelf, described."""
        more = {"shipped": source == "shipped", "recommended": file.stem == RECOMMENDED_PLAN, **more}
        return await self._add(self.plans, file, source, file.stem, more, plans.describe)

    async def _add(
        self, shelf: Shelf[Entry], file: Path, source: str, name: str, more: dict[str, Any],
        describe: Callable[..., dict[str, Any]], *arguments: Any,
    ) -> Entry:  # fmt: skip
        file = file.absolute()
        known = shelf.of_file(file)
        if known is not None:
            return known
        found, problem = {}, ""
        try:
            found = await self._workers.run(describe, file, *arguments)
        except WorkbenchError as error:
            problem = str(error)
        created = await asyncio.to_thread(lambda: file.stat().st_mtime if file.exists() else time.time())
        return shelf.add(file, lambda i: Entry(i, name, file, source, created, found, more, problem))


def map_of(table: Path) -> Path | None:
    """The column map that lies beside a table."""
    file = table.with_name(f"{_stem(table)}.columns.yaml")
    return file if file.is_file() else None


def _stem(file: Path) -> str:
    return file.name.partition(".")[0] or file.name
