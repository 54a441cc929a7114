"""How probable each explanation is: what the search compared, and that the library holds no law that is right.

Posterior odds are prior odds times a Bayes factor (Kass & Raftery, JASA 90 (1995) 773). The factor between two models
is a power of the difference of their sums of squares, tempered by what no law is right to (`competing_models`), and the
odds of an unknown law grow with what is left beyond the noise (`unknown_law`). How often such probabilities are right
is measured (diagnosis-matrix.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .criteria import CRITERIA, Criteria
from .remainder import immaterial
from .search_state import SearchResult
from .unknown_law import probability_of_unknown
from .verdict import (
    COMPLETE,
    DATA_SHEET,
    INDISTINGUISHABLE,
    MISSING,
    OUTSIDE,
    RECORDING,
    UNDECIDED,
    Verdict,
    decisive_drift,
)

What = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
"""Effects, numbers of the data sheet and faults of the recording."""


@dataclass(frozen=True)
class Explanation:
    """Effects that are missing, numbers of the data sheet that are wrong, faults of the recording; and how probable.

    ``named``: whether the verdict says it. Without ``library`` it is that no law of the library is right.
    """

    probability: float
    named: bool
    effects: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    library: bool = True


def explanations(result: SearchResult, verdict: Verdict, criteria: Criteria = CRITERIA) -> list[Explanation]:
    """All that was compared, the most probable first; the probabilities add up to 1.

    Nothing where these do not say what is right: the search was ended before it was done, an effect was named by the
    force it asks for, or what is left is more than noise but nothing to anybody (then the verdict says how much).
    """
    final = result.final.misfit
    settled = verdict.kind in (COMPLETE, DATA_SHEET, RECORDING)
    moot = settled and not final.little and immaterial(final, result.remainders)
    if verdict.kind == UNDECIDED or result.by_force is not None or moot:
        return []
    unknown = probability_of_unknown(result.before_laws, final, criteria)
    if verdict.kind == OUTSIDE:
        # Not by what is left alone: a drift, a sine, a law bent to its limits. What is said is no less probable than
        # all else.
        by_time = verdict.periodic or decisive_drift(result) is not None
        unknown = max(unknown, criteria.odds / (1.0 + criteria.odds) if by_time else 0.5)
    elif verdict.kind in (MISSING, INDISTINGUISHABLE):
        unknown = min(unknown, 0.5)
    known = _known(result, verdict)
    share = (1.0 - unknown) / sum(weight for weight, _ in known.values())
    found = [
        Explanation(share * weight, named and verdict.kind != OUTSIDE, *what) for what, (weight, named) in known.items()
    ]
    none = Explanation(unknown, verdict.kind == OUTSIDE, library=False)
    return sorted([*found, none], key=lambda e: -e.probability)


def probability(found: Sequence[Explanation]) -> float | None:
    """That a verdict is right: that of all explanations that it names; None where there are none."""
    return min(sum(e.probability for e in found if e.named), 1.0) if found else None


def sentence(found: Sequence[Explanation]) -> str:
    """What a verdict ends with; empty where there is no probability."""
    said = probability(found)
    if said is None:
        return ""
    shown = f"over {100.0 * CRITERIA.surest:.0f} %" if said > CRITERIA.surest else f"{100.0 * said:.0f} %"
    return f"The probability of this verdict is {shown}."


def _known(result: SearchResult, verdict: Verdict) -> dict[What, tuple[float, bool]]:
    """What the library, the data sheet and the recording have to say: its odds against what was found, and if named."""
    effects, numbers = tuple(result.added), tuple(d.key for d in result.moved)
    faults = tuple(f.hypothesis.name for f in result.faults)
    found: dict[What, tuple[float, bool]] = {(effects, numbers, faults): (1.0, True)}
    tie = verdict.kind == INDISTINGUISHABLE
    for name in effects:
        rivals = {c.name: (1.0 / c.odds, tie and not c.distinguishable) for c in verdict.competing.get(name, ())}
        for other, said in {**rivals, **dict.fromkeys(verdict.family.get(name, ()), (1.0, tie))}.items():
            found.setdefault((tuple(other if e == name else e for e in effects), numbers, faults), said)
    for fault in result.faults_instead:
        found.setdefault(((), numbers, (*faults, fault.hypothesis.name)), (1.0, tie))
    several = result.together_instead
    if several.faults:
        keys, names = tuple(d.key for d in several.numbers), tuple(f.hypothesis.name for f in several.faults)
        found.setdefault((effects[:-1], keys, names), (1.0, tie))
    for fault in result.faults:
        rest = tuple(name for name in faults if name != fault.hypothesis.name)
        for gain in fault.alternatives:
            found.setdefault((effects, numbers, (*rest, gain.hypothesis.name)), (1.0, True))
        for effect in fault.instead:
            found.setdefault(((*effects, effect), numbers, rest), (1.0, True))
    for d in result.moved:
        rest = tuple(key for key in numbers if key != d.key)
        for number in d.alternatives:
            found.setdefault((effects, (*rest, number.key), faults), (1.0, True))
        for effect in d.instead:
            found.setdefault(((*effects, effect), rest, faults), (1.0, True))
    if result.numbers_instead:
        others = (*numbers, *(d.key for d in result.numbers_instead))
        found.setdefault((effects[:-1], others, faults), (1.0 / CRITERIA.odds, False))
    return found
