"""A designed experiment as a result document (docs/report-json.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.display import listed, number
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.simulated_run import SimulatedRun

from .movement_search import JudgedMovement, MovementSearch
from .movements import FAMILIES
from .reference import MARGIN, Played
from .verify import CrossFit

CLEAR = 5.0  # mean over standard deviation of the difference of two sums of squares, from which noise cannot decide
_FAINT = 2.0
_SHOWN = ("position", "velocity", "pressure_a", "pressure_b")
_POINTS = 1000


@dataclass(frozen=True)
class Design:
    """All that a document is made of."""

    models: Mapping[str, Model]
    search: MovementSearch
    candidates: Sequence[JudgedMovement]
    chosen: Sequence[JudgedMovement]
    played: Played
    plan: Plan
    seen: Sequence[SimulatedRun]
    limited_by: str
    refits: Sequence[CrossFit]

    def name(self, point: int) -> str:
        """Name of a model by its number."""
        return self.search.points[point].name


def document(design: Design) -> dict[str, Any]:
    """The document; arrays NumPy, SI."""
    plan, search = design.plan, design.search
    assert plan.prediction is not None
    return {
        **heading("next_experiment", 2),
        "verdict": _verdict(design),
        "title": f"Next experiment: {_or(list(design.models))}?",
        "competing_models": [
            {"name": name, "model": model.name, "path": None if model.path is None else str(model.path),
             "effects": list(model.effects), "fitted": list(search.points[i].parameters.keys)}
            for i, (name, model) in enumerate(design.models.items())
        ],
        "settings": {
            "seconds": plan.active_time, "rate": search.bench.rate, "centre": search.bench.centre,
            "segment_length": search.length, "margin": 1.0 - MARGIN, "decisive_separation": CLEAR,
        },
        "noise_std": dict(search.noise),
        "limits": asdict(search.limits),
        "file": None,
        "plan": {k: v for k, v in plan.as_mapping().items() if k != "prediction"},
        "prediction": plan.prediction.as_mapping(),
        "movements": [
            {"kind": c.movement.kind, "description": c.movement.family.words, "parameters": dict(c.movement.numbers),
             "start": plan.signal_start + begin / search.bench.rate}
            for c, begin in zip(design.chosen, design.played.begins, strict=True)
        ],
        "pairs": [_pair(design, r) for r in design.refits],
        "compared_experiments": _compared(design),
        "traces": {
            "drive": _traced(design.seen[0], "drive"),
            **{
                c: {name: _traced(s, c) for name, s in zip(design.models, design.seen, strict=True)}
                for c in _SHOWN
                if search.points[0].model.kind == "hydraulic" or not c.startswith("pressure")
            },
        },
    }  # fmt: skip


def _pair(design: Design, refit: CrossFit) -> dict[str, Any]:
    """One model refitted to what another does."""
    t, r = refit.pair
    model = design.search.points[r].model
    since = design.plan.signal_start
    return {
        "true": design.name(t),
        "refitted": design.name(r),
        "chi_square": refit.left,
        "separation": refit.separation,
        "misclassification_probability": refit.misclassification,
        "seconds_needed": _seconds(design, refit),
        "rms": float(np.sqrt(np.mean(refit.series**2))),
        "converged": refit.converged,
        "channel_shares": refit.channel_shares,
        "parameters": [
            {"key": k, "unit": model.parameter(k).unit, "before": model.value(k), "after": v}
            for k, v in refit.values.items()
        ],
        "differences": {
            c: trace(since + refit.times, refit.series[:, i], _POINTS) for i, c in enumerate(refit.channels)
        },
    }


def _compared(design: Design) -> list[dict[str, Any]]:
    """The best of every kind of movement, repeated over the same time: the least separation of all pairs, best first.

    By the sensitivities at the models' parameters; ``chosen`` is the sequence by the same measure.
    """
    places, points = len(design.chosen), design.search.points
    sequence = design.chosen[0].evidence
    for other in design.chosen[1:]:
        sequence = sequence + other.evidence
    best = _least(design, sequence.left(points), 1)
    rows = [{"kind": "chosen", "description": "the sequence chosen", "parameters": {}, **best}]
    for kind, family in FAMILIES.items():
        found = [
            {"kind": kind, "description": family.words, "parameters": dict(c.movement.numbers),
             **_least(design, c.evidence.left(points), places)}
            for c in design.candidates
            if c.movement.kind == kind
        ]  # fmt: skip
        if found:
            rows.append(max(found, key=lambda row: row["separation"]))
    return [rows[0], *sorted(rows[1:], key=lambda row: -row["separation"])]


def _least(design: Design, left: Mapping[tuple[int, int], float], times: int) -> dict[str, Any]:
    pair = min(left, key=lambda p: left[p])
    return {
        "separation": 0.5 * float(np.sqrt(times * left[pair])),
        "true": design.name(pair[0]),
        "refitted": design.name(pair[1]),
    }


def _seconds(design: Design, refit: CrossFit) -> float:
    """How long the experiment must be repeated until the separation is clear [s]."""
    return design.plan.active_time * CLEAR**2 / refit.separation**2 if refit.separation > 0.0 else float("inf")


def _verdict(design: Design) -> dict[str, str]:
    worst = min(design.refits, key=lambda r: r.left)
    t, r = (design.name(i) for i in worst.pair)
    seconds = design.plan.active_time
    last = (
        f"the closest two are {t} (true) and {r} (refitted)"
        if len(design.models) > 2
        else (f"the harder way round is {r} refitted to {t}")
    )
    level = "explained" if worst.separation >= CLEAR else "close" if worst.separation >= _FAINT else "off"
    apart = f"{number(worst.separation)} standard deviations of the noise apart after every refit ({last})"
    what = f"{number(seconds)} s of {listed(list(dict.fromkeys(c.movement.family.words for c in design.chosen)))}"
    if level == "explained":
        text = f"{what} distinguish{'es' if ' and ' not in what else ''} {listed(list(design.models))}: {apart}."
    elif level == "close":
        text = f"{what} hint at which of {_or(list(design.models))} it is: {apart}; about " + (
            f"{number(_seconds(design, worst))} s of it decide."
        )
    else:
        text = (
            f"No experiment within the limits was found that distinguishes {_or(list(design.models))} with these "
            f"channels in {number(seconds)} s: at best they are {apart}."
        )
    return {"level": level, "text": text[:1].upper() + text[1:]}


def _traced(seen: SimulatedRun, channel: str) -> dict[str, Any]:
    return trace(seen.record.time, seen.record[channel], _POINTS)


def _or(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}"
