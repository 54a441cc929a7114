"""Every figure of a diagnosis in one document (see docs/report-json.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from hydraulic_sim.model import Model
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.diagnosis.compare.subject import model_document

from . import posterior
from . import verdict as verdicts
from .candidates import subsystem
from .criteria import CRITERIA
from .data_sheet import Deviation
from .holdout import BLOCK, EVERY
from .misfit import Misfit
from .nonparametric_curves import NonparametricCurve
from .recording_faults import RecordingFault
from .search_state import SearchResult
from .uncertainty import Known
from .unseen import TriedOut
from .verdict import MISSING, OUTSIDE, UNDECIDED, Verdict
from .whereabouts import NOT_KNOWN, Whereabouts
from .worst_segments import worst_segments

_NEAREST = 3
MOST_PLACES = 50  # of spikes in a channel that are listed


def document(
    result: SearchResult,
    verdict: Verdict,
    known: Mapping[str, Known],
    where: Whereabouts,
    tested: TriedOut | None = None,
) -> dict[str, Any]:
    """The document, still without balances (`with_balances`); arrays NumPy, SI. ``tested``: on test data, if at all."""
    final = result.final
    records = {role: result.split.records(role == "validation") for role in ("fit", "validation")}
    records["test"] = result.split.tested()
    imitations = verdicts.imitated([r for every in records.values() for r in every])
    outside = verdict.kind == OUTSIDE
    explained = final.misfit.variance <= 1.0 + 2.0 * CRITERIA.noise_missed
    compared = posterior.explanations(result, verdict)
    said = [verdicts.sentences(result, verdict, where), "" if tested is None else tested.text]
    text = " ".join(filter(None, [*said, posterior.sentence(compared)]))
    return {
        **heading("diagnose", 2),
        "model": model_document(result.model),
        "settings": {
            "segment_length": result.settings.length,
            "validation_block": BLOCK,
            "validation_every": None if records["validation"] else EVERY,
            "values_used": sum(s.measured.size for s in result.split.segments),
        },
        "records": [
            {
                "name": r.name,
                "source": str(r.source),
                "duration": r.duration,
                "samples": len(r),
                "role": role,
            }
            for role, every in records.items()
            for r in every
        ],
        "channels": result.split.channels,
        "noise_std": {
            c: {
                s.record.name: float(s.noise_std[s.channels.index(c)]) for s in result.split.segments if c in s.channels
            }
            for c in result.split.channels
        },
        "verdict": {
            "kind": verdict.kind,
            "level": "off" if outside else "explained" if explained and verdict.kind != UNDECIDED else "close",
            "effects": verdict.possible,
            "subsystem": verdicts.place(result, verdict, where),
            "periodic": where.sine is not None,
            "probability": posterior.probability(compared),
            "text": text + verdicts.warning(verdict.possible, imitations),
            "imitated": imitations,
        },
        "explanations": [vars(e) for e in compared],
        "residual": {
            "unit": "residual over noise",
            "before": _residual(result.before_over_noise),
            "after": _residual(final.misfit),
            "after_each_effect": [{"name": name, **_residual(after)} for name, after in result.misfits.items()],
        },
        "test": None if tested is None or not tested.records else vars(tested),
        "effects": _effects(result, verdict, known),
        "competing_models": {
            name: [
                {
                    "name": c.name,
                    "residual_after": c.misfit.rms_validation,
                    "chi_square_difference": c.difference,
                    "distinguishable": c.distinguishable,
                    "fitted_to_the_end": c.finished,
                    "collinearity": c.collinearity,
                }
                for c in every
            ]
            for name, every in verdict.competing.items()
        },
        "data_sheet": [_number(result, d) for d in result.moved],
        "data_sheet_instead": [_number(result, d) for d in [*result.numbers_instead, *result.together_instead.numbers]],
        "recording": {
            "faults": [_fault(f) for f in result.faults],
            "instead": [_fault(f) for f in [*result.faults_instead, *result.together_instead.faults]],
            "spikes": [
                {
                    "channel": s.channel,
                    "count": s.count,
                    "share": s.share,
                    "places": [{"record": record, "time": time} for record, time in s.places[:MOST_PLACES]],
                }
                for s in result.spikes
            ],
            "set_aside": [vars(a) for a in result.split.set_aside],
            "mains_lines": {
                c: sorted({f for s in result.split.segments if c in s.channels for f in s.hum[s.channels.index(c)]})
                for c in result.split.channels
            },
        },
        "whiteness": [vars(w) | {"coloured": w.coloured} for w in result.whiteness],
        "remainder": [
            {"channel": r.channel, "beyond_noise": r.beyond, "noise": r.noise, "motion": r.motion, "share": r.share}
            for r in result.remainders
        ],
        "drift": None if result.drift is None else vars(result.drift),
        "parameters": _parameters(final.model, known, final.linearisation.parameters.keys),
        "unexplained_share": result.unexplained_share,
        "nonparametric_curves": [_curve(c) for c in where.curves],
        "unknown_inputs": [vars(u) for u in where.inputs],
        "periodic_inputs": [vars(p) for p in where.sines],
        "nearest_effects": [r.name for r in final.refits[:_NEAREST]] if outside else [],
        "proposed_effect": None,
        "balances": [],
        "worst_segments": worst_segments(result),
    }


REFUTED = ": no more than chance or fitting gives; the data do not bear it out."


def _fault(found: RecordingFault) -> dict[str, Any]:
    return {
        "name": found.hypothesis.name,
        "channels": list(found.hypothesis.channels),
        "size": found.size,
        "unit": found.unit,
        "standard_error": found.standard_error,
        "text": found.text,
        "remedy": found.hypothesis.remedy,
        "alternatives": [_fault(other) for other in found.alternatives],
        "instead": list(found.instead),
    }


def added_document(
    result: SearchResult, known: Mapping[str, Known], confirmed: bool, tested: TriedOut | None = None
) -> dict[str, Any]:
    """The document of one effect added on request: the same keys, as far as they apply."""
    (name,) = result.added
    whole = document(result, Verdict(MISSING, [name], {}, {}), known, NOT_KNOWN, tested)
    before, after = (number["validation"] for number in (whole["residual"]["before"], whole["residual"]["after"]))
    text = f"With {name} the residual on validation data goes from {before:.4g} to {after:.4g} × noise"
    whole |= heading("add", 2)
    whole["verdict"] |= {
        "kind": "confirmed" if confirmed else "not confirmed",
        "level": whole["verdict"]["level"] if confirmed else "off",
        "text": " ".join([
            text + ("." if confirmed else REFUTED), *([tested.text] if tested is not None and tested.text else []),
            *verdicts.force_sentences(result, others=False),
        ]),
    }
    del whole["verdict"]["probability"], whole["verdict"]["periodic"]
    unused = ("explanations", "competing_models", "nonparametric_curves", "unknown_inputs", "periodic_inputs",
              "nearest_effects", "proposed_effect", "balances")  # fmt: skip
    return {k: v for k, v in whole.items() if k not in unused}


def with_balances(
    whole: dict[str, Any],
    before: Sequence[Mapping[str, Any]],
    after: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """The document with balances."""
    later = {b["name"]: b["ratio"] for b in after}
    keys = ("name", "subsystem", "unit", "residual_rms", "exact_rms", "ratio")
    rows = [{**{k: b[k] for k in keys if k in b}, "ratio_after": later.get(b["name"])} for b in before]
    return {**whole, "balances": rows}


def _residual(misfit: Misfit) -> dict[str, float]:
    return {"fit": misfit.rms_fit, "validation": misfit.rms_validation}


def _number(result: SearchResult, d: Deviation) -> dict[str, Any]:
    return {
        "key": d.key,
        "unit": result.model.parameter(d.key).unit,
        "nominal": d.nominal,
        "value": d.value,
        "standard_error": d.standard_error,
        "chi_square_difference": d.cost,
        "instead": list(d.instead),
        "alternatives": [_number(result, other) for other in d.alternatives],
    }


def _effects(result: SearchResult, verdict: Verdict, known: Mapping[str, Known]) -> list[dict[str, Any]]:
    """All that was tried, ranked: what was added, then what could be in its place, then the rest of the library."""
    base = result.base.misfit
    rows: dict[str, dict[str, Any]] = {}
    previous = base
    for name, after in result.misfits.items():
        rows[name] = _row(name, True, previous, after, result.final.model, known)
        previous = after
    for c in (c for every in verdict.competing.values() for c in every):
        rows.setdefault(c.name, _row(c.name, False, base, c.misfit, c.model, {}))
    for r in result.base.refits:
        rows.setdefault(r.name, _row(r.name, False, base, r.misfit, r.refit.model, {}))
    for s in result.base.scores:
        left = max(base.fit - max(s.reduction, 0.0), 0.0)
        unfitted = {
            "name": s.effect.name,
            "subsystem": subsystem(s.effect),
            "added": False,
            "refitted": False,
            "residual_before": base.rms_fit,
            "residual_after": math.sqrt(left / max(base.n_fit, 1)),
            "parameters": [],
        }
        rows.setdefault(s.effect.name, unfitted)
    return [{"rank": i + 1, **row} for i, row in enumerate(rows.values())]


def _row(
    name: str, added: bool, before: Misfit, after: Misfit, model: Model, known: Mapping[str, Known]
) -> dict[str, Any]:
    effect = model.library[name]
    return {
        "name": name,
        "subsystem": subsystem(effect),
        "added": added,
        "refitted": True,
        "residual_before": before.rms_validation,
        "residual_after": after.rms_validation,
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
                "interval": None if k is None else list(k.interval(value)),
                "bounds": list(model.entry(key).bounds or ()),
                "at_bound": None if k is None else k.at_bound,
            }
        )
    return rows


def _curve(c: NonparametricCurve) -> dict[str, Any]:
    same = ("place", "subsystem", "summary", "variable", "unit", "knots", "value")
    band = {"explained_share": c.share, "low": c.value - c.error, "high": c.value + c.error}
    return {name: getattr(c, name) for name in same} | band
