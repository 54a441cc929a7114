"""Plans: choose, design, rehearse; experiments: start and abort."""

from __future__ import annotations

from aiohttp import web

from hydraulic_sysid.excitation.design import SIGNALS
from hydraulic_workbench.bench import Bench
from hydraulic_workbench.folder import checked_name
from hydraulic_workbench.reading import plans
from hydraulic_workbench.routes.common import answer, asked


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""
    shelf = bench.library.plans

    async def listed(_: web.Request) -> web.Response:
        signals = [{"name": name, "title": name.replace("_", " ")} for name in SIGNALS]
        return answer({"plans": shelf.documents(), "signals": signals})

    async def one(request: web.Request) -> web.Response:
        plan = shelf[request.match_info["id"]]
        return answer(plan.document() | await bench.workers.run(plans.whole, plan.usable().file))

    async def design(request: web.Request) -> web.Response:
        return answer({"job": bench.run_verb("design", await asked(request)).document()}, 202)

    async def rehearse(request: web.Request) -> web.Response:
        return answer({"job": bench.run_verb("rehearse", await asked(request)).document()}, 202)

    async def start(request: web.Request) -> web.Response:
        wanted = await asked(request)
        plan = shelf[wanted.get("plan")].usable()
        name = checked_name(wanted["name"], "name") if wanted.get("name") else plan.name
        rehearsal = bench.jobs[str(wanted.get("rehearsal"))]
        bench.experiments.start(plan, rehearsal, name, bench.plant_position())
        return answer(status=202)

    async def abort(_: web.Request) -> web.Response:
        await bench.experiments.abort()
        return answer()

    return [
        web.get("/api/plans", listed),
        web.get("/api/plans/{id}", one),
        web.post("/api/plans/design", design),
        web.post("/api/experiments/rehearse", rehearse),
        web.post("/api/experiments/start", start),
        web.post("/api/experiments/abort", abort),
    ]
