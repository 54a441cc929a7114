"""Initial states that segments were fitted with before: the next fit begins from there.

What a piston did at the beginning of a segment does not depend on the model, and a fitted model knows it better than a
noisy sensor. A fit that begins from what the record shows may end in another minimum, worse than that it came from.
"""

from __future__ import annotations

from collections.abc import Sequence

from hydraulic_sim.arrays import Array

from .segments import Segments


class KnownStarts:
    """By record and first sample: those states of a segment that are estimated.

    :param like: others, from which these begin
    """

    def __init__(self, like: KnownStarts | None = None) -> None:
        self._known: dict[tuple[str, float, int], Array] = {} if like is None else dict(like._known)

    def keep(self, segments: Sequence[Segments], initial_states: Sequence[Array]) -> None:
        """States (S_i, n_states) that segments of every record were fitted with."""
        for s, states in zip(segments, initial_states, strict=True):
            self._known.update(zip(_keys(s), states[:, s.free], strict=True))

    def of(self, segments: Sequence[Segments], otherwise: Sequence[Array]) -> list[Array]:
        """Initial states (S_i, n_states) of segments: what is known of them, and ``otherwise`` the rest."""
        found = []
        for s, states in zip(segments, otherwise, strict=True):
            new = states.copy()
            for row, key in enumerate(_keys(s)):
                if key in self._known:
                    new[row, s.free] = self._known[key]
            found.append(new)
        return found


def _keys(segments: Segments) -> list[tuple[str, float, int]]:
    """Segments may begin at one sample and be of another length; a slowed record has other samples."""
    record = segments.record
    return [(record.name, record.dt, first) for first in segments.first.tolist()]
