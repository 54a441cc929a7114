"""The web server around a bench: on 127.0.0.1 only, for who has a token of this run."""

from __future__ import annotations

import socket
from dataclasses import dataclass

from aiohttp import web
from aiohttp.typedefs import Handler

from hydraulic_workbench import routes
from hydraulic_workbench.access import HOSTS, OPERATE, WATCH, Access
from hydraulic_workbench.bench import Bench
from hydraulic_workbench.errors import WorkbenchError
from hydraulic_workbench.routes.common import LARGEST_BODY, errors
from hydraulic_workbench.routes.general import ACCESS

ADDRESS = HOSTS[0]
PORT = 8642
ALWAYS = ("/api/state", "/api/stop")
_ATTEMPTS = 50
_SHUTDOWN_S = 2.0


def listen(port: int | None) -> socket.socket:
    """A socket on this machine only, at the port or, where none is wanted, at the first free one from `PORT` on.

    :raises WorkbenchError: the port that is wanted is taken.
    """
    for wanted in (port,) if port is not None else (*range(PORT, PORT + _ATTEMPTS), 0):
        one = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            one.bind((ADDRESS, wanted))
        except OSError:
            one.close()
            continue
        one.listen(64)
        return one
    raise WorkbenchError(f"port {port} of this machine is taken; choose another with --port")


@dataclass
class Server:
    """A bench behind its address."""

    bench: Bench
    access: Access
    socket: socket.socket
    runner: web.AppRunner | None = None

    async def begin(self) -> None:
        """Serve from now on."""
        app = web.Application(
            middlewares=[errors, self.access.middleware, self._wait_until_ready], client_max_size=LARGEST_BODY
        )
        app[ACCESS] = self.access
        routes.add_all(app, self.bench)
        self.runner = web.AppRunner(app, access_log=None, shutdown_timeout=_SHUTDOWN_S)
        await self.runner.setup()
        await web.SockSite(self.runner, self.socket).start()

    @web.middleware
    async def _wait_until_ready(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """What is asked before the folder has been read waits; to stop never waits."""
        if request.path.startswith("/api/") and request.path not in ALWAYS:
            await self.bench.ready.wait()
        return await handler(request)

    async def end(self) -> None:
        """Serve no more."""
        await self.bench.hub.close()
        if self.runner is not None:
            await self.runner.cleanup()

    def addresses(self) -> dict[str, str]:
        """What is printed: the address to operate, unless it is read-only, and the one to watch."""
        roles = (WATCH,) if self.access.read_only else (OPERATE, WATCH)
        return {role: self.access.address(role) for role in roles}
