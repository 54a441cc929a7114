"""How a valve notices that its master is gone: by missing heartbeats, commands or SYNCs."""

from __future__ import annotations

from collections.abc import Callable, Iterator

HEARTBEAT_LOST, COMMAND_LOST, SYNC_LOST = 0x8130, 0x8250, 0x8100
"""EMCY codes: heartbeat error, RPDO timeout, communication."""


class MasterWatch:
    """Remembers when each sign of the master was heard last; what has not begun cannot be missed."""

    def __init__(self, master_id: int, now: Callable[[], float]) -> None:
        self._now, self._master_id, self._period = now, master_id, 0.0
        self._heartbeat: float | None = None
        self._command: float | None = None
        self._sync: float | None = None

    def forget(self) -> None:
        """As after a power-on; what is expected of heartbeats stays."""
        self._heartbeat = self._command = self._sync = None

    def expect_heartbeat(self, word: int) -> None:
        """Take an entry of 0x1016: node ID and time in ms; 0 ms expects none."""
        self._master_id, self._period = word >> 16 & 0x7F, (word & 0xFFFF) * 1e-3
        self._heartbeat = None

    def heartbeat(self, node_id: int) -> None:
        """A heartbeat of any node has come."""
        if node_id == self._master_id and self._period > 0.0:
            self._heartbeat = self._now()

    def command(self) -> None:
        """A set-point has come."""
        self._command = self._now()

    def sync(self) -> None:
        """A SYNC has come."""
        self._sync = self._now()

    def silent(self, now: float, deadline: float, silence: float, operational: bool) -> Iterator[tuple[str, int]]:
        """What has been missing for too long, with the EMCY code; it is told once.

        ``deadline`` [s] of commands and ``silence`` [s] of SYNC count in OPERATIONAL; 0 does not.
        """
        if self._heartbeat is not None and now - self._heartbeat > self._period:
            self._heartbeat = None
            yield "heartbeat of the master lost", HEARTBEAT_LOST
        if not operational:
            return
        if self._command is not None and 0.0 < deadline < now - self._command:
            self._command = None
            yield "no set-point in time", COMMAND_LOST
        if self._sync is not None and 0.0 < silence < now - self._sync:
            self._sync = None
            yield "no SYNC in time", SYNC_LOST
