"""How long the inner states of a plant remember, along one record: from where they have to be propagated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.plant import LONGEST_MEMORY

Propagated = Callable[[Index, "int | None"], Array]
"""Inner states and memories (S, …) at some samples (S,), after so many samples of run-up or from the beginning."""

_SAME = 1e-3  # of the range of a state: off by less after a run-up, it is as from the beginning
_AMPLIFIED = 1e-4  # of that range: what a nudge changes by so much no propagation knows (a load that rattles in a gap)
_ALIKE = 4.0  # times larger or smaller are the values of plants that remember about as long


def sufficient(length: int, propagated: Propagated, nudged: Propagated, least: int = LONGEST_MEMORY) -> int | None:
    """Samples of run-up after which a plant has forgotten what it began with; None where it does not.

    Tried are the ``least`` (a power of 2 times `LONGEST_MEMORY`) and its doubles, at samples of the record, of
    ``length``, that are twice as far apart: between those it would be propagated anyway. ``nudged`` is another plant
    that differs by nothing that is known.
    """
    starts = np.arange(2 * LONGEST_MEMORY, length, 2 * LONGEST_MEMORY)
    if not len(starts):
        return None
    whole = propagated(starts, None)
    ranges = np.ptp(whole, axis=0)
    vague: Mask | None = None
    every = least // LONGEST_MEMORY
    while every <= len(starts):
        chosen, samples = slice(every - 1, None, every), every * LONGEST_MEMORY
        off = np.any(np.abs(propagated(starts[chosen], samples) - whole[chosen]) > _SAME * ranges, axis=1)
        if off.any() and vague is None:
            vague = np.any(np.abs(nudged(starts, None) - whole) > _AMPLIFIED * ranges, axis=1)
        if vague is None or not np.any(off & ~vague[chosen]):
            return samples
        every *= 2
    return None


@dataclass
class RunUps:
    """The run-ups of one record that were found, by what a plant's memory hangs on."""

    _known: dict[tuple[str, ...], list[tuple[Array, int | None]]] = field(default_factory=dict)

    def find(self, hangs_on: tuple[float | str, ...], seek: Callable[[int], int | None]) -> int | None:
        """That of the first plant with the same laws whose values are like these, or else what ``seek`` finds.

        It is told what has done for such laws with other values, the shortest: shorter ones need not be tried.
        """
        names = tuple(part for part in hangs_on if isinstance(part, str))
        values = np.array([part for part in hangs_on if not isinstance(part, str)])
        known = self._known.setdefault(names, [])
        for others, found in list(known):
            larger, smaller = np.maximum(abs(others), abs(values)), np.minimum(abs(others), abs(values))
            if np.all((np.sign(others) == np.sign(values)) & (larger <= _ALIKE * smaller)):
                return found
        found = seek(min((n for _, n in known if n is not None), default=LONGEST_MEMORY))
        known.append((values, found))
        return found
