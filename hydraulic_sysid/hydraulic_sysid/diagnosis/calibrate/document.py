"""A calibration from beginning to end, and every figure of it in one document (see docs/report-json.md)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.estimation.errors import CalibrationError
from hydraulic_sysid.estimation.fit import Fit, FitSettings, evaluate, fit, loss
from hydraulic_sysid.estimation.uncertainty import VAGUE, uncertainty

_WIDTH = 1.96  # standard errors on either side of a 95 % interval
EXACT = 1.1  # residual over noise up to which a model is said to explain its records


@dataclass(frozen=True)
class Calibration:
    """The calibrated model (with standard errors and history) and the result document."""

    model: Model
    result: dict[str, Any]


def calibrate(
    model: Model,
    records: Sequence[Record],
    test: Sequence[Record] = (),
    settings: FitSettings | None = None,
    keys: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Fit ``keys`` (default: the model's free parameters) to ``records``; try the result on ``test`` records.

    The fit never sees test records.

    :raises CalibrationError: nothing to fit, unusable records, or such as are in both roles.
    :raises hydraulic_sim.errors.ModelError: a model that does not compose.
    :raises hydraulic_sim.errors.SimulationError: the model does not run along a record.
    """
    settings = settings or FitSettings()
    chosen = list(dict.fromkeys(model.free_keys() if keys is None else keys))
    in_use = model.keys()
    unknown = [k for k in chosen if k not in in_use]
    if unknown:
        raise CalibrationError(f"{', '.join(unknown)}: not in the model; it has: {', '.join(in_use)}")
    if not chosen:
        raise CalibrationError("nothing to fit: no parameter is free (mark one `fit: free` in the model file)")
    same = [t.name for t in test if any(_shares_samples(t, r) for r in records)]
    if same:
        raise CalibrationError(f"test records are also among those to fit: {', '.join(same)}")
    settings = replace(settings, length=settings.seconds(model, [*records, *test]))
    say = progress or (lambda _: None)
    say("residuals before")
    before = evaluate(model, records, settings)
    test_before = evaluate(model, test, settings) if test else None
    done = fit(model, records, chosen, settings, lambda i, rms: say(f"step {i}: residual {rms:.3g} times the noise"))
    known, fitted = uncertainty(done), done.point.parameters
    calibrated = model.with_values(done.values, source="calibrated")
    for key, error in known.standard_errors.items():
        calibrated = calibrated.with_entry(key, standard_error=error if math.isfinite(error) else None)
    calibrated = calibrated.with_history(
        date=date.today().isoformat(),
        change="calibrated " + ", ".join(chosen),
        records=[r.name for r in records],
        test_records=[r.name for r in test],
        error_before=float(f"{before.rms:.4g}"),
        error_after=float(f"{done.rms:.4g}"),
        error_unit="residual over noise",
    )
    test_after = evaluate(calibrated, test, settings) if test else None
    result = {
        **heading("calibrate", 2),
        "model": {"name": model.name, "path": None if model.path is None else str(model.path)},
        "settings": {"segment_length": settings.length, "robust": settings.robust},
        "records": [_about(r, "fit") for r in records] + [_about(r, "test") for r in test],
        "converged": done.converged,
        "iterations": done.iterations,
        "fit": _residuals(before, done),
        "test": None if test_before is None or test_after is None else _residuals(test_before, test_after),
        "parameters": [
            {
                "key": key,
                "unit": model.parameter(key).unit,
                "before": model.value(key),
                "value": value,
                "standard_error": known.standard_errors[key],
                "interval": _interval(value, known.standard_errors[key]),
                "scale": scale,
                "bounds": [low, high],
                "at_bound": fitted.at_bound.get(key),
                "identifiable": known.standard_errors[key] < VAGUE * scale,
            }
            for key, value, scale, low, high in zip(
                fitted.keys, *(a.tolist() for a in (fitted.values, fitted.scales, fitted.low, fitted.high)), strict=True
            )
        ],
        "correlation": {"keys": chosen, "matrix": known.correlation.tolist()},
        "condition_number": known.condition_number,
        "not_identifiable": [{"weights": d.weights, "error": d.error} for d in known.not_identifiable],
    }
    result["verdict"] = _verdict(result)
    return Calibration(calibrated, result)


def _about(record: Record, role: str) -> dict[str, Any]:
    return {
        "name": record.name,
        "source": str(record.source),
        "samples": len(record),
        "sampling_time": record.dt,
        "duration": record.duration,
        "role": role,
    }


def _shares_samples(one: Record, other: Record) -> bool:
    """Whether two records, or windows of them, are in part the same experiment."""
    if (one.source, _whole(one)) != (other.source, _whole(other)):
        return False
    (a, b), (c, d) = _span(one), _span(other)
    return a < d - 1e-9 and c < b - 1e-9


def _whole(record: Record) -> str:
    return record.name.partition("[")[0]


def _span(record: Record) -> tuple[float, float]:
    begin, end = record.description.get("window_s", (0.0, record.duration))
    return float(begin), float(end)


def _interval(value: float, error: float) -> list[float]:
    """The 95 % interval, infinite where the data do not determine the parameter."""
    return [float(value - _WIDTH * error), float(value + _WIDTH * error)]


def _residuals(before: Fit, after: Fit) -> dict[str, Any]:
    """Residual over noise, before and after: over all, and per record and channel with the noise beside it."""
    rows = []
    for old, new, segments in zip(_by_channel(before), _by_channel(after), after.point.shooting.segments, strict=True):
        for c, channel in enumerate(segments.channels):
            rows.append(
                {
                    "record": segments.record.name,
                    "channel": channel,
                    "noise_std": float(segments.noise_std[c]),
                    "before": float(old[c]),
                    "after": float(new[c]),
                }
            )
    return {"before": before.rms, "after": after.rms, "records": rows}


def _by_channel(fitted: Fit) -> list[np.ndarray]:
    """Residual over noise per channel (C,), one array per record, the initial states' degrees of freedom taken out."""
    found = []
    for segments, projection in zip(fitted.point.shooting.segments, fitted.point.projections, strict=True):
        squares = loss(segments.by_channel(projection.residual), fitted.point.robust)
        used = len(segments) * segments.free.size / squares.size
        found.append(np.sqrt(squares.mean(axis=(0, 1)) / (1.0 - used)))
    return found


def _verdict(result: dict[str, Any]) -> dict[str, str]:
    """One sentence: how far the error fell, where it stands, and what the data cannot identify."""
    judged = result["test"] or result["fit"]
    where = "test records" if result["test"] else "the records fitted (there were no test records)"
    level = "explained" if judged["after"] <= EXACT else "off"
    text = f"On {where} the residual went from {judged['before']:.3g} to {judged['after']:.3g} times the noise" + (
        "; nothing is left to explain."
        if level == "explained"
        else "; something is left that no free parameter explains."
    )
    vague = [p["key"] for p in result["parameters"] if not p["identifiable"]]
    if vague:
        text += f" These data cannot identify {', '.join(vague)}."
    if not result["converged"]:
        text += " The fit has not converged."
    return {"level": level, "text": text}
