"""A bag that is written while messages keep coming: a queue, and a thread that empties it into the file.

Another thread brings the file to the disk. A disk can be busy for many seconds, and what is queued meanwhile would be
lost with the process.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path

from hydraulic_sysid.data.bag.metadata import BagTopic
from hydraulic_sysid.data.bag.types import header_stamp
from hydraulic_sysid.data.bag.writer import BagSummary, BagWriter

FLUSH_S = 0.5
"""The file is flushed at this interval, and brought to the disk in such pauses: a crash may cost a second."""
# The queue is emptied in small portions, so that no burst of work stands in the way of a plant on the same core.
_WRITE_S = 0.05
_WRITER_NICENESS = 5
_STAMPED_BYTES = 12


class Recording:
    """Records into a new bag from creation until `close`.

    `append` only queues: neither a slow disk nor compression holds up who receives the messages. `error` is what
    ended the writing early, if something did; what came before is in the file, for `recovery.recover`.
    """

    def __init__(self, folder: Path, custom_data: Mapping[str, str] | None = None) -> None:
        """:raises BagError: the folder exists, or cannot be made."""
        self._writer = BagWriter(folder, custom_data)
        self._queue: deque[tuple[BagTopic, int, int, bytes, int]] = deque()
        self._stopping = threading.Event()
        self.error: Exception | None = None
        self.received: dict[str, int] = {}
        self.bytes = 0
        self._not_synced: Exception | None = None
        self._threads = [
            threading.Thread(target=self._run, name="bag writer", daemon=True),
            threading.Thread(target=self._sync, name="bag sync", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def folder(self) -> Path:
        """Folder of the bag."""
        return self._writer.folder

    @property
    def waiting(self) -> int:
        """Messages received and not yet written."""
        return len(self._queue)

    def append(self, topic: BagTopic, data: bytes, log_ns: int, sent_ns: int = 0, sequence: int = 0) -> None:
        """Queue a serialised message received at `log_ns`; `sent_ns` is used where it carries no stamp."""
        self.received[topic.name] = self.received.get(topic.name, 0) + 1
        self.bytes += len(data)
        self._queue.append((topic, log_ns, sent_ns, data, sequence))

    def close(self, custom_data: Mapping[str, str] | None = None) -> BagSummary:
        """Write what is queued and finish the bag.

        :raises OSError: the disk does not take it.
        """
        self._stopping.set()
        for thread in self._threads:
            thread.join()
        if self.error is not None:
            raise self.error
        try:
            self._write_queued()
            return self._writer.close(custom_data)
        except Exception as error:
            self.error = error
            self._writer.abandon()
            raise

    def _run(self) -> None:
        with contextlib.suppress(OSError, AttributeError):  # a courtesy, where the system has it
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _WRITER_NICENESS)
        flush_at = time.monotonic() + FLUSH_S
        try:
            while not self._stopping.wait(_WRITE_S):
                if self._not_synced is not None:
                    raise self._not_synced
                self._write_queued()
                if time.monotonic() >= flush_at:
                    self._writer.flush()
                    flush_at = time.monotonic() + FLUSH_S
        except Exception as error:  # whoever owns the recording finds it there; a thread has nobody to raise it to
            self.error = error
            self._writer.abandon()

    def _sync(self) -> None:
        try:
            while self.error is None and not self._stopping.wait(FLUSH_S):
                self._writer.sync()
        except Exception as error:  # the writing ends with it; that it has ended is no error
            self._not_synced = error

    def _write_queued(self) -> None:
        queue, write = self._queue, self._writer.write
        while queue:
            topic, log_ns, sent_ns, data, sequence = queue.popleft()
            published = header_stamp(data) if topic.type.stamped and len(data) >= _STAMPED_BYTES else sent_ns
            write(topic, log_ns, published if published > 0 else log_ns, data, sequence)
