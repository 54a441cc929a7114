"""How well the parameters of a fitted model are known, when no model is exact.

The scores of pieces, and of whole records, are taken as independent clusters (Liang & Zeger, Biometrika 73 (1986));
the larger error of the two counts. What a record says of a parameter depends on its experiment where the law of an
effect is not quite the true one; the scatter between records then holds that too. What all records share of that
they cannot show: no law of a library is that of a bench to the last per cent, and an interval is never narrower (a
model discrepancy in the sense of Kennedy & O'Hagan, J. R. Statist. Soc. B 63 (2001), as a fixed share). The laws of
effects are the rougher ones; the search takes them to be right to a twentieth, too (`search.LAW`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from .anchor import Anchor, inner

Array = NDArray[np.floating]

_AT_BOUND = 1e-6
_LAW = 0.01  # of a parameter's value: standard error for the law that it stands in, of the base physics …
_EFFECT = 0.025  # … and of an effect
_COVERED = 0.95


@dataclass(frozen=True)
class Known:
    """Standard error and half width of the 95 % interval [SI]; infinite where the data do not tell."""

    standard_error: float
    half_width: float
    at_bound: str | None


def parameter_errors(anchor: Anchor) -> dict[str, Known]:
    """By key, of all parameters that were fitted. One at a bound counts as fixed there."""
    keys = anchor.keys
    stuck = {k: _bound(anchor, k) for k in keys}
    loose = [i for i, k in enumerate(keys) if stuck[k] is None]
    errors = np.full(len(keys), np.inf)
    widths = np.full(len(keys), np.inf)
    if loose:
        information = inner(anchor.split, anchor.beyond, anchor.beyond)[np.ix_(loose, loose)]
        inverse = np.linalg.pinv(information, rcond=1e-13, hermitian=True)
        by_record = []
        every = []
        for beyond, residual, chosen in zip(anchor.beyond, anchor.residual, anchor.split.fitted, strict=True):
            if chosen.any():
                scores = np.einsum("smp,sm->sp", beyond[chosen][..., loose], residual[chosen])
                every.append(scores)
                by_record.append(scores.sum(axis=0))
        pieces = _clustered(inverse, np.concatenate(every).astype(float))
        variance = np.maximum(pieces[0], np.diag(inverse))
        width = np.sqrt(variance) * pieces[1]
        if len(by_record) >= 3:
            records = _clustered(inverse, np.array(by_record, dtype=float))
            width = np.maximum(width, np.sqrt(records[0]) * records[1])
            variance = np.maximum(variance, records[0])
        errors[loose], widths[loose] = np.sqrt(variance), width
    found = {}
    for i, key in enumerate(keys):
        scale = anchor.scales[key]
        told = math.isfinite(errors[i]) and errors[i] < 1e3
        law = (_EFFECT if "." in key else _LAW) * abs(anchor.model.value(key))
        error = math.hypot(float(errors[i]) * scale, law) if told else math.inf
        width = float(widths[i]) * scale + 2.0 * law if told else math.inf
        found[key] = Known(error, width, stuck[key])
    return found


def _clustered(inverse: Array, scores: Array) -> tuple[Array, float]:
    """Variance (P,) from clusters' scores (S, P), and how many standard errors the interval is wide."""
    n = len(scores)
    if n < 2:
        return np.diag(inverse), 1.96
    centred = scores - scores.mean(axis=0)
    variance = np.diag(inverse @ (centred.T @ centred) @ inverse) * (n / (n - 1.0))
    return variance, float(student.ppf(0.5 + 0.5 * _COVERED, n - 1))


def _bound(anchor: Anchor, key: str) -> str | None:
    low, high = anchor.model.entry(key).bounds  # type: ignore[misc]
    near = _AT_BOUND * anchor.scales[key]
    value = anchor.model.value(key)
    return "lowest" if value - low <= near else "highest" if high - value <= near else None
