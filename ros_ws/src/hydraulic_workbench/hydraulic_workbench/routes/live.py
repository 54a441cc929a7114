"""Beside the plant: the live model, the controller and its gains, the reference."""

from __future__ import annotations

from typing import Any

from aiohttp import web

from hydraulic_control.gains_file import shipped
from hydraulic_control.laws import laws
from hydraulic_control.reference_parameters import PARAMETERS
from hydraulic_control.trajectories import KINDS
from hydraulic_workbench.bench import Bench
from hydraulic_workbench.reading.models import display
from hydraulic_workbench.routes.common import answer, asked


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""

    async def live_model(request: web.Request) -> web.Response:
        wanted = (await asked(request)).get("model")
        await bench.choose_live_model(bench.model(wanted) if wanted else None)
        return answer(status=202)

    async def choices(_: web.Request) -> web.Response:
        known = laws()
        rows = [
            {"name": name, "gains": name, "title": name.replace("_", " "), "summary": known[name].description,
             "source": known[name].source}
            for name in shipped()
            if name in known
        ]  # fmt: skip
        return answer({"laws": rows, "references": references()})

    async def start(request: web.Request) -> web.Response:
        await bench.controller.start((await asked(request)).get("gains"))
        return answer(status=202)

    async def stop(_: web.Request) -> web.Response:
        await bench.reference.stop()
        await bench.controller.node.stop()
        return answer()

    async def gains(_: web.Request) -> web.Response:
        return answer(await bench.controller.gains())

    async def set_gains(request: web.Request) -> web.Response:
        return answer(await bench.controller.set((await asked(request)).get("values")))

    async def undo(_: web.Request) -> web.Response:
        return answer(await bench.controller.undo())

    async def start_reference(request: web.Request) -> web.Response:
        wanted = await asked(request)
        await bench.reference.start(wanted.get("kind"), wanted.get("values"))
        return answer(status=202)

    async def stop_reference(_: web.Request) -> web.Response:
        await bench.reference.stop()
        return answer()

    return [
        web.post("/api/live_model", live_model),
        web.get("/api/controllers", choices),
        web.post("/api/controller/start", start),
        web.post("/api/controller/stop", stop),
        web.get("/api/controller/gains", gains),
        web.post("/api/controller/gains", set_gains),
        web.post("/api/controller/undo", undo),
        web.post("/api/reference/start", start_reference),
        web.post("/api/reference/stop", stop_reference),
    ]


def references() -> list[dict[str, Any]]:
    """Trajectories and the numbers that each is made from."""
    numbers = [spec for spec in PARAMETERS if isinstance(spec.default, float | int) and spec.live]
    rows = []
    for kind, trajectory in KINDS.items():
        own = getattr(trajectory, "__dataclass_fields__", {})
        parameters: list[Any] = [
            {"name": s.name, "value": s.default, "unit": s.unit, "minimum": s.minimum, "maximum": s.maximum,
             "description": s.description, "live": s.live, "display": display(s.unit), "choices": None,
             "whole": s.whole}
            for s in numbers
            if s.name in own
        ]  # fmt: skip
        if parameters:
            rows.append({"kind": kind, "title": kind.replace("_", " "), "parameters": parameters})
    return rows
