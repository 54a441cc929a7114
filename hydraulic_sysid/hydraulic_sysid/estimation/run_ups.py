"""How long the inner states of a plant remember, along one record: from where they have to be propagated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask

Propagated = Callable[[Index, "int | None"], Array]
"""Inner states (S, n) at some samples (S,), after so many samples of run-up or from the beginning."""

SHORTEST = 32  # samples of run-up that are tried
_APART = 512  # samples between which inner states are compared
_SAME = 1e-3  # of the range of a state: off by less after a run-up, it is as from the beginning
_AMPLIFIED = 1e-4  # of that range: what a nudge changes by so much no propagation knows (a load that rattles in a gap)
_ALIKE = 4.0  # times larger or smaller are the values of plants that remember about as long
_FEWEST = 4  # samples at which it is looked: fewer show no range of a state, and such a record is short
_WORTH = 0.5  # of a record, beyond which run-ups to its segments save too little


def longest_worth(first: Index) -> int:
    """Samples of the longest run-up to segments at ``first`` (S,) that still saves much; 0: none does.

    `SHORTEST`, or that times a power of 2.
    """
    gaps, samples = np.diff(first, prepend=0), 0
    while np.minimum(gaps, max(2 * samples, SHORTEST)).sum() < _WORTH * first[-1]:
        samples = max(2 * samples, SHORTEST)
    return samples


def sufficient(length: int, propagated: Propagated, nudged: Propagated, least: int, most: int) -> int | None:
    """Samples of run-up after which a plant has forgotten what it began with; None where it has not after the ``most``.

    Tried are the ``least`` and its doubles, at samples of the record, of ``length``, that are at least twice as far
    apart: between those it would be propagated anyway. ``nudged`` is another plant that differs by nothing that is
    known.
    """
    starts = np.arange(_APART, length, _APART)
    if least > most or len(starts) < _FEWEST:
        return None
    whole = propagated(starts, None)
    ranges = np.ptp(whole, axis=0)
    vague: Mask | None = None
    samples = least
    while samples <= min(most, len(starts) * _APART // 2):
        every = max(2 * samples // _APART, 1)
        chosen = slice(every - 1, None, every)
        off = np.any(np.abs(propagated(starts[chosen], samples) - whole[chosen]) > _SAME * ranges, axis=1)
        if off.any() and vague is None:
            vague = np.any(np.abs(nudged(starts, None) - whole) > _AMPLIFIED * ranges, axis=1)
        if vague is None or not np.any(off & ~vague[chosen]):
            return samples
        samples *= 2
    return None


@dataclass(frozen=True)
class _Found:
    """For ``values`` (K,): ``samples`` that do, or None of those up to the ``most`` that were tried."""

    values: Array
    samples: int | None
    most: int

    def answers(self, values: Array, most: int) -> bool:
        """Whether it holds for these values, too, and says enough of run-ups up to the ``most``."""
        if self.samples is None and self.most < most:
            return False
        larger, smaller = (f(np.abs(self.values), np.abs(values)) for f in (np.maximum, np.minimum))
        return bool(np.all((np.sign(self.values) == np.sign(values)) & (larger <= _ALIKE * smaller)))


@dataclass
class RunUps:
    """The run-ups of one record that were found, by what a plant's memory hangs on: laws, and how many values each."""

    _known: dict[tuple[str | None, ...], list[_Found]] = field(default_factory=dict)

    def find(
        self, hangs_on: tuple[float | str, ...], most: int, seek: Callable[[int, int], int | None]
    ) -> int | None:
        """That of the first plant with the same laws whose values are like these, or else what ``seek`` finds.

        None where it is more than the ``most``. ``seek`` is told the shortest that is worth trying, by what is known
        of such laws with other values, and the ``most``.
        """
        laws = tuple(part if isinstance(part, str) else None for part in hangs_on)
        values = np.array([part for part in hangs_on if not isinstance(part, str)])
        known = self._known.setdefault(laws, [])
        found = next((one for one in list(known) if one.answers(values, most)), None)
        if found is None:
            least = min((one.samples or 2 * one.most for one in known), default=SHORTEST)
            found = _Found(values, seek(least, most), most)
            known.append(found)
        return found.samples if found.samples is not None and found.samples <= most else None
