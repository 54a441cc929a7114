"""Who sends the SYNC, and when the frame with the drive goes out: the beat of the bench.

The valve takes a drive over at the SYNC that follows it, and all devices sample at that SYNC. Drive and state that are
published under one stamp are therefore those of one SYNC.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any, Protocol

import can

from hydraulic_can_driver.errors import BusDownError
from hydraulic_can_driver.frames import Frames
from hydraulic_can_driver.kernel_timer import Trim, set_period
from hydraulic_can_driver.master import Master
from hydraulic_can_driver.receiver import SYNC
from hydraulic_plant_node.pacing import Pacer

# How long before the SYNC the drive is sent, as a share of the period: the frame itself (100 us at 1 Mbit/s) and the
# jitter of the loop must fit; only that of sending where the loop sends both.
_KERNEL_LEAD, _LOOP_LEAD = 0.25, 0.15
_HEARD = 9  # SYNCs of the kernel whose median instant is gone by; they drift
_WORTH_NS = 1000  # the kernel's timer knows microseconds


class Beat(Protocol):
    """Sends drive frames in time with the SYNC."""

    lead_ns: int
    """How long before its SYNC a drive is sent."""

    sender: str
    """Who sends the SYNC, in the diagnostics."""

    def start(self) -> None:
        """Begin to send SYNCs."""

    def stop(self) -> None:
        """End that; may be called again."""

    def first_instant(self, earliest_ns: int) -> int:
        """When the first drive is to be sent, at or after `earliest_ns` of the monotonic clock."""

    def next_sync(self) -> int:
        """Wall time of the SYNC for a drive that is sent now, ns."""

    def exchange(self, cob_id: int, drive_frame: bytes, sync_ns: int) -> bool:
        """Send the drive; return right after its SYNC, which is due at `sync_ns` (wall time).

        False if there was none, or it came before the drive.
        """


class LoopBeat:
    """The control loop itself sends each SYNC, a little after the drive and on its instant."""

    sender = "control loop"

    def __init__(self, master: Master, frames: Frames, period_ns: int) -> None:
        self._master, self._frames, self._period_ns = master, frames, period_ns
        self.lead_ns = round(_LOOP_LEAD * period_ns)
        self._pacer, self._pacing_thread = Pacer(), threading.get_ident()

    def start(self) -> None:
        """Nothing: see `exchange`."""

    def stop(self) -> None:
        """Nothing: see `exchange`."""

    def first_instant(self, earliest_ns: int) -> int:
        """At once."""
        return earliest_ns

    def next_sync(self) -> int:
        """Now."""
        return time.time_ns()

    def exchange(self, cob_id: int, drive_frame: bytes, sync_ns: int) -> bool:
        """See `Beat.exchange`."""
        self._master.send(cob_id, drive_frame)
        rest = sync_ns - time.time_ns()
        if 0 < rest < self._period_ns:
            if threading.get_ident() != self._pacing_thread:
                self._pacer, self._pacing_thread = Pacer(), threading.get_ident()
            self._pacer.wait(time.monotonic_ns() + rest)
        self._frames.begin(time.time_ns())
        self._master.send(SYNC, b"")
        return True


class LockstepBeat(LoopBeat):
    """As `LoopBeat`, but the SYNC goes out at once: its instant is the stamp, whatever the wall clock says."""

    sender = "control loop, in lockstep"

    def __init__(self, master: Master, frames: Frames, period_ns: int) -> None:
        super().__init__(master, frames, period_ns)
        self.lead_ns = 0

    def first_instant(self, earliest_ns: int) -> int:
        """One period after the last SYNC, as cycles before the loop are as fast as the devices answer."""
        return max(earliest_ns, self._frames.instant_ns + self._period_ns)

    def next_sync(self) -> int:
        """One period after the last."""
        return (self._frames.sync_ns or time.time_ns()) + self._period_ns

    def exchange(self, cob_id: int, drive_frame: bytes, sync_ns: int) -> bool:
        """See `Beat.exchange`."""
        self._master.send(cob_id, drive_frame)
        self._frames.begin(sync_ns)
        self._master.send(SYNC, b"")
        return True


class KernelBeat:
    """The kernel sends the SYNC (SocketCAN's broadcast manager); the loop keeps step with what it hears of it.

    Until the loop begins, its cycles follow the SYNC. From `first_instant` on the loop keeps to the clock, and it is
    the kernel's timer that is trimmed (`kernel_timer`). Which SYNC a drive belongs to is told by the clock and never by
    counting, so that one that is missing, late, or heard late concerns its own cycle only.
    """

    sender = "kernel"

    def __init__(self, master: Master, frames: Frames, period_ns: int) -> None:
        self._master, self._frames, self._period_ns = master, frames, period_ns
        self.lead_ns = round(_KERNEL_LEAD * period_ns)
        self._task: Any = None
        self._heard: deque[int] = deque(maxlen=_HEARD)
        self._grid: int | None = None  # an instant at which the running loop expects a SYNC
        self._trim = Trim(period_ns)
        self._period_now = period_ns

    def start(self) -> None:
        """Hand the SYNC over to the kernel.

        :raises BusDownError: it does not take it.
        """
        self._heard.clear()
        self._grid, self._trim, self._period_now = None, Trim(self._period_ns), self._period_ns
        message = can.Message(arbitration_id=SYNC, is_extended_id=False)
        try:
            self._task = self._master.can.send_periodic(message, self._period_ns * 1e-9)
        except (can.CanError, OSError) as error:
            raise BusDownError(f"the kernel does not send the SYNC: {error}") from None

    def stop(self) -> None:
        """Take it back."""
        if self._task is not None:
            self._task.stop()
            self._task = None

    def first_instant(self, earliest_ns: int) -> int:
        """The lead before a SYNC."""
        due = self._following(earliest_ns + self.lead_ns)
        self._grid = due
        return due - self.lead_ns

    def next_sync(self) -> int:
        """That which comes after half the lead at the earliest; the loop has ended, or has not begun."""
        self._grid = None
        now = time.monotonic_ns()
        return self._following(now + self.lead_ns // 2) - now + time.time_ns()

    def exchange(self, cob_id: int, drive_frame: bytes, sync_ns: int) -> bool:
        """See `Beat.exchange`."""
        due, half = self._due(sync_ns), self._period_ns // 2
        early = self._frames.instant_ns > due - half
        self._master.send(cob_id, drive_frame)
        sent = time.monotonic_ns()
        came = early or self._frames.wait_sync(due - half, due + half)
        heard = self._frames.instant_ns
        if came:
            self._heard.append(heard)
            self._keep_step(heard - due)
        # A SYNC from before the drive may be heard after it was sent.
        return came and not early and sent <= heard < due + half

    def _due(self, sync_ns: int) -> int:
        """The SYNC at `sync_ns` on the monotonic clock."""
        now = time.monotonic_ns()
        due = sync_ns - time.time_ns() + now
        if self._grid is None:
            return due
        # Where the wall clock was set, the loop's stamps do not follow it: then it is the SYNC that is nearest.
        if abs(due - now) > 2 * self._period_ns:
            due = now + self.lead_ns
        return self._grid + round((due - self._grid) / self._period_ns) * self._period_ns

    def _following(self, earliest_ns: int) -> int:
        """The SYNC at or after an instant, by the median of those heard last: a single one may have been late."""
        newest, period = self._frames.instant_ns, self._period_ns
        off = sorted((heard - newest + period // 2) % period - period // 2 for heard in (*self._heard, newest))
        heard = newest + off[len(off) // 2]
        return heard - (heard - earliest_ns) // period * period

    def _keep_step(self, late_ns: int) -> None:
        if self._grid is None:
            return
        period = self._period_ns - self._trim.after(late_ns)
        if abs(period - self._period_now) >= _WORTH_NS:
            self._period_now = period
            try:
                set_period(self._task, period)
            except (can.CanError, OSError) as error:
                raise BusDownError(f"the kernel does not trim the SYNC: {error}") from None
