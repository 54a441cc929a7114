"""Lockstep with a reference: a state waits for the reference of its instant, as the plant waits for the command.

On a busy machine the reference node is held up like any other. A controller in lockstep waits for it, and with the
controller the plant does, so that load stretches a run and changes nothing in it.
"""

from __future__ import annotations

PATIENCE_S = 4.0
"""How long (wall time) a reference is waited for; below that of the plant, which waits for the command meanwhile."""


class ReferenceLockstep:
    """Waits for the source of references, once it has answered two states in a row, if late, until it leaves.

    Sources that send at a rate of their own answer no states and are not waited for. Stamps are ns of the plant's
    clock, times are seconds of the wall's.
    """

    def __init__(self) -> None:
        self.given_up = 0
        self._state_ns = self._period_ns = self._newest_ns = 0
        self._since = 0.0
        self._answering = False

    def state(self, stamp_ns: int, now: float) -> None:
        """A state has come."""
        self._period_ns, self._state_ns, self._since = stamp_ns - self._state_ns, stamp_ns, now

    def reference(self, stamp_ns: int) -> None:
        """A reference has come."""
        self._answering = stamp_ns - self._newest_ns == self._period_ns
        self._newest_ns = stamp_ns

    def waits(self, sources: int, now: float) -> bool:
        """Whether the newest state is to wait longer; ``sources`` is how many may send references."""
        self._answering = self._answering and sources > 0
        if not self._answering or self._newest_ns >= self._state_ns:
            return False
        if now - self._since > PATIENCE_S:
            self.given_up += 1
            self._answering = False
        return self._answering
