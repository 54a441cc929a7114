"""The trim of the kernel's SYNC: takes a drift away, is bounded, and reaches the kernel in the form that it expects."""

from __future__ import annotations

import struct

import can
import numpy as np
import pytest
from can.interfaces.socketcan.socketcan import CyclicSendTask

from hydraulic_can_driver.kernel_timer import Trim, set_period

PERIOD = 2_000_000


@pytest.mark.parametrize("delay", [30_000, 150_000])
def test_the_trim_takes_away_delay_and_phase(delay: int) -> None:
    """A timer that begins each period late by `delay` [ns]; what is set counts from the next message on."""
    rng = np.random.default_rng(1)
    lates: list[float] = []
    trim, late, waiting = Trim(PERIOD), 0.4 * PERIOD, 0
    for _ in range(400):
        lates.append(late)
        late, waiting = late + delay - waiting + rng.normal(0.0, 10e3), trim.after(round(late))
    assert np.abs(lates[100:]).max() < 60e3
    assert np.mean(lates[100:]) == pytest.approx(0.0, abs=10e3)


def test_it_never_takes_more_than_a_quarter() -> None:
    trim = Trim(PERIOD)
    assert max(trim.after(10 * PERIOD) for _ in range(1000)) == PERIOD // 4
    assert trim.after(-10 * PERIOD) == -PERIOD // 4


class Socket:
    """Keeps what is sent to the broadcast manager."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def send(self, data: bytes) -> int:
        self.sent.append(data)
        return len(data)


def test_what_the_kernel_is_told() -> None:
    """struct bcm_msg_head of linux/can/bcm.h, and the frame."""
    socket = Socket()
    sync = can.Message(arbitration_id=0x80, is_extended_id=False)
    task = CyclicSendTask(socket, 7, sync, 0.002, autostart=False)  # type: ignore[arg-type]
    assert set_period(task, 1_999_600)
    (told,) = socket.sent
    opcode, flags, count, *intervals, number, frames = struct.unpack("@IIIllllII", told[:56])
    assert (opcode, flags, count, number, frames) == (1, 1, 0, 7, 1), "TX_SETUP, SETTIMER without STARTTIMER"
    assert intervals == [0, 0, 0, 2000]
    assert told[56:] == struct.pack("=IB11x", 0x80, 0)


def test_who_has_no_such_timer() -> None:
    assert not set_period(object(), PERIOD)
