"""Whether segments agree on what a model explains more than another: a statistic that holds for any noise.

Where little is left, the likelihood of a noise model that is not quite right makes chance look sure: rounding, hum and
a segment that begins badly are no white noise. Between segments all these are independent. So the size of what one
model explains more is taken from every segment, and its error from how far the segments differ (cluster-robust Wald
test; Liang & Zeger, Biometrika 73 (1986), with a segment as a cluster).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hydraulic_sim.arrays import Array, Mask

from .criteria import CRITERIA


def agreed(before: Sequence[Array], after: Sequence[Array], fit: Sequence[Mask]) -> bool:
    """Whether segments agree that there is something of what ``after`` explains more than ``before``.

    :param before: residuals over noise (S, m), per record
    :param after: the same of the other model
    :param fit: (S,) which segments were fitted, per record
    """
    return sure(*_in_segments(before, after), np.concatenate(list(fit)))


def sure(own: Array, size: Array, fitted: Mask, found: bool = True) -> bool:
    """The same of what `agreement` takes, of all segments.

    :param fitted: (S,) which were
    :param found: it is the best of many, fitted to them; else nothing was chosen, and chance has one try
    """
    confirmed = fitted.all() or agreement(own[~fitted], size[~fitted]) > CRITERIA.confirmed
    return bool(agreement(own[fitted], size[fitted]) > (CRITERIA.agreed if found else CRITERIA.confirmed) and confirmed)


def agreement(own: Array, size: Array) -> float:
    """Squared estimate of the share of a change that is there, over its variance.

    :param own: (S,) product of each segment's residual and the change
    :param size: (S,) sum of squares of the change
    """
    total = float(size.sum())
    if total <= 0.0:
        return 0.0
    share = float(own.sum()) / total
    spread = float(np.sum((own - share * size) ** 2))
    return (share * total) ** 2 / max(spread, np.finfo(float).tiny) if share > 0.0 else 0.0


def _in_segments(before: Sequence[Array], after: Sequence[Array]) -> tuple[Array, Array]:
    changes = [b - a for b, a in zip(before, after, strict=True)]
    own = [np.sum(c * b, axis=1) for c, b in zip(changes, before, strict=True)]
    return np.concatenate(own), np.concatenate([np.sum(c**2, axis=1) for c in changes])
