"""Models and the timeline of the one that is worked on."""

from __future__ import annotations

from typing import Any

from aiohttp import web

from hydraulic_workbench.bench import Bench
from hydraulic_workbench.reading import models
from hydraulic_workbench.routes.common import answer, asked
from hydraulic_workbench.timeline import Step


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""
    shelf, timeline = bench.library.models, bench.timeline

    async def listed(_: web.Request) -> web.Response:
        return answer({"models": shelf.documents(), "current": bench.current_model.id})

    async def one(request: web.Request) -> web.Response:
        model = shelf[request.match_info["id"]]
        return answer(model.document() | await bench.workers.run(models.whole, model.usable().file))

    async def choose(request: web.Request) -> web.Response:
        model = shelf[(await asked(request)).get("model")].usable()
        timeline.add(Step("chosen", str(model.file)))
        return answer(_current())

    async def steps(_: web.Request) -> web.Response:
        rows = [
            {"index": index, "what": s.what, "effect": s.effect, "model": entry.id if entry else None, "file": s.file,
             "name": entry.document()["name"] if entry else s.file, "error_before": s.error_before,
             "error_after": s.error_after, "run": s.run, "time": s.time, "current": index == timeline.index}
            for index, s in enumerate(timeline.steps)
            for entry in [_entry(s)]
        ]  # fmt: skip
        return answer({"steps": rows, "can_undo": timeline.can_undo})

    def _entry(step: Step) -> Any:
        return next((m for m in shelf if str(m.file) == step.file), None)

    def _current() -> dict[str, Any]:
        return {"current": bench.current_model.id}

    async def undo(_: web.Request) -> web.Response:
        timeline.undo()
        return answer(_current())

    async def go(request: web.Request) -> web.Response:
        timeline.go((await asked(request)).get("index"))
        return answer(_current())

    return [
        web.get("/api/models", listed),
        web.get("/api/models/{id}", one),
        web.post("/api/models/current", choose),
        web.get("/api/timeline", steps),
        web.post("/api/timeline/undo", undo),
        web.post("/api/timeline/go", go),
    ]
