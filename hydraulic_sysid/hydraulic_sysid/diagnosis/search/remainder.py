"""What a model leaves, in the units of the sensors and of the motion: whether it matters to anybody."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array

from .criteria import CRITERIA
from .holdout import Split
from .misfit import Misfit


@dataclass(frozen=True)
class Remainder:
    """Of one channel, root mean squares [SI]: ``beyond`` the noise, of the noise and of the motion within segments."""

    channel: str
    beyond: float
    noise: float
    motion: float

    @property
    def share(self) -> float:
        """Of the motion."""
        return self.beyond / self.motion if self.motion > 0.0 else 0.0


@dataclass(frozen=True)
class Spikes:
    """Samples of a channel that stand alone, far off the noise: how many, and where the first ones are."""

    channel: str
    count: int
    share: float
    places: list[tuple[str, float]]


def remainders(split: Split, residual: Sequence[Array]) -> list[Remainder]:
    """Per channel, over all records, of whitened residuals (S, m) each."""
    squares = {c: np.zeros(3) for c in split.channels}
    count = dict.fromkeys(squares, 0)
    for segments, own in zip(split.segments, residual, strict=True):
        left = segments.in_units(np.asarray(own))
        moved = segments.measured - segments.measured.mean(axis=1, keepdims=True)
        for c, channel in enumerate(segments.channels):
            kept = ~segments.outliers[:, :, c]
            noise = float(segments.noise_std[c]) * segments.loudness[:, c]
            sums = [np.sum(left[..., c][kept] ** 2), noise**2 @ kept.sum(axis=1), np.sum(moved[..., c][kept] ** 2)]
            squares[channel] += sums
            count[channel] += int(kept.sum())
    found = []
    for channel, (left2, noise2, motion2) in squares.items():
        number = max(count[channel], 1)
        beyond = max(left2 - noise2, 0.0)
        found.append(Remainder(channel, *(float(np.sqrt(s / number)) for s in (beyond, noise2, motion2))))
    return found


def negligible(found: list[Remainder], share: float) -> bool:
    """Whether what is left is below a ``share`` of the motion."""
    return bool(found) and all(r.share < share for r in found)


def immaterial(misfit: Misfit, found: list[Remainder]) -> bool:
    """Whether what is left is nothing to anybody, and not far off the noise or less than any law is right to."""
    return negligible(found, CRITERIA.negligible if misfit.usual <= CRITERIA.small else CRITERIA.immaterial)


def spikes(split: Split) -> list[Spikes]:
    """Per channel that has some."""
    found = []
    for channel in split.channels:
        places, total = list[tuple[str, float]](), 0
        for s in split.segments:
            if channel in s.channels:
                out = s.outliers[:, :, s.channels.index(channel)]
                total += out.size
                rows, columns = np.nonzero(out)
                index = np.unique(s.first[rows] + columns)
                places += [(s.record.name, float(s.record.time[i])) for i in index]
        if places:
            found.append(Spikes(channel, len(places), len(places) / total, places))
    return found
