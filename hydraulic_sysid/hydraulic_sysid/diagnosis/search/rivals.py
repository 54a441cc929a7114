"""What else could be meant: rivals of an effect, and whether these data tell them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant

from .anchor import Anchor, inner, project
from .levels import Level
from .search import Stage, Trial

Array = NDArray[np.float64]

DISTINCT = 30.0  # difference of the sums of squares, of the variance, that tells two models apart …
LAW = 0.05  # … beside this share of what the better one leaves: no law is quite that of the bench


@dataclass(frozen=True)
class Rival:
    """An effect that was tried in another's place. ``told_apart``: whether the data decide against it.

    ``collinearity``: cosine between what the two change in the residuals beyond all free parameters; 1: the same.
    """

    name: str
    level: Level
    margin: float
    told_apart: bool
    collinearity: float


def rivals(name: str, without: Stage, final: Level, most: int = 5) -> list[Rival]:
    """The rivals of ``name``, whose place in the fitted model is empty in ``without``; the closest first."""
    own = next((t for t in without.trials if t.name == name), None)
    found = []
    for trial in sorted((t for t in without.trials if t.name != name), key=lambda t: t.level.total)[:most]:
        margin = trial.level.total - final.total
        needed = DISTINCT * final.variance + LAW * final.excess
        found.append(Rival(trial.name, trial.level, margin, margin > needed, _collinearity(without.anchor, own, trial)))
    return found


def _collinearity(anchor: Anchor, one: Trial | None, other: Trial) -> float:
    if one is None:
        return float("nan")
    a, b = (_direction(anchor, t) for t in (one, other))
    if a is None or b is None:
        return float("nan")
    columns = [np.stack([x, y], axis=-1) for x, y in zip(a, b, strict=True)]
    information = inner(anchor.split, columns, columns)
    if anchor.keys:
        cross = inner(anchor.split, anchor.beyond, columns)
        information = information - cross.T @ np.linalg.pinv(anchor.information, rcond=1e-12, hermitian=True) @ cross
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    return float(np.clip(abs(information[0, 1]) / (size[0] * size[1]), 0.0, 1.0))


def _direction(anchor: Anchor, trial: Trial) -> list[Array] | None:
    """What the effect at its fitted size changes in the residuals, all else being as it is."""
    model = trial.refit.model
    values = {**anchor.values, **{k: model.value(k) for k in trial.refit.added}}
    try:
        raw = anchor.shooting.run(Plant(model).with_parameters(values))
    except SimulationError:
        return None
    changed = [r - lin.raw for r, lin in zip(raw, anchor.linear, strict=True)]
    return [c[..., 0] for c in project(anchor.linear, [c[..., None] for c in changed])]
