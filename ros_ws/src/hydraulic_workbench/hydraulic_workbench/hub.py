"""The open pages: events to all of them, to each its samples."""

from __future__ import annotations

import asyncio
import json
from typing import Any, Protocol

from aiohttp import WSMsgType, web

from hydraulic_workbench.columns import COLUMNS
from hydraulic_workbench.frames import samples_frame
from hydraulic_workbench.sample_ring import SampleRing

BACKLOG_S = 10.0
_LARGEST_MESSAGE = 64 * 1024
_MOST_ROWS = 20_000  # of a frame
_MOST_EVENTS = 1000  # that wait for a page; one that takes nothing is closed


class Commands(Protocol):
    """What a page may ask over its socket."""

    async def stop(self) -> dict[str, Any]:
        """Emergency stop."""


class Page:
    """One socket: a queue of events, and how far it has the samples."""

    def __init__(self, socket: web.WebSocketResponse, ring: SampleRing) -> None:
        self._socket, self._ring = socket, ring
        self._events: asyncio.Queue[str] = asyncio.Queue(_MOST_EVENTS)
        self._wake = asyncio.Event()
        self._epoch, self._cursor, self._sequence, self._end = -1, 0, 0, 0
        self._live = False
        self._history = 0.0

    def tell(self, event: str) -> None:
        """Send an event, after those before it."""
        try:
            self._events.put_nowait(event)
        except asyncio.QueueFull:
            asyncio.get_running_loop().create_task(self._socket.close())
        self._wake.set()

    def samples_until(self, end: int) -> None:
        """Rows up to this number can be sent."""
        self._end = end
        if self._live:
            self._wake.set()

    def live(self, history: float | None) -> None:
        """Begin to send samples, the last ``history`` seconds first; None: send no more."""
        self._live, self._epoch = history is not None, -1
        self._history = min(max(history or 0.0, 0.0), 120.0)
        self._wake.set()

    async def send_all(self) -> None:
        """Send what there is, until the socket is closed."""
        while not self._socket.closed:
            await self._wake.wait()
            self._wake.clear()
            while not self._events.empty():
                await self._socket.send_str(self._events.get_nowait())
            if self._live:
                await self._send_samples()

    async def _send_samples(self) -> None:
        ring, end = self._ring, self._end
        behind = ring.number_at(BACKLOG_S, end)
        if self._epoch != ring.epoch or self._cursor < min(behind, end):
            known = self._epoch == ring.epoch
            self._epoch = ring.epoch
            self._cursor = behind if known else ring.number_at(self._history, end)
            base = ring.base_ns * 1e-9
            columns = [column.document() for column in COLUMNS]
            event = {"type": "stream", "epoch": self._epoch, "base": base, "columns": columns}
            await self._socket.send_str(json.dumps(event))
        while self._cursor < end and self._epoch == ring.epoch:
            rows = ring.rows(self._cursor, min(end, self._cursor + _MOST_ROWS))
            if not rows.time.size:
                return
            await self._socket.send_bytes(samples_frame(self._epoch, self._sequence, rows))
            self._sequence += 1
            self._cursor = rows.first + rows.time.size


class Hub:
    """All pages that are open."""

    def __init__(self, ring: SampleRing) -> None:
        self._ring = ring
        self._pages: set[Page] = set()
        self._sockets: set[web.WebSocketResponse] = set()

    def __len__(self) -> int:
        return len(self._pages)

    def tell(self, kind: str, **content: Any) -> None:
        """An event to every page."""
        if self._pages:
            text = json.dumps({"type": kind, **content}, allow_nan=False)
            for page in self._pages:
                page.tell(text)

    def samples_until(self, end: int) -> None:
        """Rows up to this number can be shown."""
        for page in self._pages:
            page.samples_until(end)

    async def serve(self, request: web.Request, hello: dict[str, Any], commands: Commands) -> web.WebSocketResponse:
        """One page's socket, until it is closed."""
        socket = web.WebSocketResponse(max_msg_size=_LARGEST_MESSAGE, heartbeat=10.0, compress=False)
        await socket.prepare(request)
        page = Page(socket, self._ring)
        page.tell(json.dumps({"type": "hello", **hello}, allow_nan=False))
        self._pages.add(page)
        self._sockets.add(socket)
        sender = asyncio.create_task(page.send_all())
        try:
            async for message in socket:
                if message.type is WSMsgType.TEXT:
                    await self._take(page, message.data, commands)
        finally:
            self._pages.discard(page)
            self._sockets.discard(socket)
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)
        return socket

    async def _take(self, page: Page, text: str, commands: Commands) -> None:
        try:
            asked = json.loads(text)
        except ValueError:
            return
        match asked:
            case {"type": "live", "off": True}:
                page.live(None)
            case {"type": "live"}:
                history = asked.get("history", 0.0)
                page.live(float(history) if isinstance(history, int | float) else 0.0)
            case {"type": "ping"}:
                page.tell(json.dumps({"type": "pong", "id": asked.get("id")}))
            case {"type": "stop"}:
                page.tell(json.dumps({"type": "stopped", "id": asked.get("id"), **await commands.stop()}))

    async def close(self) -> None:
        """Close every socket: the server ends."""
        await asyncio.gather(*(socket.close() for socket in list(self._sockets)), return_exceptions=True)
