"""A process beside the server for what takes long or much memory: reading records, models and results.

The server's own thread and interpreter stay free for what must not wait: samples, and the stop button.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from typing import Any, TypeVar, cast

from hydraulic_bringup.demo.processes import end_with_parent
from hydraulic_interfaces.errors import HydraulicError, one_line
from hydraulic_workbench.errors import WorkbenchError

T = TypeVar("T")
NICE = 5


def _begin() -> None:
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's affair
    os.nice(NICE)


def _guarded(function: Callable[..., T], *arguments: Any) -> tuple[T | None, str, str | None]:
    """Result, or what is wrong and which field: many errors cannot travel between processes themselves."""
    try:
        return function(*arguments), "", None
    except WorkbenchError as error:
        return None, one_line(error), error.field
    except (HydraulicError, OSError) as error:
        return None, one_line(error), None


def _one_process() -> Executor:
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _begin)


class Workers:
    """Runs functions of this package as ``make`` says: in a process of their own, started again where it has died."""

    def __init__(self, make: Callable[[], Executor] = _one_process) -> None:
        self._make = make
        self._pool: Executor | None = None

    async def run(self, function: Callable[..., T], *arguments: Any) -> T:
        """What the function returns.

        :raises WorkbenchError: it refused its arguments, or the process died at it.
        """
        if self._pool is None:
            self._pool = self._make()
        try:
            loop = asyncio.get_running_loop()
            result, problem, field = await loop.run_in_executor(self._pool, _guarded, function, *arguments)
        except BrokenExecutor:
            self.stop()
            raise WorkbenchError("the process that reads files has died; is it out of memory?") from None
        if problem:
            raise WorkbenchError(problem, field)
        return cast(T, result)

    def stop(self) -> None:
        """End the process."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None
