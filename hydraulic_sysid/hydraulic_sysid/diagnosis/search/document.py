"""Every figure of a diagnosis in one document (see docs/report-json.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.diagnosis.compare.document import model_document
from hydraulic_sysid.estimation.estimate import Settings

from . import verdict
from .candidates import subsystem
from .curves import curves
from .levels import Level
from .pieces import EVERY, STRETCH, Split
from .rivals import Rival
from .search import Found
from .shape import Shape
from .uncertainty import Known

_NEAREST = 3
_TELLING = 0.5  # share of what is left, from which a curve says where it is


def document(
    model: Model, records: Sequence[Record], held_out: Sequence[Record], parts: Split, settings: Settings,
    found: Found, rivals: Mapping[str, Sequence[Rival]], family: Mapping[str, Sequence[str]],
    known: Mapping[str, Known], kind: str, shapes: Sequence[Shape],
) -> dict[str, Any]:  # fmt: skip
    """The document, still without balances (`add_balances`); arrays NumPy, SI. ``family``: see `verdict.alike`."""
    base, final = found.base, found.final
    channels = list(dict.fromkeys(c for p in parts.pieces for c in p.channels))
    named = _named(found, rivals, kind, family)
    imitations = verdict.imitated([*records, *held_out])
    effects = _effects(found, rivals, known)
    levels = {"explained": final.level.variance <= 1.0 + 2.0 * verdict.UNSEEN, "off": kind == verdict.OUTSIDE}
    return {
        **heading("diagnose", 2),
        "model": model_document(model),
        "settings": {
            "segment_length": settings.length,
            "validation_block": STRETCH,
            "validation_every": None if held_out else EVERY,
        },
        "records": [
            {
                "name": r.name,
                "source": str(r.source),
                "duration": r.duration,
                "samples": len(r),
                "role": "validation" if any(r is h for h in held_out) else "fit",
            }
            for r in (*records, *held_out)
        ],  # fmt: skip
        "channels": channels,
        "noise_std": _noise(parts),
        "verdict": {
            "kind": kind,
            "level": "explained" if levels["explained"] else "off" if levels["off"] else "close",
            "effects": named,
            "subsystem": _subsystem(found, kind, shapes),
            "text": verdict.sentences(found, rivals, kind, shapes, family) + verdict.warning(named, imitations),
            "imitated": imitations,
        },
        "residual": {
            "unit": "residual over noise",
            "before": _level(base.level),
            "after": _level(final.level),
            "after_each_effect": [{"name": name, **_level(at)} for name, at in found.steps],
        },
        "effects": effects,
        "competing_models": {
            name: [
                {
                    "name": r.name,
                    "residual_after": r.level.rms_held_out,
                    "chi_square_difference": r.margin,
                    "distinguishable": r.told_apart,
                    "collinearity": r.collinearity,
                }
                for r in every
            ]
            for name, every in rivals.items()
        },
        "parameters": _parameters(final.model, known, [k for k in final.anchor.keys]),
        "unexplained_share": verdict.left_over(found),
        "nonparametric_curves": [_shape(s) for s in shapes],
        "nearest_effects": [t.name for t in final.trials[:_NEAREST]] if kind == verdict.OUTSIDE else [],
        "balances": [],
        "worst_segments": curves(parts, base, final),
    }


def added_document(
    model: Model, records: Sequence[Record], held_out: Sequence[Record], parts: Split, settings: Settings,
    found: Found, known: Mapping[str, Known], confirmed: bool,
) -> dict[str, Any]:  # fmt: skip
    """The document of one effect added on request: the same keys, as far as they apply."""
    whole = document(model, records, held_out, parts, settings, found, {}, {}, known, verdict.MISSING, ())
    before, after = found.base.level.rms_held_out, found.final.level.rms_held_out
    name = found.added[0]
    whole |= heading("add", 2)
    whole["verdict"] |= {
        "kind": "confirmed" if confirmed else "not confirmed",
        "level": whole["verdict"]["level"] if confirmed else "off",
        "text": f"With {name} the residual on held-out data goes from {before:.4g} to {after:.4g} times the noise"
        + ("." if confirmed else ": no more than chance or fitting gives; the data do not bear it out."),
    }
    for key in ("competing_models", "nonparametric_curves", "nearest_effects", "balances"):
        del whole[key]
    return whole


def _level(at: Level) -> dict[str, float]:
    return {"fit": at.rms_fitted, "validation": at.rms_held_out}


def _named(
    found: Found, rivals: Mapping[str, Sequence[Rival]], kind: str, family: Mapping[str, Sequence[str]]
) -> list[str]:
    names = list(found.added)
    if kind == verdict.TIED:
        names += [other for name in found.added for other in verdict.same_as(name, rivals, family)]
    return list(dict.fromkeys(names))


def _effects(found: Found, rivals: Mapping[str, Sequence[Rival]], known: Mapping[str, Known]) -> list[dict[str, Any]]:
    """All that was tried, ranked: what was found, then what could stand in its place, then the rest of the library."""
    library = found.base.model.library
    rows: list[dict[str, Any]] = []
    previous = found.base.level
    for name, at in found.steps:
        rows.append(_row(name, library, True, previous, at, found.final.model, known))
        previous = at
    done = set(found.added)
    for every in rivals.values():
        for r in every:
            if r.name not in done:
                done.add(r.name)
                trial = next(t for s in found.rivals.values() for t in s.trials if t.name == r.name)
                rows.append(_row(r.name, library, False, found.base.level, r.level, trial.refit.model, {}))
    for trial in found.base.trials:
        if trial.name not in done:
            done.add(trial.name)
            rows.append(_row(trial.name, library, False, found.base.level, trial.level, trial.refit.model, {}))
    count = max(found.base.level.n_fitted, 1)
    for prospect in found.base.prospects:
        if prospect.effect.name not in done:
            done.add(prospect.effect.name)
            left = max(found.base.level.fitted - max(prospect.gain, 0.0), 0.0)
            rows.append(
                {
                    "name": prospect.effect.name,
                    "subsystem": subsystem(prospect.effect),
                    "added": False,
                    "refitted": False,
                    "residual_before": found.base.level.rms_fitted,
                    "residual_after": math.sqrt(left / count),
                    "parameters": [],
                }
            )
    return [{"rank": i + 1, **row} for i, row in enumerate(rows)]


def _row(
    name: str, library: Any, found: bool, before: Level, after: Level, model: Model, known: Mapping[str, Known]
) -> dict[str, Any]:
    effect = library[name]
    return {
        "name": name,
        "subsystem": subsystem(effect),
        "added": found,
        "refitted": True,
        "residual_before": before.rms_held_out,
        "residual_after": after.rms_held_out,
        "parameters": _parameters(model, known, [f"{name}.{p.name}" for p in effect.parameters]),
    }


def _parameters(model: Model, known: Mapping[str, Known], keys: Sequence[str]) -> list[dict[str, Any]]:
    rows = []
    for key in keys:
        value, k = model.value(key), known.get(key)
        rows.append(
            {
                "key": key,
                "value": value,
                "unit": model.parameter(key).unit,
                "standard_error": None if k is None else k.standard_error,
                "interval": None if k is None else [value - k.half_width, value + k.half_width],
                "bounds": list(model.entry(key).bounds or ()),
                "at_bound": None if k is None else k.at_bound,
            }
        )
    return rows


def _noise(parts: Split) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    for p in parts.pieces:
        for c, sigma in zip(p.channels, p.noise.tolist(), strict=True):
            found.setdefault(c, {})[p.record.name] = float(sigma)
    return found


def _subsystem(found: Found, kind: str, shapes: Sequence[Shape]) -> str | None:
    """Where it is: of the first effect found, or of the curve that explains most of what no effect does."""
    if kind == verdict.COMPLETE:
        return None
    if kind != verdict.OUTSIDE:
        return subsystem(found.base.model.library[found.added[0]])
    return shapes[0].subsystem if shapes else None


def add_balances(
    result: dict[str, Any], before: list[dict[str, Any]], after: list[dict[str, Any]], blamed: Sequence[str]
) -> None:
    """Put balances into a document. ``blamed``: subsystems by what they explain of them, the most first; it says where
    something outside the library is, unless a curve explains most of that."""
    result["balances"] = _balances(before, after)
    curve = result["nonparametric_curves"][0]["explained_share"] if result["nonparametric_curves"] else 0.0
    if result["verdict"]["kind"] == verdict.OUTSIDE and curve <= _TELLING and blamed:
        result["verdict"]["subsystem"] = blamed[0]


def _shape(s: Shape) -> dict[str, Any]:
    return {
        "place": s.place,
        "subsystem": s.subsystem,
        "summary": s.summary,
        "variable": s.variable,
        "unit": s.unit,
        "explained_share": s.share,
        "knots": np.asarray(s.centre),
        "value": np.asarray(s.height),
        "low": np.asarray(s.height - s.error),
        "high": np.asarray(s.height + s.error),
    }


def _balances(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> list[dict[str, Any]]:
    later = {b["name"]: b["ratio"] for b in after}
    keys = ("name", "subsystem", "unit", "residual_rms", "exact_rms", "ratio")
    return [{**{k: b[k] for k in keys if k in b}, "ratio_after": later.get(b["name"])} for b in before]
