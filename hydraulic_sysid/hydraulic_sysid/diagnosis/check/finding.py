"""What a check has found: one number of the model file, or one channel, against what the records show."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from hydraulic_sim.model import Model

CONTRADICTION, DOUBTFUL, NOT_IDENTIFIABLE, NOTE = SEVERITIES = ("contradiction", "doubtful", "not identifiable", "note")
"""From what no fit mends to what is only worth knowing."""

FACTOR = math.sqrt(2.0)  # that a number may be off where its file gives no bounds: half of what a fit may move it by
LEAST = 0.05  # of a number: narrower bounds than that do not make a contradiction


@dataclass(frozen=True)
class Finding:
    """One finding. ``subject``: key or channel; ``measured`` and ``stated`` (by the file) in ``unit``.

    ``kind``: one word of its own for every check; ``records``: names of those that show it; ``remedy``: what to do.
    """

    kind: str
    subject: str
    severity: str
    text: str
    remedy: str
    measured: float | None = None
    stated: float | None = None
    unit: str = "1"
    records: tuple[str, ...] = ()


def merged(findings: Iterable[Finding]) -> list[Finding]:
    """One finding of each kind and subject, the worst of them with the names of all records; the worst first."""
    found: dict[tuple[str, str], Finding] = {}
    for one in findings:
        key = (one.kind, one.subject)
        if key in found:
            worse = min(found[key], one, key=rank)
            one = replace(worse, records=tuple(dict.fromkeys(found[key].records + one.records)))
        found[key] = one
    return sorted(found.values(), key=rank)


def rank(finding: Finding) -> int:
    """Place of its severity, 0 being the worst."""
    return SEVERITIES.index(finding.severity)


def excess(model: Model, key: str, measured: float) -> float:
    """How far beyond its bounds a positive number was measured: 1 at a bound, 2 at twice its distance (of logarithms).

    Without bounds in the file those are `FACTOR` to either side.
    """
    stated, own = model.value(key), model.entries.get(key)
    bounds = (own.bounds if own else None) or (stated / FACTOR, stated * FACTOR)
    if measured <= 0.0 or stated <= 0.0:
        return math.inf
    off = math.log(measured / stated)
    bound = max(bounds[0] if off < 0.0 else bounds[1], 1e-12 * stated)
    return abs(off) / max(abs(math.log(bound / stated)), LEAST)


def by_bounds(model: Model, key: str, measured: float) -> str | None:
    """A contradiction beyond twice the bounds, doubtful beyond them, None within."""
    beyond = excess(model, key, measured)
    return CONTRADICTION if beyond > 2.0 else DOUBTFUL if beyond > 1.0 else None


def by_share(off: float, doubtful: float, contradiction: float) -> str | None:
    """By a relative deviation: beyond these shares."""
    return CONTRADICTION if abs(off) > contradiction else DOUBTFUL if abs(off) > doubtful else None
