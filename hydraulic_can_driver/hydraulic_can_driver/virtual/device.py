"""A CANopen device with power, identity, SDO, NMT, heartbeat, EMCY and process data; what it measures is a subclass's.

`canopen.LocalNode` serves SDO and heartbeat. Its process data are not connected to its objects; here a frame carries
the very bytes that an SDO upload of its objects would give.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable
from typing import Any

import can
import canopen
from canopen.nmt import NMT_STATES

from hydraulic_can_driver.bus import Node
from hydraulic_can_driver.eds_check import eds_file
from hydraulic_can_driver.errors import CodecError
from hydraulic_can_driver.virtual.objects import Objects
from hydraulic_can_driver.virtual.pdo import check_write
from hydraulic_can_driver.virtual.plant import Reading
from hydraulic_can_driver.virtual.process_data import ProcessData, Upsets
from hydraulic_can_driver.virtual.wiring import Event, Wiring

RESET_NODE, RESET_COMMUNICATION = 129, 130
NMT_CODES = {name: code for code, name in NMT_STATES.items()}
SENSOR_FAULT = 0x5000
"""EMCY: device hardware."""
_HEARTBEAT = 0x700
_HISTORY = 8


class _Served(canopen.LocalNode):
    """`canopen`'s node; asks its device for the values and tells it of new ones."""

    def __init__(self, device: Device, node_id: int, dictionary: canopen.ObjectDictionary) -> None:
        super().__init__(node_id, dictionary)
        self._device = device
        # Heartbeats go by the time of the bench, which `canopen`'s own thread does not know.
        self.nmt.start_heartbeat = device.beat_every  # type: ignore[assignment, method-assign]

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        stored = super().get_data
        self._find_object(index, subindex)
        return self._device.read(
            index, subindex, check_readable, lambda: bytes(stored(index, subindex, check_readable))
        )

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        store = super().set_data
        self._device.write(
            index, subindex, bytes(data), check_writable, lambda: store(index, subindex, data, check_writable)
        )


