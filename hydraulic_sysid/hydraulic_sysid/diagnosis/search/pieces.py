"""Records cut into pieces, and which of them a fit may see.

Where no held-out records are named, every third stretch of a few pieces is held out of every record, so that what
is held out has seen the same experiments; held-out pieces never enter a fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.segments import Pieces, cut

STRETCH = 3  # pieces in a row that are held out or fitted together
EVERY = 3  # one stretch in so many is held out


@dataclass(frozen=True)
class Split:
    """All pieces, and per record which are fitted: ``fitted[i]`` (S_i,) of ``pieces[i]``."""

    pieces: list[Pieces]
    fitted: list[NDArray[np.bool_]]

    @property
    def to_fit(self) -> list[Pieces]:
        """The pieces that a fit sees, without records of which it sees none."""
        return [p.some(f) for p, f in zip(self.pieces, self.fitted, strict=True) if f.any()]


def split(records: Sequence[Record], held_out: Sequence[Record], plant: Plant, length: float) -> Split:
    """Cut ``records`` and ``held_out`` into pieces of ``length`` seconds. Raises `SegmentError`."""
    pieces = cut(records, plant, length) + cut(held_out, plant, length)
    fitted: list[NDArray[np.bool_]] = []
    for i, piece in enumerate(pieces):
        number: NDArray[np.int64] = np.arange(len(piece.starts), dtype=np.int64)
        if held_out:
            fitted.append(np.full(number.size, i < len(records)))
        else:  # shifted from record to record, so that not always the same phase of an experiment is held out
            fitted.append(_alternate(number, i))
    return Split(pieces, fitted)


def _alternate(number: NDArray[np.int64], shift: int) -> NDArray[np.bool_]:
    """Which pieces of one record are fitted; a record of very few pieces is fitted whole."""
    if number.size >= EVERY * STRETCH:
        return (number // STRETCH + shift) % EVERY != EVERY - 1
    return number % EVERY != EVERY - 1 if number.size >= EVERY else np.ones(number.size, dtype=bool)
