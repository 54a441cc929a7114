"""Everything that the server holds together: what the routes ask, and what happens by itself."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydraulic_interfaces.contract import ESTIMATOR_NODE, absolute
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.display import SHOWN
from hydraulic_workbench.board import Board
from hydraulic_workbench.calls import Graph
from hydraulic_workbench.columns import COLUMNS
from hydraulic_workbench.diagnostics import HealthBoard, Row, number
from hydraulic_workbench.errors import NotNowError
from hydraulic_workbench.experiments import Experiments
from hydraulic_workbench.folder import Folder
from hydraulic_workbench.followers import Controller, LiveModel, Reference
from hydraulic_workbench.guess import Guess, draw
from hydraulic_workbench.hub import Hub
from hydraulic_workbench.intake import Intake
from hydraulic_workbench.jobs import Job, Jobs
from hydraulic_workbench.library import DEFAULT_MODEL, Entry, Library
from hydraulic_workbench.plant import Plant
from hydraulic_workbench.plant_kinds import GUESS, Chosen
from hydraulic_workbench.processes import Processes
from hydraulic_workbench.results import Results, errors_of
from hydraulic_workbench.sample_ring import SampleRing
from hydraulic_workbench.timeline import Step, Timeline
from hydraulic_workbench.uploads import Uploads
from hydraulic_workbench.verbs_of_jobs import VERBS, Asked
from hydraulic_workbench.workers import Workers

POSITION = next(place for place, column in enumerate(COLUMNS) if column.key == "position")
HIDDEN_OF_A_GUESS = ("effects", "extra_effects")
_WATCH_S = 0.2
_HEALTH_EVERY = 3


@dataclass(frozen=True)
class Settings:
    """What the command line says."""

    folder: Path
    open: Sequence[Path] = ()
    hides: str = ""
    attach: bool = False


class Bench:
    """Made in the loop's thread, over the graph; `begin` and `end` frame its life."""

    def __init__(
        self, settings: Settings, graph: Graph, ring: SampleRing, intake: Intake, env: Mapping[str, str],
        workers: Workers | None = None,
    ) -> None:  # fmt: skip
        self.settings, self.graph, self._ring, self._intake = settings, graph, ring, intake
        self.folder = Folder(settings.folder)
        self.workers = workers or Workers()
        self.hub = Hub(ring)
        self.board = Board(self.hub)
        self.health = HealthBoard()
        self.processes = Processes(self.folder, env)
        self.library = Library(self.folder, self.workers, self.hub)
        self.plant = Plant(self.board, graph, self.processes, self.health, self._leave_plant)
        lockstep = lambda: self.plant.chosen.lockstep  # noqa: E731
        self.live_model = LiveModel(self.board, self.processes)
        self.controller = Controller(self.board, graph, self.processes, lockstep)
        self.reference = Reference(self.board, graph, self.processes, lockstep)
        self.experiments = Experiments(self.board, graph, self.processes, self.folder, self.plant, self._recorded)
        self.jobs = Jobs(self.folder, self.processes, self.hub, self._job_finished)
        self.results = Results(self.jobs, self.folder, self.workers)
        self.uploads = Uploads(self.folder, self.workers, self.library)
        self.timeline = Timeline(self._timeline_changed)
        self.guess: Guess | None = None
        self._watcher: asyncio.Task[None] | None = None
        self.ready = asyncio.Event()

    async def begin(self) -> None:
        """Read what there is, and begin to watch."""
        self._watcher = asyncio.create_task(self._watch())
        if self.settings.attach:
            self.plant.attach()
        await self.library.begin()
        for folder in self.settings.open:
            await self.library.open(folder.absolute(), "opened", deep=True)
            self.results.open(folder.absolute())
        memory = self.folder.recall()
        self.timeline.recall(memory.get("timeline"))
        if not self.timeline.steps:
            preset = next(m for m in self.library.models if m.name == DEFAULT_MODEL)
            self.timeline.add(Step("chosen", str(preset.file)))
        self._show_current()
        self.ready.set()

    async def end(self) -> None:
        """Bring all to rest: what commands first, the plant last."""
        if self._watcher is not None:
            self._watcher.cancel()
        await self.jobs.stop()
        await self._leave_plant()
        await self.live_model.node.stop()
        await self.processes.stop_all()
        self.workers.stop()

    # What the graph says.

    def heard(self, name: str, content: Any) -> None:
        """What has come from the graph, in the loop's thread."""
        if name == "samples":
            self.hub.samples_until(content)
        elif name == "diagnostics":
            rows: list[Row] = content
            self.health.take(rows)
        elif name == "experiment":
            self.experiments.event = content
        elif name == "status":
            self.experiments.recorder_status = content

    async def stop(self) -> dict[str, Any]:
        """Emergency stop, for the socket and for the route."""
        return await self.plant.emergency_stop()

    # What is asked of models, records and runs.

    @property
    def current_model(self) -> Entry:
        """The model that the timeline stands at."""
        file = Path(self.timeline.current.file)
        found = self.library.models.of_file(file)
        if found is None:
            raise NotNowError(f"the model {file} is not known any more")
        return found

    def model(self, identifier: Any) -> Entry:
        """A model by its identifier; the current one where none is given."""
        return self.library.models[identifier].usable() if identifier else self.current_model

    def run_verb(self, verb: str, asked: Mapping[str, Any]) -> Job:
        """Have a verb run on what a page names by identifiers."""
        if verb == "rehearse" and (position := self.plant_position()) is not None:
            asked = {"position": position, **asked}
        model = self.model(asked.get("model"))
        records = [self.library.records[i].usable() for i in _list(asked.get("records"))]
        holdout = [self.library.records[i].usable() for i in _list(asked.get("holdout"))]
        plan = self.library.plans[asked["plan"]].usable() if asked.get("plan") else None
        diagnosis = self.results.folder(asked["run"]) if asked.get("run") else None
        wanted = Asked(
            model.file,
            [(r.file, r.columns) for r in records],
            [(r.file, r.columns) for r in holdout],
            plan.file if plan else None,
            diagnosis,
            dict(asked),
        )
        what = plan.name if plan else " ".join(filter(None, [asked.get("effect"), asked.get("signal")]))
        of = f" on {', '.join(r.name for r in records)}" if records else ""
        title = f"{verb.replace('_', ' ')}{' ' if what else ''}{what}{of}"
        return self.jobs.start(verb, title, wanted, model.id, [r.id for r in records], plan.id if plan else None)

    def plant_position(self) -> float | None:
        """Where the piston stands [m]; None where no plant runs."""
        return self._ring.newest(POSITION) if self.plant.running else None

    async def _job_finished(self, job: Job) -> None:
        for file in sorted(job.folder.glob("*.yaml")):
            if file.stem in ("model",) or file.stem.startswith("competing_"):
                entry = await self.library.add_model(file, "run", run=job.id)
                if file.stem == "model" and (what := VERBS[job.verb].leads_to_model):
                    self._step(what, entry, job.folder, job.id)
            elif job.verb in ("design", "next_experiment"):
                source = "designed" if job.verb == "design" else "next_experiment"
                await self.library.add_plan(file, source, run=job.id)

    def _step(self, what: str, entry: Entry, folder: Path, run: str) -> None:
        before, after, effect = errors_of(folder)
        self.timeline.add(Step(what, str(entry.file), effect, before, after, run))

    def apply(self, run: str) -> None:
        """Go on with the model that a diagnosis names.

        :raises NotNowError: it names none.
        """
        folder = self.results.folder(run)
        entry = self.library.models.of_file(folder / "model.yaml")
        if entry is None:
            raise NotNowError("this run names no model: see its verdict")
        self._step("applied", entry, folder, run)

    def _timeline_changed(self) -> None:
        self.folder.keep({"timeline": self.timeline.memory()})
        self.hub.tell("timeline")
        self._show_current()

    def _show_current(self) -> None:
        entry = self.library.models.of_file(Path(self.timeline.current.file))
        if entry is not None:
            shown = entry.document()
            wanted = ("id", "name", "file")
            self.board.put("current_model", {k: shown[k] for k in wanted} | {"effects": shown.get("effects", [])})

    # What is asked of the plant.

    def start_plant(self, chosen: Chosen) -> None:
        """Start a plant; a riddle that was on is over."""
        if chosen.kind != GUESS:
            self.guess = None
            self.board.put("guess", None)
        self.plant.begin(chosen)

    def start_guess(self, model: Entry, lockstep: bool, seed: int | None = None) -> None:
        """Start a simulator that hides an effect."""
        self.guess = draw(load_model(model.file), self.settings.hides, seed)
        self.board.put("guess", self.guess.document())
        hidden = {self.guess.effect: self.guess.values}
        self.plant.begin(Chosen(GUESS, "simulator with a secret", model.file, model.id, hidden, lockstep=lockstep))

    async def choose_live_model(self, model: Entry | None) -> None:
        """Run another model beside the plant, or none; what the one before said is forgotten."""
        await self.live_model.choose(model)
        self.health.forget(absolute(ESTIMATOR_NODE, self.graph.namespace))

    def riddle(self) -> Guess:
        """The riddle that is on.

        :raises NotNowError: none is.
        """
        if self.guess is None:
            raise NotNowError("there is no riddle: start the plant that hides an effect")
        return self.guess

    async def _leave_plant(self) -> None:
        """What commands ends before the plant does."""
        await self.experiments.stop()
        await self.reference.node.stop()
        await self.controller.node.stop()

    async def _recorded(self, bag: Path, plan: Entry, ended: str) -> str:
        kind = self.plant.chosen.kind
        entry = await self.library.add_record(bag, "experiment", experiment=plan.id, plant=kind, ended=ended)
        return entry.id

    # What happens by itself.

    async def _watch(self) -> None:
        count = 0
        while True:
            await asyncio.sleep(_WATCH_S)
            count += 1
            self.plant.watch()
            heard = {row.name.partition(":")[0].rpartition("/")[2] for row in self.health.rows.values()}
            for follower, node in (
                (self.live_model.node, "estimator"),
                (self.controller.node, "controller"),
                (self.reference.node, "reference"),
            ):
                follower.watch(node in heard)
            if self.experiments.event:
                self.experiments.event["now_ns"] = self._intake.newest_ns
            if count % _HEALTH_EVERY == 0:
                self.board.put("health", self._health())
                estimate = self.health.values(f"{absolute(ESTIMATOR_NODE, self.graph.namespace)}: estimate")
                self.live_model.says(number(estimate, "position_residual_rms_m"))

    def _health(self) -> dict[str, Any]:
        own = f"{self.graph.namespace}/plant"
        timing = self.health.values(f"{own}: timing")
        jitter = number(timing, "jitter_p99_ms")
        hidden = HIDDEN_OF_A_GUESS if self.guess is not None and self.guess.phase == "hidden" else ()
        age = self._intake.age
        return {
            "rate": number(timing, "rate_Hz"),
            "jitter_ms": jitter,
            "age_ms": round(age * 1e3, 1) if age < 1e4 else None,
            "lost": self._intake.missing,
            "lost_by_plant": number(timing, "lost"),
            **self.health.document(hidden),
        }

    def hello(self, role: str) -> dict[str, Any]:
        """The first event of a page."""
        return {
            "version": 1,
            "role": role,
            "read_only": role != "operate",
            "folder": str(self.folder.root),
            "namespace": self.graph.namespace,
            "display": {unit: {"factor": factor, "unit": name} for unit, (factor, name) in SHOWN.items()},
            "time": time.time(),
            "state": self.board.state,
        }


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
