"""How many processors this process may use."""

from __future__ import annotations

import os

THREADS_VARIABLE = "HYDRAULIC_THREADS"


def usable() -> int:
    """$HYDRAULIC_THREADS, or the processors that the system lets this process run on.

    A process that shares its machine with others of its kind (a worker of a campaign) is given one.
    """
    named = os.environ.get(THREADS_VARIABLE, "")
    if named.isdigit() and int(named) > 0:
        return int(named)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
