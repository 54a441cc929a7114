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
from hydraulic_sysid.calibrate.segments import Pieces, cut
from hydraulic_sysid.records import Record

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
    fitted = []
    for i, piece in enumerate(pieces):
        number = np.arange(len(piece.starts))
        if held_out:
            fitted.append(np.full(number.size, i < len(records)))
        else:  # shifted from record to record, so that not always the same phase of an experiment is held out
            fitted.append(
                (number // STRETCH + i) % EVERY != EVERY - 1
                if number.size >= EVERY * STRETCH
                else number % EVERY != EVERY - 1
                if number.size >= EVERY
                else np.ones(number.size, dtype=bool)
            )
    return Split(pieces, fitted)
