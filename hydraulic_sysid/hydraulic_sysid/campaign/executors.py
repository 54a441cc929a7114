"""Who does the work: processes of this machine, or a Dask cluster. Both are `concurrent.futures.Executor`."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

from hydraulic_node_utils.processors import THREADS_VARIABLE, usable
from hydraulic_sysid.campaign.manifest import CampaignError

_PATIENCE = 30  # s, for a scheduler to answer
_PER_WORKER = 2  # cases under way or waiting at a worker, so that none waits for the scheduler


@dataclass(frozen=True)
class Crew:
    """Workers: how to ``start`` them (again, where one has died), how many, and how to be ``rid`` of them."""

    start: Callable[[], Executor]
    workers: int
    rid: Callable[[Executor], Any]
    name: str

    @property
    def width(self) -> int:
        """How many cases are handed out at a time."""
        return _PER_WORKER * self.workers


def processes(count: int | None = None) -> Crew:
    """So many processes of this machine (default: one for each processor), started anew (`spawn`), one thread each.

    They end with the process that started them, however that ends.
    """
    number = count or usable()
    strangers = set(multiprocessing.active_children())

    def start() -> Executor:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when a worker loads numpy
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(number, mp_context=context, initializer=_begin_worker)

    def rid(executor: Executor) -> None:
        executor.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - strangers:
            child.terminate()

    return Crew(start, number, rid, f"{number} processes")


def dask_cluster(address: str) -> Crew:
    """The workers of the Dask scheduler at ``address``, such as ``tcp://host:8786``.

    :raises CampaignError: ``distributed`` is not installed, nobody answers there, or the scheduler has no workers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise CampaignError("--scheduler needs Dask: pip install distributed") from None
    try:
        client = Client(address, timeout=_PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        raise CampaignError(f"--scheduler {address}: no Dask scheduler answers there ({error})") from error
    number = sum(client.nthreads().values())
    if number == 0:
        client.close()
        raise CampaignError(f"--scheduler {address}: it has no workers; start some with: dask worker {address}")
    client.run(_one_thread)
    return Crew(
        lambda: client.get_executor(pure=False, retries=0), number, lambda _: client.close(), f"{number} Dask workers"
    )


def _one_thread() -> None:
    os.environ[THREADS_VARIABLE] = "1"


def _begin_worker() -> None:
    """A worker leaves Ctrl-C to the campaign and does not outlive it."""
    _one_thread()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
