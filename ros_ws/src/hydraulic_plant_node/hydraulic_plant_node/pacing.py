"""Waiting for absolute deadlines, to some microseconds, on an ordinary kernel."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time

_PR_SET_TIMERSLACK = 29
# Linux lets a sleep end 50 us late to save power; a thread may ask for less. What remains is the wake-up itself (30 us
# median, 80 us p99 on an idle machine, more beside a busy program), which a short spin hides. The spin grows by
# _GROW_NS where a sleep ended past it and shrinks by _SHRINK_NS where not: it settles where one sleep in 200 is late.
_LEAST_SPIN_NS = 70_000
_LEAST_SPIN_WITH_SLACK_NS = 120_000
_MOST_SPIN_NS = 250_000  # a quarter of a period of 1 ms: what the other threads of the process need stays theirs
_GROW_NS = 20_000
_SHRINK_NS = 100


class Pacer:
    """Waits for deadlines on the monotonic clock; made and used in the thread that waits.

    A sleep, and a spin as long as sleeps have lately ended late: the 99.5 % quantile of it, within bounds
    (stochastic approximation, Robbins and Monro 1951).
    """

    def __init__(self) -> None:
        self._least_ns = _LEAST_SPIN_NS if _without_timer_slack() else _LEAST_SPIN_WITH_SLACK_NS
        self._spin_ns = self._least_ns

    def wait(self, deadline_ns: int) -> int:
        """Return at `deadline_ns` of `time.monotonic_ns`, at once if it has passed; gives the time then."""
        clock = time.monotonic_ns
        now = clock()
        rest = deadline_ns - now - self._spin_ns
        if rest > 0:
            time.sleep(rest * 1e-9)
            now = clock()
            if now > deadline_ns:
                self._spin_ns = min(self._spin_ns + _GROW_NS, _MOST_SPIN_NS)
            else:
                self._spin_ns = max(self._spin_ns - _SHRINK_NS, self._least_ns)
        while now < deadline_ns:
            now = clock()
        return now


def _without_timer_slack() -> bool:
    try:
        prctl = ctypes.CDLL(None).prctl
    except (OSError, AttributeError):
        return False
    return prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1), 0, 0, 0) == 0


class Wakefulness:
    """Keeps idle processors from sleeping until `release`, where permitted: out of a deep sleep they come late.

    On a virtual machine, where the host has to bring an idle processor back, a wait of 2 ms ended half as often more
    than 0.5 ms late with this (0.12 to 0.34 % instead of 0.24 to 0.70 %). Source: PM QoS interface of Linux.
    """

    def __init__(self) -> None:
        self._request: int | None = None
        with contextlib.suppress(OSError):
            self._request = os.open("/dev/cpu_dma_latency", os.O_WRONLY | getattr(os, "O_CLOEXEC", 0))
            os.write(self._request, (0).to_bytes(4, "little"))  # microseconds, valid while the file is open

    def release(self) -> None:
        """Let them sleep again."""
        request, self._request = self._request, None
        if request is not None:
            os.close(request)
