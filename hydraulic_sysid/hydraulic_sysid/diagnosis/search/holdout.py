"""Records cut into segments, and which of them are for fitting, which for validation.

Where no validation records are named, every third block of a few segments of every record is for validation, so that
both have seen the same experiments; segments for validation never enter a fit, but they steer what is added. Of very
long records blocks are left out, evenly, so that memory and time are bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from hydraulic_sim.arrays import Index, Mask
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.segments import Segments, cut, spread

BLOCK = 3  # segments in a row that have the same role
EVERY = 3  # one block in so many is for validation
MOST_VALUES = 240_000  # measured values of all segments: eighty seconds of three channels at 1 kHz


@dataclass(frozen=True)
class Split:
    """All segments, and per record which are for fitting: ``fit[i]`` (S_i,) of ``segments[i]``."""

    segments: list[Segments]
    fit: list[Mask]

    @property
    def to_fit(self) -> list[Segments]:
        """The segments that a fit sees, without records of which it sees none."""
        return [s.subset(f) for s, f in zip(self.segments, self.fit, strict=True) if f.any()]

    def some(self, most: int) -> list[Segments]:
        """About ``most`` of those that a fit sees, spread over all records."""
        return spread(self.to_fit, most)

    def records(self, validation: bool = False) -> list[Record]:
        """Those of which at least a part is fitted, or those that are named for ``validation``."""
        return [s.record for s, f in zip(self.segments, self.fit, strict=True) if bool(f.any()) != validation]

    def judged(self, segments: Sequence[Segments], usable: Sequence[Mask]) -> Split:
        """The same roles for segments of which more is known, without those that are not ``usable[i]`` (S_i,)."""
        kept = [s.subset(u) for s, u in zip(segments, usable, strict=True)]
        return Split(kept, [f[u] for f, u in zip(self.fit, usable, strict=True)])

    @property
    def channels(self) -> list[str]:
        """All that are fitted in any record."""
        return list(dict.fromkeys(c for s in self.segments for c in s.channels))


def split(records: Sequence[Record], validation: Sequence[Record], kind: str, length: float) -> Split:
    """Cut ``records`` and those for ``validation`` into segments of ``length`` seconds.

    :raises hydraulic_sysid.estimation.errors.SegmentError: a record cannot be cut.
    """
    segments = _thinned(cut(records, kind, length) + cut(validation, kind, length))
    if validation:
        return Split(segments, [np.full(len(s), i < len(records)) for i, s in enumerate(segments)])
    # Shifted from record to record, so that not always the same phase of an experiment is for validation.
    return Split(segments, [_alternate(np.arange(len(s)), i) for i, s in enumerate(segments)])


def _thinned(segments: list[Segments]) -> list[Segments]:
    """One block in so many of each, where there are more than `MOST_VALUES`."""
    every = ceil(sum(s.measured.size for s in segments) / MOST_VALUES)
    return [s.subset(np.arange(len(s)) // BLOCK % every == 0) for s in segments] if every > 1 else segments


def _alternate(number: Index, shift: int) -> Mask:
    """Which segments of one record are for fitting; a record of very few is fitted whole."""
    if number.size >= EVERY * BLOCK:
        return (number // BLOCK + shift) % EVERY != EVERY - 1
    return number % EVERY != EVERY - 1 if number.size >= EVERY else np.ones(number.size, dtype=bool)
