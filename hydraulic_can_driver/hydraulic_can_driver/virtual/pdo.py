"""Process data of a virtual device, by the communication and mapping parameters in its own dictionary (CiA 301, 7.5.2).

A master that changes a mapping has to do it in the order of the standard: object switched off (bit 31 of its COB-ID),
number of entries 0, entries, number, switched on. Anything else is answered by an SDO abort.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from canopen import SdoAbortedError

OFF = 0x80000000
LAST_SYNCHRONOUS = 240
EVENT_DRIVEN = (254, 255)
WRONG_STATE, NOT_MAPPABLE, TOO_LONG, BAD_VALUE = 0x08000022, 0x06040041, 0x06040042, 0x06090030

Read = Callable[[int, int], int]
"""Value of an object (index, sub-index) that holds a number."""


@dataclass(frozen=True)
class Mapping:
    """One process data object as configured: objects (index, sub-index, bytes) in the order of the frame."""

    number: int
    cob_id: int
    transmission: int
    timer: float
    objects: tuple[tuple[int, int, int], ...]

    @property
    def length(self) -> int:
        """Bytes of its frame."""
        return sum(size for _, _, size in self.objects)

    @property
    def synchronous(self) -> bool:
        """Whether it goes with SYNC."""
        return self.transmission <= LAST_SYNCHRONOUS


def configured(read: Read, communication: int, mapping: int, number: int) -> Mapping | None:
    """What the dictionary says of object ``number``, with parameters from those indices on; None if it is off."""
    place, entries = communication + number - 1, mapping + number - 1
    cob_id = read(place, 1)
    if cob_id & OFF:
        return None
    words = [read(entries, sub) for sub in range(1, read(entries, 0) + 1)]
    objects = tuple((word >> 16, word >> 8 & 0xFF, (word & 0xFF) // 8) for word in words)
    return Mapping(number, cob_id & 0x7FF, read(place, 2), read(place, 5) * 1e-3, objects)


def check_write(read: Read, mappable: Callable[[int, int], int], index: int, sub: int, value: int) -> None:
    """Raise the SDO abort that a device answers to a write that its process data do not allow now.

    ``mappable``: bits of an object that may be mapped, 0 if it may not.
    """
    if 0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00:
        if sub == 2 and LAST_SYNCHRONOUS < value < EVENT_DRIVEN[0]:
            raise SdoAbortedError(BAD_VALUE)
        if sub == 1 and not value & OFF and not read(index, 1) & OFF and value != read(index, 1):
            raise SdoAbortedError(WRONG_STATE)
        return
    if not (0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00):
        return
    if not read(index - 0x200, 1) & OFF:
        raise SdoAbortedError(WRONG_STATE)
    if sub == 0:
        if value > 8 or sum(read(index, n) & 0xFF for n in range(1, value + 1)) > 64:
            raise SdoAbortedError(TOO_LONG)
    elif read(index, 0) != 0:
        raise SdoAbortedError(WRONG_STATE)
    elif value and mappable(value >> 16, value >> 8 & 0xFF) != value & 0xFF:
        raise SdoAbortedError(NOT_MAPPABLE)
