"""The frames that answer one SYNC: complete or not, of the right length, in time.

`begin`, `wait` and `end` are called around a cycle; `take` by the thread that receives, for every frame as it comes.

A frame does not say which SYNC it answers: the counter of CiA 301 (0x1019) numbers the SYNC, and no process data give
it back. So it is told by two things. What the interface received before a SYNC was sent does not answer that SYNC,
however late this program looks at it. And a device answers each SYNC once, in their order: as long as it owes answers,
the next frame is that to the oldest SYNC, and a cycle is complete only when all debts are paid as well. Where few are
owed and the device has sent one frame per SYNC for a while, those were lost for good and are forgotten.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable

from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.codec import PdoCodec
from hydraulic_can_driver.errors import CodecError
from hydraulic_can_driver.faults import BusFault, FaultLatch

_LOST = 2  # so many frames may be lost for good ...
_STEADY = 2  # ... which they are after so many cycles in a row with one frame each
_ROUNDING_NS = 1000  # of an instant that python-can gives in seconds


class Frames:
    """Frames of all devices by COB-ID; `owed[cob_id]` are the answers to earlier SYNCs that have not come."""

    def __init__(self, bus: Bus, faults: FaultLatch) -> None:
        self._codecs = {pdo.cob_id: PdoCodec(pdo) for node in bus.nodes.values() for pdo in node.transmit}
        self._nodes = {pdo.cob_id: node for node in bus.nodes.values() for pdo in node.transmit}
        self._faults = faults
        self._changed = threading.Condition(threading.Lock())
        self._raw: dict[int, bytes] = {}
        self._came: dict[int, int] = {}  # frames since the SYNC
        self._unheard: set[int] = set(self._codecs)  # of which none has come since `forget`
        self._missing: set[int] = set(self._codecs)
        self._lacked = self._missing
        self._open = False
        self._counted = True  # what this cycle lacks stands in `owed`
        self._sent_ns = 0  # wall time before which nothing that answers this SYNC was received
        self.cycle = 0
        self.sync_ns = 0  # wall time
        self.instant_ns = 0  # the same instant on the monotonic clock
        self.late = 0
        self.owed: dict[int, int] = {}
        self._steady: dict[int, int] = {}  # cycles in a row with one frame each

    @property
    def cob_ids(self) -> Iterable[int]:
        """COB-IDs of all frames that belong to a cycle."""
        return self._codecs

    def begin(self, stamp_ns: int) -> None:
        """A SYNC was sent or heard at `stamp_ns` (wall time): from here on frames belong to it."""
        with self._changed:
            self._count()
            self._missing, self._came = set(self._codecs), {}
            self._open, self._counted = True, False
            self.cycle += 1
            self.sync_ns = stamp_ns
            now = time.time_ns()
            self._sent_ns = min(stamp_ns, now) - _ROUNDING_NS  # the stamps of a lockstep may be ahead
            self.instant_ns = stamp_ns - now + time.monotonic_ns()
            self._changed.notify_all()

    def end(self) -> None:
        """What comes from here to the next SYNC is late."""
        with self._changed:
            self._open = False
            self._lacked = set(self._missing)
            self._count()

    def take(self, cob_id: int, data: bytes, received_ns: int = 0) -> None:
        """A frame has come, which the interface received at `received_ns` (wall time); 0 where it does not say."""
        codec = self._codecs[cob_id]
        if len(data) != codec.pdo.length:
            try:
                codec.unpack(data)
            except CodecError as error:
                self._faults.report(BusFault.LENGTH, f"{self._nodes[cob_id].name}: {error}")
            return
        with self._changed:
            self._raw[cob_id] = data
            self._unheard.discard(cob_id)
            owed = self.owed.get(cob_id, 0)
            before = 0 < received_ns < self._sent_ns
            if self._open and not before:
                self._came[cob_id] = self._came.get(cob_id, 0) + 1
                if not owed and cob_id in self._missing:
                    self._missing.discard(cob_id)
                    if not self._missing:
                        self._changed.notify_all()
                    return
            self.late += 1
            self._owe(cob_id, owed - 1)

    def forget(self) -> None:
        """Nobody owes anything, and nobody has been heard."""
        with self._changed:
            self.owed, self._steady = {}, {}
            self._unheard = set(self._codecs)

    def debtors(self) -> list[str]:
        """Devices whose frames may be those of earlier SYNCs, with the number of cycles."""
        with self._changed:
            return [f"{self._nodes[cob_id].name} by {count} cycles" for cob_id, count in self.owed.items()]

    def _count(self) -> None:
        """Who owes what after this cycle, once."""
        if self._counted:
            return
        self._counted = True
        for cob_id in self._codecs:
            owed = self.owed.get(cob_id, 0) + (cob_id in self._missing)
            self._steady[cob_id] = self._steady.get(cob_id, 0) + 1 if self._came.get(cob_id) == 1 else 0
            self._owe(cob_id, 0 if owed <= _LOST and self._steady[cob_id] >= _STEADY else owed)

    def _owe(self, cob_id: int, count: int) -> None:
        self.owed.pop(cob_id, None)
        if count > 0:
            self.owed[cob_id] = count

    def wait_sync(self, after_ns: int, until_ns: int) -> bool:
        """Wait for a SYNC later than `after_ns`, at the longest until `until_ns`; both of `time.monotonic_ns`."""
        with self._changed:
            rest = max(until_ns - time.monotonic_ns(), 0) * 1e-9
            return self._changed.wait_for(lambda: self.instant_ns > after_ns, rest)

    def wait(self, until: float) -> bool:
        """Whether all frames of the cycle are there; waits for them at the longest until `until`."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._missing, max(until - time.monotonic(), 0.0))

    def has(self, cob_id: int) -> bool:
        """Whether a frame has come in this cycle, be it that of an earlier one."""
        with self._changed:
            return cob_id in self._came

    def lacking(self) -> list[str]:
        """Names of the devices whose frames were missing when the cycle ended; a frame may have come since.

        Those alone of which none has come since `forget`, where there are such: in a single cycle any may be late.
        """
        with self._changed:
            lacked = sorted(self._lacked & self._unheard or self._lacked)
        return list(dict.fromkeys(self._nodes[cob_id].name for cob_id in lacked))

    def quantities(self) -> dict[str, float]:
        """Latest value of every signal, in SI; words of bits as integers."""
        with self._changed:
            frames = dict(self._raw)
        found: dict[str, float] = {}
        for cob_id, data in frames.items():
            found |= self._codecs[cob_id].decode(data)
        return found
