"""A way out for a process whose middleware does not come back while it is taken down.

Fast DDS 2.14 (as in Jazzy's wheels) spins in `DomainParticipant::set_listener` for as long as a discovery callback is
under way, and on a busy machine the callback may never get the lock that the spinning holds
(https://github.com/eProsima/Fast-DDS/issues/6513). It happens where nodes leave at the same moment, as at the end of
an experiment. The interpreter's lock is held meanwhile, so no Python thread or signal handler can end it.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from collections.abc import Iterator

PATIENCE_S = 3.0

_Handler = ctypes.CFUNCTYPE(None, ctypes.c_int)


@contextlib.contextmanager
def exit_guard(code: int, patience: float = PATIENCE_S) -> Iterator[None]:
    """Ends the process with `code` if what is inside takes longer than `patience` [s].

    For the main thread, around the last steps of a node: when nothing but the middleware is left to be closed.
    """

    def leave(_: int) -> None:
        os.write(2, b"the middleware did not let go: leaving without it\n")
        os._exit(code)

    sys.stdout.flush()
    sys.stderr.flush()
    # Python's own handlers only leave a note for the interpreter, which does not get to read it; this one runs in
    # the signal itself, on the main thread, which holds the interpreter's lock.
    handler = _Handler(leave)
    system = ctypes.CDLL(None)
    system.signal.argtypes, system.signal.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_void_p
    before = system.signal(signal.SIGALRM, ctypes.cast(handler, ctypes.c_void_p))
    signal.setitimer(signal.ITIMER_REAL, patience)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        system.signal(signal.SIGALRM, before)
