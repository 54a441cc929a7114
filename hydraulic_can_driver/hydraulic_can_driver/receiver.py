"""Everything that comes from the bus, sorted as it comes: process data, heartbeats, emergencies, what nobody expects.

Called by python-can's receiving thread for each frame; nothing here is polled. SDO answers go past it to `canopen`.
"""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Callable

import can

from hydraulic_can_driver.bus import Bus, Node
from hydraulic_can_driver.can_bus import hears_itself, stamps_by_wall_clock
from hydraulic_can_driver.faults import BusFault, FaultLatch
from hydraulic_can_driver.frames import Frames
from hydraulic_node_utils.scheduling import request_realtime

SYNC, NMT, EMERGENCY, SDO_ANSWER, SDO_QUESTION, HEARTBEAT = 0x080, 0x000, 0x080, 0x580, 0x600, 0x700
BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
STATES = {BOOT_UP: "boot-up", STOPPED: "STOPPED", OPERATIONAL: "OPERATIONAL", PRE_OPERATIONAL: "PRE-OPERATIONAL"}
_EMERGENCY = struct.Struct("<HB5s")
# Linux, include/uapi/linux/can/error.h: these classes of error frames end all traffic.
_BUS_OFF = 0x40
# After this time the echo of a frame is taken to be lost, and excuses no stranger any more.
_ECHO_S = 1.0
# The kernel sends at most one SYNC per period, if some of them late. So many more than time has passed for are another
# master's; what there is too much is forgotten at so much per SYNC, since clocks differ.
_SURPLUS, _FORGOTTEN = 2.5, 0.01


class Receiver(can.Listener):
    """Listens to a bus; sends nothing.

    `heard[node]` is when a heartbeat of the node came (`now`, s), `states[node]` the NMT state it told. While
    `watching`, a node that restarts or leaves OPERATIONAL is a fault, as is a frame that only the driver may send.
    Where a `priority` is set, the receiving thread asks for it with the next frame.
    """

    def __init__(
        self,
        bus: Bus,
        frames: Frames,
        faults: FaultLatch,
        interface: str,
        kernel_sync: bool = False,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.frames, self._faults = frames, faults
        self._now = now
        self.watching = False
        self.heard: dict[str, float] = {}
        self.states: dict[str, int] = {}
        self.emergencies: deque[str] = deque(maxlen=20)
        self.unexpected = 0
        self.priority = 0
        self._echo = hears_itself(interface)
        self._dated = stamps_by_wall_clock(interface)
        self._received = 0  # when the frame at hand was, by the interface, ns; 0: it does not say
        self._outstanding: dict[int, deque[float]] = {}
        self._handlers: dict[int, Callable[[bytes], None]] = {}
        self._known: set[int] = set()
        for cob_id in frames.cob_ids:
            self._handlers[cob_id] = lambda data, cob_id=cob_id: frames.take(cob_id, data, self._received)  # type: ignore[misc]
        for node in bus.nodes.values():
            self._handlers[HEARTBEAT + node.id] = lambda data, node=node: self._heartbeat(node, data)  # type: ignore[misc]
            self._handlers[EMERGENCY + node.id] = lambda data, node=node: self._emergency(node, data)  # type: ignore[misc]
            self._known.add(SDO_ANSWER + node.id)
            if hears_itself(interface):
                self._known.add(SDO_QUESTION + node.id)
        for own in (SYNC, NMT, bus.drive_pdo.cob_id, HEARTBEAT + bus.master.id):
            self._handlers[own] = lambda data, own=own: self._own(own)  # type: ignore[misc]
        self._kernel_sync = kernel_sync
        self._sync_period_ns = round(1e9 / bus.rate)
        self._surplus = 0.0

    def on_message_received(self, msg: can.Message) -> None:
        """Sort a frame."""
        if self.priority:
            # The control loop waits for this thread, which is python-can's and can only raise itself.
            request_realtime(self.priority)
            self.priority = 0
        if msg.is_error_frame:
            if msg.arbitration_id & _BUS_OFF:
                self._faults.report(BusFault.BUS, "the controller is bus-off: check wiring, termination and bit rate")
            return
        if msg.is_remote_frame or msg.is_extended_id:
            self.unexpected += 1
            return
        cob_id = msg.arbitration_id
        if self._kernel_sync and cob_id == SYNC:
            self._kernel(round(msg.timestamp * 1e9))
        elif cob_id in self._handlers:
            self._received = round(msg.timestamp * 1e9) if self._dated else 0
            self._handlers[cob_id](bytes(msg.data))
        elif cob_id not in self._known:
            self.unexpected += 1

    def on_error(self, exc: Exception) -> None:
        """Receiving failed."""
        self._faults.report(BusFault.BUS, f"receiving failed: {exc or type(exc).__name__}")

    def stop(self) -> None:
        """Nothing to release."""

    def sending(self, cob_id: int) -> None:
        """The driver is about to send a frame, which may come back to it."""
        if self._echo:
            self._outstanding.setdefault(cob_id, deque(maxlen=5000)).append(self._now())

    def _own(self, cob_id: int) -> None:
        echoes, now = self._outstanding.get(cob_id, deque()), self._now()
        while echoes:
            if now - echoes.popleft() < _ECHO_S:
                return
        self.unexpected += 1
        if self.watching:
            text = f"a second master on the bus: COB-ID 0x{cob_id:03X} is not ours"
            self._faults.report(BusFault.SECOND_MASTER, text)

    def _kernel(self, stamp_ns: int) -> None:
        passed = (stamp_ns - self.frames.sync_ns) / self._sync_period_ns
        self.frames.begin(stamp_ns)
        self._surplus = max(self._surplus + 1.0 - passed - _FORGOTTEN, 0.0) if self.watching and passed > 0.0 else 0.0
        if self._surplus > _SURPLUS:
            self._surplus = 0.0
            self._own(SYNC)

    def _heartbeat(self, node: Node, data: bytes) -> None:
        if len(data) != 1:
            self.unexpected += 1
            return
        state = data[0] & 0x7F
        self.heard[node.name], self.states[node.name] = self._now(), state
        if self.watching and state == BOOT_UP:
            self._faults.report(BusFault.RESTART, f"{node.name} has restarted: configure it anew")
        elif self.watching and state != OPERATIONAL:
            told = STATES.get(state, f"state {state}")
            self._faults.report(BusFault.RESTART, f"{node.name} is {told}, not OPERATIONAL: configure it anew")

    def _emergency(self, node: Node, data: bytes) -> None:
        if len(data) != _EMERGENCY.size:
            self.unexpected += 1
            return
        code, register, detail = _EMERGENCY.unpack(data)
        if code & 0xFF00 == 0:  # error reset or no error
            self.emergencies.append(f"{node.name}: no error")
            return
        text = f"{node.name}: EMCY 0x{code:04X}, error register 0x{register:02X}, {detail.hex(' ')}"
        self.emergencies.append(text)
        self._faults.report(BusFault.EMERGENCY, text)
