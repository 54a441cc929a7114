"""Runs of verbs, and their results."""

from __future__ import annotations

from aiohttp import web

from hydraulic_sysid.data.results import PAGE
from hydraulic_workbench.bench import Bench
from hydraulic_workbench.errors import WorkbenchError
from hydraulic_workbench.jobs import LOG
from hydraulic_workbench.progress_log import ProgressLog
from hydraulic_workbench.reading import results
from hydraulic_workbench.routes.common import answer, asked, number, points

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "sandbox allow-scripts"
)
"""Of a report: a document of its own, whose scripts are in it and reach nothing of this server."""


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""

    async def start(request: web.Request) -> web.Response:
        wanted = await asked(request)
        return answer({"job": bench.run_verb(str(wanted.get("verb")), wanted).document()}, 202)

    async def listed(_: web.Request) -> web.Response:
        return answer({"jobs": [job.document() for job in bench.jobs.newest_first()]})

    async def one(request: web.Request) -> web.Response:
        job = bench.jobs[request.match_info["id"]]
        words = ProgressLog(job.folder / LOG).words()
        return answer(job.document() | {"log": words, "candidates": job.candidates})

    async def cancel(request: web.Request) -> web.Response:
        await bench.jobs.cancel(bench.jobs[request.match_info["id"]])
        return answer()

    async def runs(_: web.Request) -> web.Response:
        return answer({"runs": await bench.results.list()})

    async def document(request: web.Request) -> web.Response:
        whole = request.query.get("whole") == "1"
        return answer(await bench.results.document(request.match_info["id"], whole))

    async def figures(request: web.Request) -> web.Response:
        folder = bench.results.folder(request.match_info["id"])
        return answer({"figures": await bench.workers.run(results.figures, folder)})

    async def figure(request: web.Request) -> web.Response:
        folder = bench.results.folder(request.match_info["id"])
        text = await bench.workers.run(results.figure, folder, request.match_info["name"])
        return web.Response(text=text, content_type="application/json")

    async def report(request: web.Request) -> web.StreamResponse:
        file = bench.results.folder(request.match_info["id"]) / PAGE
        return web.FileResponse(file, headers={"Content-Security-Policy": POLICY, "Cache-Control": "no-cache"})

    async def samples(request: web.Request) -> web.Response:
        folder = bench.results.folder(request.match_info["id"])
        channel, variable = (request.query.get(key, "") for key in ("channel", "variable"))
        low, high = number(request, "low"), number(request, "high")
        if low is None or high is None:
            raise WorkbenchError("low and high are needed: between which values the samples lie", "low")
        work = results.samples, folder, channel, variable, low, high, points(request, 1500)
        return answer(await bench.workers.run(*work))

    async def apply(request: web.Request) -> web.Response:
        bench.apply(request.match_info["id"])
        return answer({"current": bench.current_model.id})

    return [
        web.post("/api/jobs", start),
        web.get("/api/jobs", listed),
        web.get("/api/jobs/{id}", one),
        web.post("/api/jobs/{id}/cancel", cancel),
        web.get("/api/runs", runs),
        web.get("/api/runs/{id}", document),
        web.get("/api/runs/{id}/figures", figures),
        web.get("/api/runs/{id}/figures/{name}", figure),
        web.get("/api/runs/{id}/report", report),
        web.get("/api/runs/{id}/samples", samples),
        web.post("/api/runs/{id}/apply", apply),
    ]
