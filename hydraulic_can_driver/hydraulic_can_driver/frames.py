"""The frames that answer one SYNC: complete or not, of the right length, in time.

`begin`, `wait` and `end` are called around a cycle; `take` by the thread that receives, for every frame as it comes.

A frame does not say which SYNC it answers. One that comes while none is missing makes up for one that was missing
before. A device that misses several cycles in a row and does not make up for them is taken to be late: each of its
frames may be one of an earlier SYNC.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable

from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.codec import PdoCodec
from hydraulic_can_driver.errors import CodecError
from hydraulic_can_driver.faults import BusFault, FaultLatch

_LOST = 2  # so many frames in a row may be lost for good


class Frames:
    """Frames of all devices by COB-ID; `owed[cob_id]` are those that a device has not made up for.

    `behind` counts the complete cycles since a device has owed more than may be lost.
    """

    def __init__(self, bus: Bus, faults: FaultLatch) -> None:
        self._codecs = {pdo.cob_id: PdoCodec(pdo) for node in bus.nodes.values() for pdo in node.transmit}
        self._nodes = {pdo.cob_id: node for node in bus.nodes.values() for pdo in node.transmit}
        self._faults = faults
        self._changed = threading.Condition(threading.Lock())
        self._raw: dict[int, bytes] = {}
        self._missing: set[int] = set(self._codecs)
        self._lacked = self._missing
        self._open = False
        self.cycle = 0
        self.sync_ns = 0  # wall time
        self.instant_ns = 0  # the same instant on the monotonic clock
        self.late = 0
        self.owed: dict[int, int] = {}
        self.behind = 0
        self._run: dict[int, tuple[int, int]] = {}  # cycles missed in a row, owed before them

    @property
    def cob_ids(self) -> Iterable[int]:
        """COB-IDs of all frames that belong to a cycle."""
        return self._codecs

    def begin(self, stamp_ns: int) -> None:
        """A SYNC was sent or heard at `stamp_ns` (wall time): from here on frames belong to it."""
        with self._changed:
            self._missing = set(self._codecs)
            self._open = True
            self.cycle += 1
            self.sync_ns = stamp_ns
            self.instant_ns = stamp_ns - time.time_ns() + time.monotonic_ns()
            self._changed.notify_all()

    def end(self) -> None:
        """What comes from here to the next SYNC is late."""
        with self._changed:
            self._open = False
            self._lacked = set(self._missing)
            for cob_id in self._codecs:
                owed = self.owed.get(cob_id, 0)
                run, before = self._run.get(cob_id, (0, owed))
                if cob_id in self._missing:
                    self._run[cob_id] = run + 1, before
                    self.owed[cob_id] = owed + 1
                else:
                    self._run.pop(cob_id, None)
                    if run <= _LOST and owed > before:
                        self._pay(cob_id, owed - before)
            if max(self.owed.values(), default=0) <= _LOST:
                self.behind = 0
            elif not self._missing:
                self.behind += 1

    def take(self, cob_id: int, data: bytes) -> None:
        """A frame has come."""
        codec = self._codecs[cob_id]
        if len(data) != codec.pdo.length:
            try:
                codec.unpack(data)
            except CodecError as error:
                self._faults.report(BusFault.LENGTH, f"{self._nodes[cob_id].name}: {error}")
            return
        with self._changed:
            # A second one within a cycle means that the first belonged to the cycle before.
            if not self._open or cob_id not in self._missing:
                self.late += 1
                self._pay(cob_id, 1)
            self._raw[cob_id] = data
            self._missing.discard(cob_id)
            if not self._missing:
                self._changed.notify_all()

    def forget(self) -> None:
        """Nobody owes anything."""
        with self._changed:
            self.owed, self._run, self.behind = {}, {}, 0

    def debtors(self) -> list[str]:
        """Devices whose frames may be those of earlier SYNCs, with the number of cycles."""
        with self._changed:
            return [f"{self._nodes[cob_id].name} by {count} cycles" for cob_id, count in self.owed.items()]

    def _pay(self, cob_id: int, count: int) -> None:
        left = self.owed.pop(cob_id, 0) - count
        if left > 0:
            self.owed[cob_id] = left

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
        """Whether a frame has come in this cycle."""
        with self._changed:
            return self.cycle > 0 and cob_id not in self._missing

    def lacking(self) -> list[str]:
        """Names of the devices whose frames were missing when the cycle ended; a frame may have come since."""
        with self._changed:
            lacked = sorted(self._lacked)
        return list(dict.fromkeys(self._nodes[cob_id].name for cob_id in lacked))

    def quantities(self) -> dict[str, float]:
        """Latest value of every signal, in SI; words of bits as integers."""
        with self._changed:
            frames = dict(self._raw)
        found: dict[str, float] = {}
        for cob_id, data in frames.items():
            found |= self._codecs[cob_id].decode(data)
        return found
