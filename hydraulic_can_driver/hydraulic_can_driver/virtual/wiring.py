"""What virtual devices share: the network, the rate of the bench, and somebody who is told what happens."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import RLock

import canopen

from hydraulic_can_driver.bus import Bus, Signal


@dataclass(frozen=True)
class Event:
    """Something that a device has just done or met; `detail` in the words of `kind`.

    Kinds: "power" (on, off), "nmt" (state of the node), "sdo read" and "sdo write" (object as 0x6042:0), "state" (of
    the valve), "rpdo" (number), "sync" (count, of the bench), "emcy" (code as 0x8130).
    """

    kind: str
    node: str
    detail: str


@dataclass(frozen=True)
class Wiring:
    """The place of a device on the bench.

    Everything that a device does is done under `lock`. It tells what happens, and calls `settle` when it is through
    with what came from the bus: whatever waited for that event happens then, before any answer is sent. It lives in the
    time `now` [s].
    """

    network: canopen.Network
    bus: Bus
    lock: RLock
    tell: Callable[[Event], None]
    settle: Callable[[], None]
    now: Callable[[], float]

    def mounting(self, name: str) -> tuple[float, float]:
        """How a quantity meets the device that measures or makes it: its sign and its offset, from the bus file.

        The device itself knows neither, only its own steps; quantity = sign · device's quantity + offset.
        """
        signal = self.signal(name)
        if signal is None:
            return 1.0, 0.0
        return (1.0 if signal.scale.gain > 0.0 else -1.0), signal.scale.offset

    def signal(self, name: str) -> Signal | None:
        """A signal of the bus in either direction; None where there is none."""
        received = {signal.name: signal for signal in self.bus.drive_pdo.signals}
        return received.get(name) or self.bus.signal(name)
