"""The candidates of a search while it goes on, with the probability of each that was refitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .candidates import subsystem
from .competing_models import odds
from .misfit import Misfit
from .score_test import CandidateScore
from .search_state import CandidateRefit, SearchState
from .unknown_law import probability_of_unknown

NOTHING = ""
"""The hypothesis that no candidate is missing."""
UNKNOWN = "?"
"""The hypothesis that a law is missing that the library lacks."""


def probabilities(base: Misfit, refits: Sequence[tuple[str, int, Misfit]]) -> dict[str, float]:
    """Probability of each candidate (name, number of parameters, misfit), `NOTHING` and `UNKNOWN`, in mid-search.

    By the odds of which those of a verdict are made too: between models (`competing_models.odds`; each parameter costs
    what BIC gives it, Schwarz, Ann. Stat. 6 (1978) 461) and against an unknown law (`probability_of_unknown`).
    """
    every = [(NOTHING, 0, base), *refits]
    best = min((misfit for _, _, misfit in every), key=lambda m: m.total)
    left = {name: misfit.total + count * best.freedom for name, count, misfit in every}
    least = min(left.values())
    weight = {name: 1.0 / odds(best, value - least) for name, value in left.items()}
    unknown = probability_of_unknown(base, best)
    share = (1.0 - unknown) / sum(weight.values())
    return {UNKNOWN: unknown, **{name: share * value for name, value in weight.items()}}


def candidate_table(
    base: SearchState, scores: Sequence[CandidateScore], refits: Sequence[CandidateRefit], added: Sequence[str]
) -> list[dict[str, Any]]:
    """Refitted candidates by what they leave, then the others by what the score test predicts of them."""
    sizes = [(r.name, len(base.model.library[r.name].parameters), r.misfit) for r in refits]
    likely = probabilities(base.misfit, sizes)
    promised = {s.effect.name: _share(base.misfit, s.reduction) for s in scores}
    before = base.misfit.rms_validation
    rows = [
        {"name": r.name, "subsystem": subsystem(base.model.library[r.name]), "stage": "refitted",
         "predicted": promised.get(r.name), "residual_before": before, "residual_after": r.misfit.rms_validation,
         "probability": likely[r.name], "with": list(added)}
        for r in sorted(refits, key=lambda r: r.misfit.total)
    ]  # fmt: skip
    done = {row["name"] for row in rows}
    return rows + [
        {"name": s.effect.name, "subsystem": subsystem(s.effect), "stage": "scored",
         "predicted": promised[s.effect.name], "residual_before": before, "residual_after": None,
         "probability": None, "with": list(added)}
        for s in sorted(scores, key=lambda s: -s.reduction)
        if s.effect.name not in done
    ]  # fmt: skip


def _share(misfit: Misfit, reduction: float) -> float:
    """Of what noise does not explain on the segments for fitting (0…1)."""
    beyond = max(misfit.fit - misfit.n_fit, 1e-9 * misfit.fit)
    return min(max(reduction, 0.0) / beyond, 1.0)
