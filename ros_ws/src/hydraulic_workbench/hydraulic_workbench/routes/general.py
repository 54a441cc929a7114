"""The page and its files, the socket, the state, and the stop."""

from __future__ import annotations

from pathlib import Path

from aiohttp import web
from plotly import package_data

from hydraulic_workbench.access import OPERATE, ROLE, Access
from hydraulic_workbench.bench import Bench
from hydraulic_workbench.routes.common import answer

PAGE = Path(__file__).parents[1] / "page"
ACCESS = web.AppKey("access", Access)
PLOTLY = Path(str(package_data.__path__[0])) / "plotly.min.js"
_YEAR = 365 * 86400
_NO_CACHE = {"Cache-Control": "no-cache"}


def routes(bench: Bench) -> list[web.AbstractRouteDef]:
    """See the module."""

    async def index(request: web.Request) -> web.StreamResponse:
        response = web.FileResponse(PAGE / "index.html", headers=_NO_CACHE)
        if "token" in request.query:
            access = request.app[ACCESS]
            token = access.operate if request[ROLE] == OPERATE else access.watch
            response.set_cookie(access.cookie, token, httponly=True, samesite="Strict", path="/")
        return response

    async def file(request: web.Request) -> web.StreamResponse:
        path = (PAGE / request.match_info["path"]).resolve()
        if not path.is_relative_to(PAGE.resolve()) or not path.is_file():
            raise web.HTTPNotFound(text="there is no such file")
        return web.FileResponse(path, headers=_NO_CACHE)

    async def plotly(_: web.Request) -> web.StreamResponse:
        return web.FileResponse(PLOTLY, headers={"Cache-Control": f"private, max-age={_YEAR}"})

    async def socket(request: web.Request) -> web.StreamResponse:
        return await bench.hub.serve(request, bench.hello(request[ROLE]), bench)

    async def state(_: web.Request) -> web.Response:
        return answer(bench.board.state)

    async def stop(_: web.Request) -> web.Response:
        return answer(await bench.stop())

    return [
        web.get("/", index),
        web.get("/page/{path:.+}", file),
        web.get("/plotly.min.js", plotly),
        web.get("/ws", socket),
        web.get("/api/state", state),
        web.post("/api/stop", stop),
    ]
