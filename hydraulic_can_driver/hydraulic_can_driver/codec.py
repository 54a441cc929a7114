"""SI quantities to and from the bytes of process data objects: what saturates, what is an error.

A raw integer r stands for gain · r + offset. Encoding rounds to the nearest count and saturates at the ends of the
type, which it reports; NaN and infinity are errors. Bytes are little-endian without gaps (CiA 301, 7.4.8).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping

from hydraulic_can_driver.bus import TYPES, Address, Pdo, Scale
from hydraulic_can_driver.errors import CodecError


def raw_range(kind: str) -> tuple[float, float]:
    """Least and largest raw value of a type."""
    if kind == "f32":
        largest = float.fromhex("0x1.fffffep127")
        return -largest, largest
    bits = int(kind[1:])
    return (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if kind[0] == "i" else (0, 2**bits - 1)


def to_raw(quantity: float, scale: Scale, kind: str) -> tuple[int | float, bool]:
    """Raw value of a quantity, and whether it had to be cut to the range of the type.

    :raises CodecError: the quantity is not finite.
    """
    raw = (quantity - scale.offset) / scale.gain
    if not math.isfinite(raw):
        raise CodecError(f"{quantity} {scale.unit} cannot be sent; expected a finite number")
    low, high = raw_range(kind)
    value = raw if kind == "f32" else round(raw)
    return min(max(value, low), high), not low <= value <= high


def to_quantity(raw: float, scale: Scale) -> float:
    """The quantity that a raw value stands for."""
    return scale.gain * raw + scale.offset


def object_bytes(value: float, address: Address) -> bytes:
    """Bytes of a raw value in an object.

    :raises CodecError: it does not fit.
    """
    try:
        return struct.pack("<" + TYPES[address.type], value)
    except (struct.error, OverflowError):
        low, high = raw_range(address.type)
        raise CodecError(f"{address}: {value} is no {address.type}; allowed: {low:g} ... {high:g}") from None


def object_value(data: bytes, address: Address) -> int | float:
    """Raw value in the bytes of an object.

    :raises CodecError: their number is not that of the type.
    """
    if len(data) * 8 != address.bits:
        raise CodecError(f"{address}: {len(data)} bytes; {address.type} has {address.bits // 8}")
    value: int | float = struct.unpack("<" + TYPES[address.type], data)[0]
    return value


class PdoCodec:
    """Bytes of one process data object."""

    def __init__(self, pdo: Pdo) -> None:
        self.pdo = pdo
        self.names = tuple(signal.name for signal in pdo.signals)
        self._struct = struct.Struct("<" + "".join(TYPES[signal.address.type] for signal in pdo.signals))
        self._signals = {signal.name: signal for signal in pdo.signals}

    def pack(self, values: Mapping[str, float]) -> bytes:
        """Frame of the raw values of all signals.

        :raises CodecError: one is missing or does not fit its type.
        """
        try:
            return self._struct.pack(*(values[name] for name in self.names))
        except KeyError as error:
            raise CodecError(f"COB-ID 0x{self.pdo.cob_id:X} carries {error.args[0]!r} too") from None
        except struct.error as error:
            raise CodecError(f"COB-ID 0x{self.pdo.cob_id:X}, {dict(values)}: {error}") from None

    def unpack(self, data: bytes) -> tuple[int | float, ...]:
        """Raw values in a frame, in the order of `names`.

        :raises CodecError: wrong length.
        """
        if len(data) != self._struct.size:
            raise CodecError(
                f"COB-ID 0x{self.pdo.cob_id:X} has {len(data)} bytes; mapped are {self._struct.size} "
                f"({', '.join(self.names)})"
            )
        return self._struct.unpack(data)

    def encode(self, quantities: Mapping[str, float]) -> tuple[bytes, tuple[str, ...]]:
        """Frame of quantities (words of bits: as they are), and the names of those that were cut to their range."""
        raw: dict[str, float] = {}
        cut: list[str] = []
        for name in self.names:
            signal = self._signals[name]
            raw[name], saturated = to_raw(quantities[name], signal.scale, signal.address.type)
            if saturated:
                cut.append(name)
        return self.pack(raw), tuple(cut)

    def decode(self, data: bytes) -> dict[str, float]:
        """Quantities in a frame (words of bits: integers).

        :raises CodecError: wrong length.
        """
        found: dict[str, float] = {}
        for name, raw in zip(self.names, self.unpack(data), strict=True):
            scale = self._signals[name].scale
            found[name] = raw if not scale.unit else scale.gain * raw + scale.offset
        return found
