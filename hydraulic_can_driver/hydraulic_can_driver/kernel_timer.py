"""The period of a message that Linux' broadcast manager sends, trimmed so that the message keeps to given instants.

The broadcast manager starts its timer anew after each message (bcm_tx_set_expiry in net/can/bcm.c), so that every
period is longer than asked by the time that the kernel takes to get there: some ten microseconds, more on a busy
machine. Left alone, the messages would drift through a control loop that keeps to the clock.
"""

from __future__ import annotations

from typing import Any

from can.interfaces.socketcan import constants
from can.interfaces.socketcan.socketcan import CyclicSendTask, build_bcm_header, build_can_frame, send_bcm

# Share of a deviation that is taken back at once, and that goes into the estimate of the kernel's own delay. The trim
# acts two messages later; with these the loop is damped: all its poles are within 0.9 of the origin.
_AT_ONCE, _LASTING = 0.25, 0.02
_MOST = 0.25  # of the period


class Trim:
    """What has to be taken off a nominal period [ns], from how late [ns] one message after the other comes."""

    def __init__(self, period_ns: int) -> None:
        self._most = _MOST * period_ns
        self._lasting = 0.0

    def after(self, late_ns: int) -> int:
        """Off the period from here on; at most a quarter of it, so that no message comes much too early."""
        self._lasting = self._within(self._lasting + _LASTING * late_ns)
        return round(self._within(self._lasting + _AT_ONCE * late_ns))

    def _within(self, value: float) -> float:
        return min(max(value, -self._most), self._most)


def set_period(task: Any, period_ns: int) -> bool:
    """Give a running task of python-can another period, which counts from its next message on; False if it has none.

    :raises can.CanError: the kernel does not take it.
    """
    if not isinstance(task, CyclicSendTask):
        return False
    seconds, rest_ns = divmod(period_ns, 1_000_000_000)
    flags = constants.SETTIMER  # STARTTIMER would send a message at once
    header = build_bcm_header(
        constants.CAN_BCM_TX_SETUP, flags, 0, 0, 0, seconds, round(rest_ns / 1000), task.task_id, len(task.messages)
    )
    send_bcm(task.bcm_socket, header + b"".join(map(build_can_frame, task.messages)))
    return True
