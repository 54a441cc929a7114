"""Choose, start, enable and reset a plant; faults and riddles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aiohttp import web

from hydraulic_can_driver.bus_file import load_bus, shipped
from hydraulic_workbench.bench import Bench
from hydraulic_workbench.errors import WorkbenchError
from hydraulic_workbench.plant_kinds import (
    ATTACHED,
    CAN,
    CAN_VIRTUAL,
    GUESS,
    KINDS,
    SIMULATOR,
    Chosen,
    checked_hidden,
    virtual_channel,
)
from hydraulic_workbench.reading import models
from hydraulic_workbench.routes.common import answer, asked, said


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""

    async def choices(_: web.Request) -> web.Response:
        known = [m.document() for m in bench.library.models if not m.problem]
        effects = await bench.workers.run(models.effects, bench.current_model.file)
        buses = [
            {"name": name, "interface": (bus := load_bus(name)).interface, "channel": bus.channel} for name in shipped()
        ]
        found = {
            SIMULATOR: {"models": known, "effects": effects},
            CAN_VIRTUAL: {"buses": buses, "models": known},
            CAN: {"buses": buses},
            ATTACHED: bench.plant.chosen.kind == ATTACHED,
        }
        return answer(found)

    async def start(request: web.Request) -> web.Response:
        wanted = await asked(request)
        kind = wanted.get("kind")
        if kind not in KINDS:
            raise WorkbenchError(f"kind is {kind!r}; allowed are {', '.join(KINDS)}", "kind")
        lockstep = wanted.get("lockstep", kind != CAN) is not False
        if kind == GUESS:
            seed = wanted.get("seed")
            bench.start_guess(bench.model(wanted.get("model")), lockstep, seed if isinstance(seed, int) else None)
        else:
            bench.start_plant(_chosen(bench, kind, wanted, lockstep))
        return answer(status=202)

    async def stop(_: web.Request) -> web.Response:
        await bench.plant.stop()
        return answer()

    async def enable(request: web.Request) -> web.Response:
        return said(await bench.plant.enable((await asked(request)).get("on") is True))

    async def reset(_: web.Request) -> web.Response:
        return said(await bench.plant.reset())

    async def fault(request: web.Request) -> web.Response:
        wanted = await asked(request)
        bench.plant.fault(wanted.get("fault"), wanted.get("node"), wanted.get("on") is True)
        return answer()

    async def guess(request: web.Request) -> web.Response:
        found = bench.riddle().answer((await asked(request)).get("effect"))
        bench.board.put("guess", bench.riddle().document())
        return answer(found)

    async def reveal(_: web.Request) -> web.Response:
        found = bench.riddle().reveal()
        bench.board.put("guess", bench.riddle().document())
        return answer(found)

    return [
        web.get("/api/plants", choices),
        web.post("/api/plant/start", start),
        web.post("/api/plant/stop", stop),
        web.post("/api/plant/enable", enable),
        web.post("/api/plant/reset", reset),
        web.post("/api/plant/fault", fault),
        web.post("/api/guess/answer", guess),
        web.post("/api/guess/reveal", reveal),
    ]


def _chosen(bench: Bench, kind: str, wanted: dict[str, Any], lockstep: bool) -> Chosen:
    if kind == CAN:
        name = str(wanted.get("bus") or "bench")
        bus = load_bus(name)  # refuses one that cannot be read
        interface, channel = (str(wanted.get(key) or "") for key in ("interface", "channel"))
        return Chosen(
            CAN,
            f"real bench on {channel or bus.channel}",
            bus=name,
            interface=interface,
            channel=channel,
            lockstep=False,
        )
    model = bench.model(wanted.get("model"))
    chosen = Chosen(kind, f"simulator of {model.document()['name']}", model.file, model.id, lockstep=lockstep)
    if kind == SIMULATOR:
        return replace(chosen, hidden=checked_hidden(wanted.get("hidden")))
    name = str(wanted.get("bus") or "bench")
    load_bus(name)
    return replace(
        chosen, name=f"virtual CAN bench over {model.document()['name']}", bus=name,
        interface="udp_multicast", channel=virtual_channel(),
    )  # fmt: skip
