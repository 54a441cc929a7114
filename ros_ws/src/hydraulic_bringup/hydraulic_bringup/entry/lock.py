"""One set-up at a time in a checkout."""

from __future__ import annotations

import contextlib
import fcntl
import time
from collections.abc import Iterator
from pathlib import Path

from .steps import REFRESH_S, Progress


@contextlib.contextmanager
def exclusive(file: Path) -> Iterator[int]:
    """Hold the lock of `file`; waits for another `./bench` that holds it, and says so.

    Yields the file descriptor: commands that inherit it hold the lock as well, so that a killed `./bench`
    does not open the door to a second one while its colcon still writes.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a") as handle:
        if not _taken(handle.fileno()):
            waiting = Progress("Waiting for another ./bench that is setting up here")
            while not _taken(handle.fileno()):
                time.sleep(REFRESH_S)
                waiting.refresh()
            waiting.close("done")
        yield handle.fileno()


def _taken(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
