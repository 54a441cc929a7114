"""Real-time scheduling of threads, where the system permits it."""

from __future__ import annotations

import contextlib
import os
import threading


def request_realtime(priority: int) -> str:
    """Give the calling thread FIFO scheduling; says what it runs with, and why where that is refused."""
    if not hasattr(os, "sched_setscheduler"):
        return "normal: this system has no real-time scheduling"
    try:
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, ValueError) as error:
        return f"normal: FIFO {priority} needs an rtprio limit of at least that ({error})"
    return f"FIFO {priority}"


def request_realtime_for_all(priority: int) -> str:
    """As `request_realtime`, for every thread of this process: those of the middleware, too, carry a sample onwards."""
    said = request_realtime(priority)
    if said.startswith("FIFO"):
        for thread_id in _threads():
            with contextlib.suppress(OSError):
                os.sched_setscheduler(thread_id, os.SCHED_FIFO, os.sched_param(priority))
    return said


def release_realtime_for_all() -> None:
    """Give every thread of this process normal scheduling again."""
    for thread_id in _threads():
        release_realtime(thread_id)


def _threads() -> list[int]:
    try:
        return [int(name) for name in os.listdir("/proc/self/task")]
    except OSError:
        return [threading.get_native_id()]


def release_realtime(thread_id: int) -> None:
    """Give a thread (`threading.get_native_id`) normal scheduling again; nothing happens if it is gone."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))
