"""Many serialised messages of one type to arrays and back, all at once.

Messages of a stream differ only in their numbers: the layout of one, found by walking through it, holds for all
that have the same texts and lengths. CDR (OMG formal/2021-11-01, 7.4.1): every primitive is aligned to its size,
counted from the end of the 4-byte encapsulation header; texts and sequences begin with their length.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from hydraulic_sim.arrays import Index
from hydraulic_sysid.data.bag.types import typestore
from hydraulic_sysid.data.errors import RecordError

_NUMBERS = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "float32": "f4",
    "float64": "f8",
    **{f"{sign}{8 * size}": f"{sign[0]}{size}" for sign in ("int", "uint") for size in (1, 2, 4, 8)},
}
_HEADER = 4
_LONGEST = 1 << 20


class CdrError(RecordError):
    """Bytes that are no message of the stated type, or messages that do not fit together."""


@dataclass(frozen=True)
class Field:
    """Where ``count`` numbers of one kind lie in a message; ``count`` is None for a single one."""

    offset: int
    dtype: np.dtype[Any]
    count: int | None

    @property
    def span(self) -> slice:
        """Its bytes."""
        return slice(self.offset, self.offset + self.dtype.itemsize * (1 if self.count is None else self.count))


@dataclass(frozen=True)
class Layout:
    """Where every number of a message lies, by the path of its field, and what its texts are.

    ``fixed`` are the bytes that decide both: messages that are equal there have the same layout and texts.
    """

    numbers: Mapping[str, Field]
    texts: Mapping[str, tuple[str, ...]]
    fixed: Index


@dataclass(frozen=True)
class Messages:
    """Numbers ``(N,)`` or ``(N, count)`` and texts (one tuple per message) by the path of their field."""

    numbers: Mapping[str, NDArray[Any]]
    texts: Mapping[str, Sequence[tuple[str, ...]]]

    @property
    def stamps(self) -> Index:
        """Stamps ``(N,)`` of the headers in nanoseconds."""
        return self.numbers["header.stamp.sec"] * np.int64(10**9) + self.numbers["header.stamp.nanosec"]


def layout(kind: str, message: bytes) -> Layout:
    """Layout of one message of type ``kind``.

    :raises CdrError: the bytes end too early or hold an impossible length.
    """
    walk = _Walk(message)
    try:
        walk.message(kind, "")
    except (struct.error, IndexError, UnicodeDecodeError) as error:
        raise CdrError(f"no {kind}: {error} (message of {len(message)} bytes)") from None
    texts = {path: tuple(text) for path, text in walk.texts.items()}
    return Layout(walk.numbers, texts, np.array(walk.fixed, np.int64))


def decode(kind: str, payloads: Sequence[bytes]) -> Messages:
    """All messages of a topic.

    :raises CdrError: a message is damaged, or its sequences have other lengths than the first one's.
    """
    if not payloads:
        raise CdrError(f"no {kind} to decode")
    numbers: dict[str, NDArray[Any]] = {}
    texts: dict[str, list[tuple[str, ...]]] = {}
    for chosen, plan, block in _alike(kind, payloads):
        for path, field in plan.numbers.items():
            values = np.ascontiguousarray(block[:, field.span]).view(field.dtype)
            values = values[:, 0] if field.count is None else values
            if path not in numbers:
                numbers[path] = np.empty((len(payloads), *values.shape[1:]), values.dtype.newbyteorder("="))
            elif numbers[path].shape[1:] != values.shape[1:]:
                size, other = values.shape[1], numbers[path].shape[1]
                raise CdrError(f"message {chosen[0] + 1}: {path} has {size} values, the first message has {other}")
            numbers[path][chosen] = values
        for path, text in plan.texts.items():
            column = texts.setdefault(path, [()] * len(payloads))
            for index in chosen.tolist():
                column[index] = text
    return Messages(numbers, texts)


def encode(kind: str, message: bytes, numbers: Mapping[str, NDArray[Any]]) -> list[bytes]:
    """Copies of ``message`` with the numbers of the given fields, ``(N,)`` or ``(N, count)``, put in.

    :raises CdrError: no such field, or of another length.
    """
    plan = layout(kind, message)
    count = len(next(iter(numbers.values())))
    block = np.tile(np.frombuffer(message, np.uint8), (count, 1))
    for path, values in numbers.items():
        field = plan.numbers.get(path)
        if field is None or np.shape(values)[1:] != (() if field.count is None else (field.count,)):
            there = ", ".join(plan.numbers)
            raise CdrError(f"no field {path} of shape {np.shape(values)[1:]} in {kind}; there are {there}")
        raw = np.ascontiguousarray(values, dtype=field.dtype).reshape(count, -1)
        block[:, field.span] = raw.view(np.uint8)
    return [row.tobytes() for row in block]


def stamped(kind: str, frame: str, **fields: Any) -> bytes:
    """A serialised message with a header of stamp 0 and the given fields, as a template for `encode`."""
    store = typestore()
    header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), frame)
    return bytes(store.serialize_cdr(store.types[kind](header, **fields), kind))


def _alike(kind: str, payloads: Sequence[bytes]) -> Any:
    """Groups of messages with the same layout and texts: their indices, the layout, their bytes as rows."""
    sizes = np.fromiter(map(len, payloads), np.int64, len(payloads))
    for size in np.unique(sizes):
        left = np.flatnonzero(sizes == size)
        rows = np.frombuffer(b"".join([payloads[i] for i in left.tolist()]), np.uint8).reshape(len(left), -1)
        while left.size:
            try:
                plan = layout(kind, rows[0].tobytes())
            except CdrError as error:
                raise CdrError(f"message {left[0] + 1}: {error}") from None
            same = (rows[:, plan.fixed] == rows[0, plan.fixed]).all(axis=1)
            yield left[same], plan, rows[same]
            left, rows = left[~same], rows[~same]


class _Walk:
    """Goes through the bytes of one message and notes what lies where."""

    def __init__(self, data: bytes) -> None:
        if len(data) < _HEADER or data[0] != 0 or data[1] not in (0, 1):
            raise CdrError(f"no plain CDR: the message starts with {data[:_HEADER].hex(' ') or 'nothing'}")
        self._data, self._at = data, _HEADER
        self._order = "<" if data[1] else ">"
        self.numbers: dict[str, Field] = {}
        self.texts: dict[str, list[str]] = {}
        # Not the bytes between the fields: writers leave there what was in their buffer before.
        self.fixed = list(range(2))

    def message(self, kind: str, prefix: str) -> None:
        for name, (node, detail) in typestore().fielddefs[kind][1]:
            self._field(node, detail, f"{prefix}{name}")

    def _field(self, node: Nodetype, detail: Any, path: str) -> None:
        if node == Nodetype.NAME:
            self.message(detail, f"{path}.")
        elif node == Nodetype.BASE:
            self._base(detail[0], path, None)
        else:
            (inner, what), length = detail
            count = self._length() if node == Nodetype.SEQUENCE else length
            if inner == Nodetype.BASE:
                self._base(what[0], path, count)
            else:
                for index in range(count):
                    self._field(inner, what, f"{path}[{index}]")

    def _base(self, kind: str, path: str, count: int | None) -> None:
        if kind not in _NUMBERS:  # string and wstring
            texts = self.texts.setdefault(path, [])
            texts.extend(self._text() for _ in range(1 if count is None else count))
            return
        dtype = np.dtype(self._order + _NUMBERS[kind])
        if count != 0:
            self._align(dtype.itemsize)
        self.numbers[path] = Field(self._at, dtype, count)
        self._skip(dtype.itemsize * (1 if count is None else count))

    def _text(self) -> str:
        size = self._length()
        start = self._at
        self._skip(size)
        self.fixed.extend(range(start, self._at))
        return self._data[start : max(self._at - 1, start)].decode("utf-8")

    def _length(self) -> int:
        self._align(4)
        (length,) = struct.unpack_from(f"{self._order}I", self._data, self._at)
        self.fixed.extend(range(self._at, self._at + 4))
        self._at += 4
        if length > _LONGEST:
            raise IndexError(f"length {length} at byte {self._at - 4}")
        return int(length)

    def _align(self, size: int) -> None:
        self._at += -(self._at - _HEADER) % size

    def _skip(self, size: int) -> None:
        self._at += size
        if self._at > len(self._data):
            raise IndexError(f"ends within byte {self._at}")