class Device:
    """One device of the bus file. `power_on` boots it; without power it neither hears nor says anything."""

    profile = 0

    def __init__(self, spec: Node, wiring: Wiring) -> None:
        self.spec, self.name, self.wiring = spec, spec.name, wiring
        self.upsets = Upsets()
        self.node: canopen.LocalNode | None = None
        self.stored: dict[tuple[int, int], int] = {}  # settings that survive a loss of power
        self.pdos = ProcessData(self, wiring.network, wiring.lock, lambda number: self._say("rpdo", str(number)))
        self.objects = Objects(canopen.import_od(str(eds_file(wiring.bus, spec)), spec.id))
        self._connected = False
        self._beat_period = 0.0
        self._next_beat = 0.0

    @property
    def powered(self) -> bool:
        """Whether it has power."""
        return self.node is not None

    @property
    def started(self) -> bool:
        """Whether a master has made it OPERATIONAL; it stays so without the bus."""
        return self.node is not None and self.node.nmt.state == "OPERATIONAL"

    @property
    def operational(self) -> bool:
        """Whether it exchanges process data."""
        return self._connected and self.started

    def power_on(self) -> None:
        """Boot: stored settings, boot-up message, PRE-OPERATIONAL."""
        if self.node is not None:
            return
        self.objects.clear()
        self.node = _Served(self, self.spec.id, self.objects.dictionary)
        for (index, sub), value in self.stored.items():
            self.take_bytes(index, sub, self.objects.variable(index, sub).encode_raw(value))
        self.start()
        self.connect()
        self._say("power", "on")
        self._boot()

    def power_off(self) -> None:
        """The supply fails: silent from this moment on."""
        if self.node is None:
            return
        self.disconnect()
        self.node = None
        self.halt()
        self._say("power", "off")

    def connect(self) -> None:
        """Join the bus, without a word."""
        if self.node is None or self._connected:
            return
        self.node.associate_network(self.wiring.network)
        # The bench hands NMT commands on, so that a device may vanish while one is being obeyed.
        self.wiring.network.unsubscribe(0, self.node.nmt.on_command)
        self._connected = True
        self.pdos.configure(list(self.objects.dictionary))
        self._beat()

    def disconnect(self) -> None:
        """Leave the bus, as one that is bus-off or whose connector is out."""
        if self.node is None or not self._connected:
            return
        self.pdos.close()
        self.wiring.network.subscribe(0, self.node.nmt.on_command)  # which `remove_network` takes away again
        self.node.remove_network()
        self._connected = False

    def on_nmt(self, command: int, data: bytes) -> None:
        """An NMT command for this node or for all."""
        node = self.node
        if node is None or not self._connected:
            return
        if command == RESET_NODE:
            self.power_off()
            self.power_on()
            return
        was = self.operational
        if command == RESET_COMMUNICATION:
            self._boot()
        else:
            node.nmt.on_command(0, bytearray(data), 0.0)
            self._say("nmt", node.nmt.state)
        if was and not self.operational:
            self.pdos.forget()
            self.left_operational()
        elif not was and self.operational:
            self.pdos.forget()
            self.entered_operational()

    def take_over(self) -> None:
        """A SYNC: what came for it since the last one is valid from now on."""
        if self.operational:
            self.pdos.take_over()

    def transmit_synchronous(self) -> None:
        """Send what goes with this SYNC."""
        if self.operational:
            self.pdos.transmit_synchronous()

    def watch(self, now: float) -> None:
        """Time goes by: called every few milliseconds of ``now`` [s]."""
        if self._connected and self.node is not None and self._beat_period > 0.0 and now >= self._next_beat:
            self._next_beat = max(self._next_beat + self._beat_period, now)
            with contextlib.suppress(can.CanError):
                self.node.network.send_message(_HEARTBEAT + self.spec.id, bytes([NMT_CODES[self.node.nmt.state]]))
        if self.operational:
            self.pdos.transmit_due(now)

    def beat_every(self, milliseconds: int) -> None:
        """Send heartbeats with this period from now on, the first at once; 0 ends them."""
        self._beat_period = 0.0 if self.upsets.no_heartbeat else milliseconds * 1e-3
        self._next_beat = self.wiring.now()

    def stop_heartbeat(self, on: bool) -> None:
        """Whether heartbeats stop whatever 0x1017 says."""
        self.upsets.no_heartbeat = on
        self._beat()

    def emergency(self, code: int, register: int, data: bytes = b"") -> None:
        """Send an EMCY and keep it in the history; code 0 says that all is well again."""
        if self.node is None:
            return
        self.set(0x1001, 0, register)
        if code:
            errors = [self.get(0x1003, n) for n in range(1, self.get(0x1003, 0) + 1)]
            for n, error in enumerate([code, *errors][:_HISTORY], 1):
                self.set(0x1003, n, error)
            self.set(0x1003, 0, min(len(errors) + 1, _HISTORY))
        if self._connected:
            with contextlib.suppress(can.CanError):
                self.node.emcy.send(code, register, data)
        self._say("emcy", f"0x{code:04X}")

    def get(self, index: int, sub: int = 0) -> Any:
        """Number in an object, as an SDO upload would give it."""
        return self.objects.number(index, sub, self._stored)

    def object_bytes(self, index: int, sub: int) -> bytes:
        """Bytes of an object."""
        return self.objects.type(index, sub).encode(self.get(index, sub))

    def take_bytes(self, index: int, sub: int, data: bytes) -> None:
        """Put bytes into an object from inside: nothing is refused."""
        assert self.node is not None, f"{self.name} has no power"
        self.node.set_data(index, sub, data)

    def set(self, index: int, sub: int, value: float) -> None:
        """Let an object read ``value`` from now on; cut to the range of its type."""
        self.objects.put(index, sub, value)

    def store(self, index: int, sub: int, value: int) -> None:
        """Set a parameter as with the maker's tool: it holds now and after every power-on.

        :raises CodecError: there is no such object, or the value does not fit.
        """
        found = self.objects.find(index, sub)
        if found is None:
            raise CodecError(f"{self.name} has no object 0x{index:04X}:{sub}")
        try:
            data = found.encode_raw(value)
        except (struct.error, canopen.ObjectDictionaryError) as error:
            raise CodecError(f"{self.name}, 0x{index:04X}:{sub} cannot be {value}: {error}") from None
        with self.wiring.lock:
            self.stored[index, sub] = value
            if self.node is not None:
                self.take_bytes(index, sub, data)

    def read(self, index: int, sub: int, by_sdo: bool, stored: Callable[[], bytes]) -> bytes:
        """Bytes of an object: what the device measures where it measures it, else what is ``stored``."""
        with self.wiring.lock:
            if by_sdo:
                self._asked("sdo read", index, sub)
            identity = self.upsets.identity.get(sub) if index == 0x1018 else None
            value = self.objects.own(index, sub) if identity is None else identity
            return stored() if value is None else bytes(self.objects.type(index, sub).encode(value))

    def write(self, index: int, sub: int, data: bytes, by_sdo: bool, store: Callable[[], None]) -> None:
        """Take the bytes of an object, or answer with an SDO abort."""
        with self.wiring.lock:
            if by_sdo:
                self._check(index, sub, data)
            store()
            self.objects.written(index, sub)
            if 0x1400 <= index < 0x1C00 and self._connected:
                self.pdos.configure(list(self.objects.dictionary))
            elif index == 0x1017:
                self._beat()
            self.written(index, sub)
            if by_sdo:
                self._asked("sdo write", index, sub)

    def start(self) -> None:
        """Power is on; settings are read, nothing is sent yet."""

    def halt(self) -> None:
        """Power is gone."""

    def sense(self, reading: Reading) -> None:
        """Put what the plant says now into the objects."""

    def written(self, index: int, sub: int) -> None:
        """An object has a new value, by SDO, by a PDO or by `store`."""

    def refuse(self, index: int, sub: int, value: int) -> int:
        """The SDO abort code for a write that the device does not accept; 0 accepts it."""
        return 0

    def received(self, number: int) -> None:
        """A process data frame has come."""

    def left_operational(self) -> None:
        """Process data stop by an NMT command."""

    def entered_operational(self) -> None:
        """Process data begin."""

    def _boot(self) -> None:
        assert self.node is not None
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"
        self._beat()
        self._say("nmt", "PRE-OPERATIONAL")

    def _beat(self) -> None:
        """Heartbeats as 0x1017 says, unless they have stopped."""
        if self.node is None or not self._connected:
            return
        if self.node.nmt.state != "INITIALISING":
            self.beat_every(self.get(0x1017))

    def _asked(self, kind: str, index: int, sub: int) -> None:
        """A master has asked for an object: what waited for this happens before the answer."""
        self._say(kind, f"0x{index:04X}:{sub}")
        self.wiring.settle()
        if self.node is None:
            raise canopen.SdoCommunicationError(f"{self.name} lost its power")
        if (index, sub) in self.upsets.aborts:
            raise canopen.SdoAbortedError(self.upsets.aborts[index, sub])

    def _check(self, index: int, sub: int, data: bytes) -> None:
        if (index, sub) in self.upsets.aborts:
            raise canopen.SdoAbortedError(self.upsets.aborts[index, sub])
        value = self.objects.value_to_write(index, sub, data)
        if value is None:
            return
        check_write(self.get, self.objects.mappable, index, sub, value)
        if code := self.refuse(index, sub, value):
            raise canopen.SdoAbortedError(code)

    def _stored(self, index: int, sub: int) -> bytes:
        assert self.node is not None, f"{self.name} has no power"
        return self.node.get_data(index, sub)

    def _say(self, kind: str, detail: str) -> None:
        self.wiring.tell(Event(kind, self.name, detail))


class Sensor(Device):
    """A device whose sensor has a cable."""

    def __init__(self, spec: Node, wiring: Wiring) -> None:
        super().__init__(spec, wiring)
        self._broken = False

    @property
    def broken(self) -> bool:
        """Whether its cable is broken."""
        return self._broken

    @broken.setter
    def broken(self, on: bool) -> None:
        if on == self._broken:
            return
        self._broken = on
        self.emergency(SENSOR_FAULT if on else 0, 0x81 if on else 0)
