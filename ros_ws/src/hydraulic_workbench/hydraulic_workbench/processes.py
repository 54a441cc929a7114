"""The processes that the server starts, each with a log in its folder; none outlives the server."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from hydraulic_bringup.demo.processes import Child
from hydraulic_workbench.folder import Folder


class Processes:
    """Starts children from the thread of the loop, which lives as long as the server: they end with it."""

    def __init__(self, folder: Folder, env: Mapping[str, str]) -> None:
        self._folder, self._env = folder, {**env, "PYTHONUNBUFFERED": "1"}
        self._children: list[Child] = []

    def start(self, name: str, module: str, *arguments: str, log: Path | None = None, listens: bool = False) -> Child:
        """Start ``python -m module arguments``."""
        log = log or self._folder.new(self._folder.logs, f"{name}.log")
        child = Child(name, module, arguments, log, self._env, listens)
        self._children = [c for c in self._children if c.exit_code is None] + [child]
        return child

    async def stop(self, child: Child | None) -> None:
        """End a child, ever more firmly."""
        if child is not None:
            await asyncio.to_thread(child.stop)

    async def stop_all(self) -> None:
        """End all that run, the youngest first."""
        for child in reversed(self._children):
            await self.stop(child)

    @staticmethod
    async def ended(child: Child, patience: float = float("inf")) -> bool:
        """Whether it ends within so many seconds."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + patience
        while child.exit_code is None:
            if loop.time() > deadline:
                return False
            await asyncio.sleep(0.05)
        return True


def interrupt(child: Child) -> None:
    """Ask a process and what it has started to come to an end, as Ctrl-C does; it takes the time that it needs."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGINT)


def nicer(child: Child, by: int) -> None:
    """Let a process and what it will start wait for others: the plant and what drives it come first."""
    try:
        os.setpriority(os.PRIO_PGRP, child.pid, by)
    except OSError:  # it has ended
        return
