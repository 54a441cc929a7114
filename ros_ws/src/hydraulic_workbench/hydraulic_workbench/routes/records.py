"""Records: list, curves, overlays, and those that are dragged onto the page."""

from __future__ import annotations

from typing import Any

from aiohttp import web

from hydraulic_workbench.bench import Bench
from hydraulic_workbench.errors import WorkbenchError
from hydraulic_workbench.reading import overlays, records
from hydraulic_workbench.routes.common import answer, asked, number, points


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""
    shelf, uploads = bench.library.records, bench.uploads

    async def listed(_: web.Request) -> web.Response:
        return answer({"records": shelf.documents()})

    async def traces(request: web.Request) -> web.Response:
        record = shelf[request.match_info["id"]].usable()
        found = await bench.workers.run(
            records.traces, record.file, record.columns, _channels(request), *_span(request)
        )
        return answer({"record": record.id, **found})

    async def remove(request: web.Request) -> web.Response:
        shelf.remove(request.match_info["id"])
        return answer()

    async def overlay(request: web.Request) -> web.Response:
        items = list(filter(None, request.query.get("items", "").split(",")))
        if not items:
            raise WorkbenchError("items is empty; name records and models", "items")
        series = [await _series(item, request) for item in items]
        return answer({"series": series})

    async def _series(item: str, request: web.Request) -> dict[str, Any]:
        kind, _, rest = item.partition(":")
        if kind == "record":
            record = shelf[rest].usable()
            work = records.traces, record.file, record.columns
            title = record.name
        elif kind == "model" and "@record:" in rest:
            identifier, _, name = rest.partition("@record:")
            model, record = bench.model(identifier), shelf[name].usable()
            work = overlays.simulated, model.file, record.file, record.columns  # type: ignore[assignment]
            title = f"{model.document()['name']} on {record.name}"
        else:
            raise WorkbenchError(f"{item!r} is neither record:ID nor model:ID@record:ID", "items")
        found = await bench.workers.run(*work, _channels(request), *_span(request))
        return {"item": item, "title": title, **found}

    async def begin(request: web.Request) -> web.Response:
        return answer({"upload": uploads.begin((await asked(request)).get("name")).id})

    async def take(request: web.Request) -> web.Response:
        upload = uploads[request.match_info["id"]]
        await uploads.take(upload, request.match_info["path"], request.content.iter_chunked(1 << 16))
        return answer()

    async def preview(request: web.Request) -> web.Response:
        upload = uploads[request.match_info["id"]]
        return answer(await uploads.preview(upload, (await asked(request)).get("columns")))

    async def finish(request: web.Request) -> web.Response:
        upload, wanted = uploads[request.match_info["id"]], await asked(request)
        entry, file = await uploads.finish(upload, wanted.get("columns"), wanted.get("name"))
        return answer({"record": entry.document(), "columns_file": str(file) if file else None})

    async def drop(request: web.Request) -> web.Response:
        uploads.drop(uploads[request.match_info["id"]])
        return answer()

    return [
        web.get("/api/records", listed),
        web.get("/api/records/{id}/traces", traces),
        web.delete("/api/records/{id}", remove),
        web.get("/api/overlay", overlay),
        web.post("/api/uploads", begin),
        web.put("/api/uploads/{id}/file/{path:.+}", take),
        web.post("/api/uploads/{id}/preview", preview),
        web.post("/api/uploads/{id}/finish", finish),
        web.delete("/api/uploads/{id}", drop),
    ]


def _channels(request: web.Request) -> list[str]:
    return list(filter(None, request.query.get("channels", "").split(",")))


def _span(request: web.Request) -> tuple[float | None, float | None, int]:
    return number(request, "from"), number(request, "to"), points(request, 2000)
