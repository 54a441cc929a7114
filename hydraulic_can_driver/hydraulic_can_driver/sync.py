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
from hydraulic_can_driver.master import Master
from hydraulic_can_driver.receiver import SYNC
from hydraulic_interfaces.pacing import Pacer

# How long before the SYNC the drive is sent, as a share of the period: the frame itself (100 us at 1 Mbit/s) and the
# jitter of the loop must fit; only that of sending where the loop sends both.
_KERNEL_LEAD, _LOOP_LEAD = 0.25, 0.15
_HEARD = 15  # SYNCs of the kernel whose median instant is gone by


class Beat(Protocol):
    """Sends drive frames in time with the SYNC."""

    lead_ns: int
    """How long before its SYNC a drive is sent."""

    def start(self) -> None:
        """Begin to send SYNCs."""

    def stop(self) -> None:
        """End that; may be called again."""

    def first_instant(self, earliest_ns: int) -> int:
        """When the first drive is to be sent, at or after `earliest_ns` of the monotonic clock."""

    def exchange(self, cob_id: int, drive_frame: bytes, sync_ns: int) -> bool:
        """Send the drive; return right after its SYNC, which is due at `sync_ns` (wall time).

        False if there was none, or it came before the drive.
        """


class LoopBeat:
    """The control loop itself sends each SYNC, a little after the drive and on its instant."""

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


class KernelBeat:
    """The kernel sends the SYNC (SocketCAN's broadcast manager); the loop keeps step with what it hears of it."""

    def __init__(self, master: Master, frames: Frames, period_ns: int) -> None:
        self._master, self._frames, self._period_ns = master, frames, period_ns
        self.lead_ns = round(_KERNEL_LEAD * period_ns)
        self._task: Any = None
        self._heard: deque[int] = deque(maxlen=_HEARD)

    def start(self) -> None:
        """Hand the SYNC over to the kernel.

        :raises BusDownError: it does not take it.
        """
        self._heard.clear()
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
        """The lead before a SYNC. A few have been heard; one alone may have been sent late."""
        newest, half = self._frames.sync_ns, self._period_ns // 2
        off = sorted((s - newest + half) % self._period_ns - half for s in (*self._heard, newest))
        # The frames' stamps are wall time.
        heard = newest + off[len(off) // 2] - time.time_ns() + time.monotonic_ns() - self.lead_ns
        return heard + -(-(earliest_ns - heard) // self._period_ns) * self._period_ns

    def exchange(self, cob_id: int, drive_frame: bytes, sync_ns: int) -> bool:
        """See `Beat.exchange`."""
        # Told by the clock and not by counting SYNCs: what was missed once must not be missed ever after.
        late = self._frames.sync_ns > sync_ns - self._period_ns // 2
        seen = self._frames.cycle
        self._master.send(cob_id, drive_frame)
        came = late or self._frames.wait_sync(seen, time.monotonic() + 1.5e-9 * self._period_ns)
        if came:
            self._heard.append(self._frames.sync_ns)
        return came and not late
