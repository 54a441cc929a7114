"""Who may use the server: those who have a token of this run, from pages of this server, by its own name."""

from __future__ import annotations

import hmac
import secrets
from dataclasses import dataclass, field

from aiohttp import web
from aiohttp.typedefs import Handler

from hydraulic_workbench.errors import NotAllowedError

OPERATE, WATCH = "operate", "watch"
ROLE = web.RequestKey("role", str)
"""Key of a request under which its visitor's role stands."""
_METHODS_THAT_READ = ("GET", "HEAD", "OPTIONS")
HOSTS = ("127.0.0.1", "localhost")
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self'; frame-src 'self'; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


def _token() -> str:
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Access:
    """The tokens of one run. ``port`` is that of the server; ``read_only`` leaves the token of watchers alone."""

    port: int
    read_only: bool = False
    operate: str = field(default_factory=_token)
    watch: str = field(default_factory=_token)

    @property
    def cookie(self) -> str:
        """Name of the cookie; servers on other ports of this machine have others."""
        return f"workbench_{self.port}"

    def address(self, role: str) -> str:
        """What a user opens to be let in."""
        token = self.operate if role == OPERATE else self.watch
        return f"http://127.0.0.1:{self.port}/?token={token}"

    def role(self, token: str) -> str | None:
        """What the bearer of a token may do; None for nobody's token."""
        given = token.encode()
        if not self.read_only and hmac.compare_digest(given, self.operate.encode()):
            return OPERATE
        return WATCH if hmac.compare_digest(given, self.watch.encode()) else None

    def admit(self, request: web.Request) -> str:
        """The role of whoever asks.

        :raises HTTPForbidden: by another name than this server's, or from a page of another origin.
        :raises HTTPUnauthorized: no token of this run.
        """
        if request.host not in self._own():
            raise web.HTTPForbidden(text="this server answers to its own address only")
        origin = request.headers.get("Origin")
        if origin is not None and origin not in {f"http://{host}" for host in self._own()}:
            raise web.HTTPForbidden(text="requests from other origins are refused")
        bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
        given = request.query.get("token", "") if request.path == "/" else ""
        role = next(
            (r for t in (given, bearer, request.cookies.get(self.cookie, "")) if t and (r := self.role(t))), None
        )
        if role is None:
            raise web.HTTPUnauthorized(text="open the address that the workbench printed: it holds this run's token")
        changes = request.method not in _METHODS_THAT_READ or request.headers.get("Upgrade", "").lower() == "websocket"
        if changes and origin is None and not bearer:
            raise web.HTTPForbidden(text="a page's request without an origin is refused")
        return role

    def _own(self) -> set[str]:
        return {f"{host}:{self.port}" for host in HOSTS}

    @web.middleware
    async def middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Lets nobody else in, and keeps watchers from changing anything but stopping."""
        role = self.admit(request)
        if role == WATCH and request.method not in _METHODS_THAT_READ and request.path != "/api/stop":
            raise NotAllowedError("this page only watches: open the address for operators to change something")
        request[ROLE] = role
        response: web.StreamResponse = await handler(request)
        if not response.prepared:
            for name, value in _HEADERS.items():
                response.headers.setdefault(name, value)
        return response
