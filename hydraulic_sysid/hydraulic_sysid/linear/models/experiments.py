"""Checks and offsets that all fits share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_sim.arrays import Array
from hydraulic_sysid.linear.errors import IdentificationError

OFFSETS = ("estimate", "remove", "none")


def lengths_agree(drive: ArrayLike, output: ArrayLike) -> tuple[Array, Array]:
    """Input and output ``(N,)`` as float arrays.

    :raises IdentificationError: other shapes.
    """
    u, y = np.asarray(drive, dtype=float), np.asarray(output, dtype=float)
    if u.shape != y.shape or u.ndim != 1:
        raise IdentificationError(f"drive {u.shape} and output {y.shape} must be equal and one-dimensional")
    return u, y


def experiments(
    drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], offsets: str
) -> tuple[list[tuple[Array, Array]], float, float]:
    """Pairs of input and output without the offsets that are subtracted, and these offsets.

    :raises IdentificationError: no experiment, unequal lengths, values not finite, an unknown treatment of offsets.
    """
    if offsets not in OFFSETS:
        raise IdentificationError(f"offsets: {offsets!r} is none of {', '.join(OFFSETS)}")
    if len(drives) != len(outputs):
        raise IdentificationError(f"{len(drives)} drives for {len(outputs)} outputs")
    pairs = [lengths_agree(u, y) for u, y in zip(drives, outputs, strict=True)]
    if not pairs:
        raise IdentificationError("a model needs at least one experiment")
    for number, (u, y) in enumerate(pairs):
        if not (np.isfinite(u).all() and np.isfinite(y).all()):
            raise IdentificationError(f"experiment {number + 1}: values must be finite")
    if offsets != "remove":
        return pairs, 0.0, 0.0
    u0 = float(np.mean(np.concatenate([u for u, _ in pairs])))
    y0 = float(np.mean(np.concatenate([y for _, y in pairs])))
    return [(u - u0, y - y0) for u, y in pairs], u0, y0
