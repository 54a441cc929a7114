"""JSON logs: a list of samples, each an object with the same keys, as most Python loggers write them.

What stands beside the list (a mass, a gain) is the same for all samples, and a column like the others; text and what
is nested deeper is left out. True and false are 1 and 0.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.errors import one_line
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import FileError
from hydraulic_sysid.data.records.column_map import ColumnMap
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.vectors import DESCRIPTION, Vectors, columns_of

SUFFIXES = (".json",)


def table(path: Path, columns: ColumnMap | None = None) -> Vectors:
    """The numbers of a log.

    :raises FileError: unreadable, or no list of samples in it.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"no readable JSON ({one_line(error)})") from None
    beside = content if isinstance(content, dict) else {}
    lists = {"": content} if isinstance(content, list) else beside
    samples = max((v for v in lists.values() if _is_samples(v)), key=len, default=None)
    if samples is None:
        raise FileError(path, "holds no list of samples", expected="a list of objects with numbers, at least two")
    constant = {k: v for k, v in beside.items() if _is_number(v)}
    found = {name: np.full(len(samples), float(value)) for name, value in constant.items()}
    return Vectors(path, {**found, **_columns(samples)}, beside.get(DESCRIPTION) if beside else None)


def content(record: Record) -> bytes:
    """A log with the time and each channel in every sample."""
    named = columns_of(record)
    samples = [dict(zip(named, row, strict=True)) for row in zip(*(v.tolist() for v in named.values()), strict=True)]
    described = {"name": record.name, **record.description}
    return json.dumps({DESCRIPTION: described, "samples": samples}, ensure_ascii=False).encode()


def _is_number(value: Any) -> bool:
    return isinstance(value, (bool, int, float))


def _is_samples(value: Any) -> bool:
    return isinstance(value, list) and len(value) > 1 and all(isinstance(one, dict) for one in value)


def _columns(samples: list[dict[str, Any]]) -> dict[str, Array]:
    """Every key that has a number in all samples."""
    names = [name for name, value in samples[0].items() if _is_number(value)]
    return {
        name: np.array([float(one[name]) for one in samples])
        for name in names
        if all(_is_number(one.get(name)) for one in samples)
    }
