"""The CANopen master: opens the bus, checks who is there, boots and maps the devices by SDO, starts and stops them.

Every object that is written is read back. A device is never reset: some valves go active when they start.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator

import can
import canopen
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from hydraulic_can_driver.bus import Address, Bus, Node, Pdo
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.codec import object_bytes, object_value, to_quantity
from hydraulic_can_driver.errors import BusDownError, CodecError, DeviceError
from hydraulic_can_driver.receiver import NMT, Receiver

DEVICE_TYPE = Address(0x1000, 0, "u32")
ERROR_REGISTER = Address(0x1001, 0, "u8")  # 0 while the device has no error
CONSUMER_HEARTBEAT = Address(0x1016, 1, "u32")
PRODUCER_HEARTBEAT = Address(0x1017, 0, "u16")
IDENTITY = {
    name: Address(0x1018, sub, "u32") for sub, name in enumerate(("vendor", "product", "revision", "serial"), 1)
}
RECEIVE, TRANSMIT = (0x1400, 0x1600), (0x1800, 0x1A00)
START, STOP, PRE_OPERATIONAL = 1, 2, 128

_NOT_VALID, _NO_REMOTE = 1 << 31, 1 << 30
_ANSWER_S, _BRIEFLY_S = 1.0, 0.25

# What the library logs, the errors raised here say too, with the device and the object.
logging.getLogger("canopen").addHandler(logging.NullHandler())
logging.getLogger("can").addHandler(logging.NullHandler())


class _Network(canopen.Network):
    """A network whose receiving thread ends soon after it is told to."""

    NOTIFIER_CYCLE = 0.1

    def check(self) -> None:
        """An error of the receiving thread is told to the receiver, once; it does not stop all sending."""


class Master:
    """The bus of `bus`, opened: on `interface` and `channel`, or on those of the file where they are empty.

    :raises BusDownError: the interface cannot be opened.
    """

    def __init__(self, bus: Bus, receiver: Receiver, interface: str = "", channel: str = "") -> None:
        self._bus, self._receiver = bus, receiver
        self.can = open_can(interface or bus.interface, channel or bus.channel, bus.bitrate)
        self._network = _Network(self.can)
        self._network.listeners.insert(0, receiver)  # type: ignore[arg-type]
        self._network.connect()
        for node in bus.nodes.values():
            self._network.add_node(node.id, canopen.ObjectDictionary())
        self._patience(_ANSWER_S, 2)

    @contextlib.contextmanager
    def impatient(self) -> Iterator[None]:
        """Ask once and briefly, for what is done while leaving."""
        self._patience(_BRIEFLY_S, 1)
        yield
        self._patience(_ANSWER_S, 2)

    def close(self) -> None:
        """Give the interface back; may be called again."""
        self._network.disconnect()

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame.

        :raises BusDownError: it could not be sent.
        """
        self._receiver.sending(cob_id)
        try:
            self.can.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        except (can.CanError, OSError, ValueError) as error:
            raise BusDownError(f"cannot send 0x{cob_id:03X}: {error or type(error).__name__}") from None

    def command(self, node: Node, code: int) -> None:
        """NMT command to one device: `START`, `PRE_OPERATIONAL`, `STOP`."""
        self.send(NMT, bytes([code, node.id]))

    def read(self, node: Node, address: Address) -> int | float:
        """Raw value of an object.

        :raises DeviceError: no answer, refused, or another type.
        """
        try:
            return object_value(self._network[node.id].sdo.upload(address.index, address.sub), address)
        except CodecError as error:
            raise DeviceError(f"{_who(node)}: {error}") from None
        except (SdoError, can.CanError, OSError) as error:
            raise _failed(node, f"{address} cannot be read", error) from None

    def write(self, node: Node, address: Address, value: float) -> None:
        """Write the raw value of an object and read it back.

        :raises DeviceError: no answer, refused, or the device keeps another value.
        """
        self._put(node, address, value)
        found = self.read(node, address)
        if object_bytes(found, address) != object_bytes(value, address):
            raise DeviceError(f"{_who(node)}: {address} is {found:g} after {value:g} was written")

    def identify(self, node: Node) -> None:
        """Check that the device is what the file says.

        :raises DeviceError: it is another one, or does not answer.
        """
        profile = int(self.read(node, DEVICE_TYPE)) & 0xFFFF
        if profile != node.profile:
            raise DeviceError(f"{_who(node)}: device of profile {profile}; expected {node.profile} (0x1000)")
        for name, expected in node.identity.items():
            found = int(self.read(node, IDENTITY[name]))
            if found != expected:
                raise DeviceError(f"{_who(node)}: {name} is 0x{found:X}; expected 0x{expected:X} ({IDENTITY[name]})")

    def boot(self, node: Node) -> None:
        """Boot list, heartbeat, mapping of all process data.

        :raises DeviceError: the device does not take something.
        """
        for row in node.boot:
            self.write(node, row.address, row.value)
        self.write(node, PRODUCER_HEARTBEAT, round(node.heartbeat * 1e3))
        for pdo in node.receive:
            self._map(node, pdo, *RECEIVE)
        for pdo in node.transmit:
            self._map(node, pdo, *TRANSMIT)

    def readings(self, node: Node) -> dict[str, float]:
        """The objects that the file says are to be inspected, as quantities by name.

        :raises DeviceError: one cannot be read.
        """
        return {row.name: to_quantity(self.read(node, row.address), row.scale) for row in node.inspect}

    def watch_master(self, node: Node, on: bool) -> None:
        """Let the device watch the heartbeat of the driver, or no longer; it goes to 0 V when that fails."""
        master = self._bus.master
        self.write(node, CONSUMER_HEARTBEAT, master.id << 16 | round(master.lost_after * 1e3) if on else 0)

    def _patience(self, seconds: float, tries: int) -> None:
        for remote in self._network.values():
            remote.sdo.RESPONSE_TIMEOUT, remote.sdo.MAX_RETRIES = seconds, tries

    def _put(self, node: Node, address: Address, value: float) -> None:
        try:
            self._network[node.id].sdo.download(address.index, address.sub, object_bytes(value, address))
        except (SdoError, can.CanError, OSError) as error:
            raise _failed(node, f"{address} cannot be set to {value:g}", error) from None

    def _map(self, node: Node, pdo: Pdo, communication: int, mapping: int) -> None:
        """CiA 301, 7.5.2.36: a mapping is changed while its PDO is not valid."""
        entries = [signal.address.mapping for signal in pdo.signals]
        first = Address(communication + pdo.number - 1, 1, "u32")
        if self._mapped(node, pdo, first, mapping, entries):
            return
        cob_id = pdo.cob_id | int(self.read(node, first)) & _NO_REMOTE
        count = Address(mapping + pdo.number - 1, 0, "u8")
        self._put(node, first, cob_id | _NOT_VALID)
        self._put(node, count, 0)
        for sub, entry in enumerate(entries, 1):
            self._put(node, Address(count.index, sub, "u32"), entry)
        self._put(node, count, len(entries))
        self._put(node, Address(first.index, 2, "u8"), pdo.transmission)
        if pdo.timeout:
            self._put(node, Address(first.index, 5, "u16"), round(pdo.timeout * 1e3))
        self._put(node, first, cob_id)
        if not self._mapped(node, pdo, first, mapping, entries):
            raise DeviceError(f"{_who(node)}: does not keep the mapping of 0x{pdo.cob_id:03X} (0x{first.index:04X})")

    def _mapped(self, node: Node, pdo: Pdo, first: Address, mapping: int, entries: list[int]) -> bool:
        index = mapping + pdo.number - 1
        return (
            int(self.read(node, first)) & ~_NO_REMOTE == pdo.cob_id
            and self.read(node, Address(first.index, 2, "u8")) == pdo.transmission
            and (not pdo.timeout or self.read(node, Address(first.index, 5, "u16")) == round(pdo.timeout * 1e3))
            and self.read(node, Address(index, 0, "u8")) == len(entries)
            and [self.read(node, Address(index, sub, "u32")) for sub, _ in enumerate(entries, 1)] == entries
        )


def _who(node: Node) -> str:
    return f"{node.name} (node 0x{node.id:02X})"


def _failed(node: Node, what: str, error: Exception) -> Exception:
    if isinstance(error, SdoAbortedError):
        return DeviceError(f"{_who(node)}: {what}: the device aborts: {error}")
    if isinstance(error, SdoCommunicationError):
        return DeviceError(f"{_who(node)}: {what}: no answer; is it powered and on this bus?")
    if isinstance(error, SdoError):
        return DeviceError(f"{_who(node)}: {what}: {error}")
    return BusDownError(f"{_who(node)}: {what}: {error or type(error).__name__}")
