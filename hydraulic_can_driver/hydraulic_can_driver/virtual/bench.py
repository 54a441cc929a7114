"""All devices of a bus file, alive on one bus over one plant."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

import can
import canopen

from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.errors import BusFileError
from hydraulic_can_driver.virtual.device import Device
from hydraulic_can_driver.virtual.faults import InjectedFault
from hydraulic_can_driver.virtual.lvdt import Lvdt
from hydraulic_can_driver.virtual.plant import Plant, Reading, SlotClock, SyncClock
from hydraulic_can_driver.virtual.transducer import Transducer
from hydraulic_can_driver.virtual.valve import Valve
from hydraulic_can_driver.virtual.wiring import Event, Wiring

PROFILES: dict[int, type[Device]] = {kind.profile: kind for kind in (Valve, Lvdt, Transducer)}

_SYNC = 0x80
_HEARTBEAT = 0x700
_TICK_S = 0.005, 0.02  # shortest and longest; half a period between them
_FREE_RUN_S = 0.02  # silence of SYNC after which the plant goes on by the clock
_FREE_RUN_PERIODS = 5
_NOTIFIER_S = 0.1


class VirtualBench:
    """Devices of ``bus`` on ``line`` over ``plant``; between `start` and `stop` they have power.

    ``line`` is a CAN bus or a connected `canopen.Network` of this bench's own (the driver has another one), or None:
    then the bus file's interface and channel are opened. In ``lockstep`` one SYNC is one period of the plant, and time
    stands still without. Usable as a context manager.

    :raises BusFileError: a node has no EDS file, or a profile that is not virtual.
    :raises BusDownError: the interface cannot be opened.
    """

    def __init__(
        self, bus: Bus, line: can.BusABC | canopen.Network | None, plant: Plant, lockstep: bool = False
    ) -> None:
        self.bus, self.plant, self.lockstep = bus, plant, lockstep
        self.error: Exception | None = None
        self.syncs = 0
        self.listeners: list[Callable[[Event], None]] = []
        self._lock = threading.RLock()
        self._waiting: list[tuple[Event, int, InjectedFault]] = []
        self._happening: list[InjectedFault] = []
        self._timed: list[tuple[float, Callable[[], None]]] = []
        self._settling = False
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self._own_bus = line is None
        self._own_notifier = not isinstance(line, canopen.Network)
        if isinstance(line, canopen.Network):
            self.network = line
        else:
            self.network = canopen.Network(line or open_can(bus.interface, bus.channel, bus.bitrate))
        wiring = Wiring(self.network, bus, self._lock, self._tell, self._settle, self.now)
        self._clock = self._new_clock()
        self.devices: dict[str, Device] = {}
        for name, spec in bus.nodes.items():
            if spec.profile not in PROFILES:
                known = ", ".join(map(str, sorted(PROFILES)))
                raise BusFileError(f"{bus.path}: node {name}: profile {spec.profile} is not virtual; there are {known}")
            self.devices[name] = PROFILES[spec.profile](spec, wiring)
        self.reading = Reading(position=0.0)

    def __enter__(self) -> VirtualBench:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def valve(self) -> Valve:
        """The device that takes the drive."""
        valve = self.devices[self.bus.valve.name]
        assert isinstance(valve, Valve)
        return valve

    @property
    def drive(self) -> float:
        """What the spool is told at this moment, as drive [V]."""
        return self.valve.drive_now

    def now(self) -> float:
        """Time that the devices live in, s."""
        return self._clock.now()

    def start(self) -> None:
        """Power on, in the order of the bus file."""
        if self._own_notifier:
            self.network.NOTIFIER_CYCLE = _NOTIFIER_S
            self.network.connect()
        for cob_id, handler in self._subscriptions():
            self.network.subscribe(cob_id, handler)
        with self._lock:
            self._clock = self._new_clock()
            for device in self.devices.values():
                device.power_on()
            self._period()
            self._settle()
        self._ending.clear()
        if not self.lockstep:
            self._thread = threading.Thread(target=self._tick, name="virtual_bench", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Power off; what was opened here is closed."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with self._lock:
            for device in self.devices.values():
                device.power_off()
        for cob_id, handler in self._subscriptions():
            with contextlib.suppress(KeyError, ValueError):
                self.network.unsubscribe(cob_id, handler)
        if self._own_bus:
            self.network.disconnect()
        elif self._own_notifier and self.network.notifier is not None:
            self.network.notifier.stop()

    def inject(self, fault: InjectedFault) -> None:
        """Begin a fault now. KeyError where it names no device."""
        with self._lock:
            fault.begin(self)

    def clear(self, fault: InjectedFault) -> None:
        """End a fault."""
        with self._lock:
            fault.end(self)

    def at(self, kind: str, node: str, detail: str, fault: InjectedFault, count: int = 1) -> None:
        """Begin a fault when an event (see `Event`) happens for the ``count``-th time from now on."""
        with self._lock:
            self._waiting.append((Event(kind, node, detail), count, fault))

    def after(self, seconds: float, act: Callable[[], None]) -> None:
        """Do something when so much time of the devices has passed."""
        with self._lock:
            self._timed.append((self.now() + seconds, act))

    def _subscriptions(self) -> list[tuple[int, Callable[[int, bytearray, float], None]]]:
        return [
            (0, self._on_nmt),
            (_SYNC, self._on_sync),
            (_HEARTBEAT + self.bus.master.id, self._on_heartbeat),
        ]

    def _on_nmt(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) != 2:
            return
        with self._lock:
            for device in self.devices.values():
                if data[1] in (0, device.spec.id):
                    device.on_nmt(data[0], bytes(data))
            self._settle()

    def _on_heartbeat(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        with self._lock:
            self.valve.master.heartbeat(cob_id - _HEARTBEAT)

    def _on_sync(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        with self._lock, self._watched():
            # By the time at which the interface received it: a SYNC that had to wait for this thread is not late.
            for _ in range(self._clock.sync(timestamp or time.time()) - 1):
                self._period()
            if self.lockstep:
                self._watch()
            for device in self.devices.values():
                device.take_over()
            self._period()
            for device in self.devices.values():
                device.transmit_synchronous()
            self.syncs += 1
            self._tell(Event("sync", "", str(self.syncs)))
            self._settle()

    def _tick(self) -> None:
        patience = max(_FREE_RUN_S, _FREE_RUN_PERIODS / self.bus.rate)
        tick = min(max(0.5 / self.bus.rate, _TICK_S[0]), _TICK_S[1])
        while not self._ending.wait(tick):
            with self._lock, self._watched():
                for _ in range(self._clock.overdue(time.time(), patience)):
                    self._period()
                self._watch()
                self._settle()

    def _watch(self) -> None:
        now = self.now()
        for begin, act in [entry for entry in self._timed if entry[0] <= now]:
            self._timed.remove((begin, act))
            act()
        for device in self.devices.values():
            device.watch(now)

    def _new_clock(self) -> SyncClock | SlotClock:
        return SyncClock(1.0 / self.bus.rate) if self.lockstep else SlotClock(1.0 / self.bus.rate, time.time())

    def _period(self) -> None:
        """One sampling period of the plant, with the spool where the valve wants it now."""
        period = 1.0 / self.bus.rate
        self.reading = self.plant.step(self.valve.drive(period), period)
        for device in self.devices.values():
            if device.powered:
                device.sense(self.reading)

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        """A plant that fails leaves no device behind that would report its last values for ever."""
        try:
            yield
        except Exception as error:
            self.error = error
            self._ending.set()
            for device in self.devices.values():
                device.power_off()

    def _tell(self, event: Event) -> None:
        for listener in self.listeners:
            listener(event)
        for i, (awaited, count, fault) in enumerate(self._waiting):
            if awaited == event:
                self._waiting[i] = awaited, count - 1, fault
        self._happening += [fault for _, count, fault in self._waiting if count == 0]
        self._waiting = [entry for entry in self._waiting if entry[1] > 0]

    def _settle(self) -> None:
        if self._settling:
            return
        self._settling = True
        try:
            while self._happening:
                self._happening.pop(0).begin(self)
        finally:
            self._settling = False
