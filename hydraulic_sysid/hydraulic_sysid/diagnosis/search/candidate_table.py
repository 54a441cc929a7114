"""The candidates of a search while it goes on, with the probability of each that was refitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from .candidates import subsystem
from .misfit import Misfit
from .score_test import CandidateScore
from .search_state import CandidateRefit, SearchState

NOTHING = ""
"""The hypothesis that no candidate is missing."""


def probabilities(base: Misfit, refits: Sequence[tuple[str, int, Misfit]]) -> dict[str, float]:
    """Posterior probability of each candidate (name, number of parameters, misfit) and of `NOTHING`; equal priors.

    exp(−BIC/2), normalised (Schwarz, Ann. Stat. 6, 1978; Kass & Raftery, JASA 90, 1995): given that one of these is
    right, and with the variance that the best of them leaves. Where no law is quite the bench's, it is too sure.
    """
    every = [(NOTHING, 0, base), *refits]
    variance = min(misfit.variance for _, _, misfit in every)
    bic = {name: misfit.total / variance + count * math.log(max(misfit.count, 2)) for name, count, misfit in every}
    least = min(bic.values())
    weight = {name: math.exp(-0.5 * min(value - least, 1400.0)) for name, value in bic.items()}
    total = sum(weight.values())
    return {name: value / total for name, value in weight.items()}


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
