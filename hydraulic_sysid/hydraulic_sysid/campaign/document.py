"""The result document of a campaign: cases, matrix, distributions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from hydraulic_sysid.campaign.outcome import CASES, Outcome
from hydraulic_sysid.data.results import heading

ANSWERS = ("verdict.kind", "verdict.level")
"""Columns that say in a word what a verb has come to, the first that there is."""
SHOWN = 6
"""Distributions on a page where none were asked for."""
_COSTS = ("seconds", "peak_mib")


def document(verb: str, outcomes: Sequence[Outcome], crew: str, seconds: float, asked: Sequence[str]) -> dict[str, Any]:
    """Result of a campaign.

    ``asked`` names the columns whose distributions are shown; without, those that differ most between the cases.
    """
    done = [o for o in outcomes if not o.failed]
    answers = Counter(answer_of(o) for o in outcomes).most_common()
    numbers = _numeric(done)
    chosen = [name for name in asked if name in numbers] or _telling(numbers)
    return {
        **heading("campaign"),
        "title": f"Campaign: {verb}",
        "verb": verb,
        "workers": crew,
        "seconds": seconds,
        "count": {"cases": len(outcomes), "done": len(done), "failed": len(outcomes) - len(done)},
        "verdict": _verdict(outcomes),
        "answers": [{"answer": answer, "count": count} for answer, count in answers],
        "cases": [
            {**o.labels, "state": o.state, "answer": answer_of(o), "error": o.error.strip().rpartition("\n")[2],
             "seconds": o.seconds, "page": f"{CASES}/{o.key}/report.html", "figures": {n: o.row.get(n) for n in chosen}}
            for o in outcomes
        ],
        "distributions": {name: numbers[name] for name in chosen}
        | {name: [getattr(o, name) for o in done] for name in _COSTS},
    }  # fmt: skip


def _verdict(outcomes: Sequence[Outcome]) -> dict[str, str]:
    failed = sum(o.failed for o in outcomes)
    if failed:
        return {"level": "off", "text": f"{failed} of {len(outcomes)} cases failed; the table says why."}
    return {"level": "explained", "text": f"All {len(outcomes)} cases have a result."}


def answer_of(outcome: Outcome) -> str:
    """What a case has come to, in a word: the verdict and what it names, or "failed"."""
    if outcome.failed:
        return "failed"
    said = next((str(outcome.row[name]) for name in ANSWERS if outcome.row.get(name)), "done")
    named = outcome.row.get("verdict.effects")
    return f"{said}: {named}" if named else said


def _numeric(done: Sequence[Outcome]) -> dict[str, list[float]]:
    """Columns of numbers, those of the cases that have one."""
    found: dict[str, list[float]] = {}
    for outcome in done:
        for name, value in outcome.row.items():
            if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
                found.setdefault(name, []).append(float(value))
    return found


def _telling(numbers: dict[str, list[float]]) -> list[str]:
    """The columns that most cases have and that vary most, for their size."""
    most = max((len(v) for v in numbers.values()), default=0)
    spread = {name: _spread(found) for name, found in numbers.items() if len(found) == most and name != "exit_code"}
    return sorted((name for name in spread if spread[name] > 0.0), key=lambda name: -spread[name])[:SHOWN]


def _spread(found: list[float]) -> float:
    size = sum(abs(v) for v in found) / len(found)
    mean = sum(found) / len(found)
    return math.sqrt(sum((v - mean) ** 2 for v in found) / len(found)) / size if size else 0.0
