"""Identify a linear model from records and try it on test data: every figure in one document."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.records import Record, RecordError
from hydraulic_sysid.data.resampling import held_average, sampled
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.estimation.noise import noise_std

from .models import CRITERIA, Arx, Candidate, IdentificationError, LinearModel, Structure, best, model_file, try_orders
from .validation import residual_tests

_UNSTABLE = 1.01  # |z|; an estimated integrator may come out a little beyond 1


@dataclass(frozen=True)
class IdentificationSettings:
    """What a user may choose about an identification."""

    structure: Structure = Arx()
    sampling_time: float = 0.05
    """Seconds; the records are brought to it (see `resampling`)."""
    holdout: float = 0.2
    """Last part of every record that is kept from the fit, unless whole records are for testing."""
    offsets: str = "estimate"
    select: str | None = None
    """Choose the order, up to that of ``structure``, by one of `linear_models.CRITERIA`."""
    input: str = "drive"
    output: str = "position"


@dataclass(frozen=True)
class _Series:
    """A record, or the part of one that is used, at the model's sampling time."""

    record: Record
    u: Array
    y: Array


def identify(
    records: Sequence[Record],
    test_records: Sequence[Record] | None = None,
    settings: IdentificationSettings | None = None,
) -> tuple[dict[str, Any], LinearModel]:
    """A linear model fitted to ``records`` and tried on ``test_records``: its result document, and the model.

    Without ``test_records`` the last part of every record is kept from the fit and tried on.

    :raises IdentificationError: no record, a channel missing, too little or too poor data, an impossible
    sampling time or criterion.
    """
    settings = settings or IdentificationSettings()
    if not records:
        raise IdentificationError("there is no record to identify from")
    if test_records is None:
        if not 0.0 < settings.holdout < 1.0:
            raise IdentificationError(f"holdout is {settings.holdout:g}: a part between 0 and 1 is allowed")
        parts = [record.split(1.0 - settings.holdout) for record in records]
        records, test_records = [first for first, _ in parts], [last for _, last in parts]
    fit_on = [_series(record, settings) for record in records]
    try_on = [_series(record, settings) for record in test_records]
    data = [s.u for s in fit_on], [s.y for s in fit_on], settings.sampling_time, settings.offsets
    structure, tried = settings.structure, None
    if settings.select is not None:
        candidates = try_orders(structure.up_to(), *data)
        structure = best(candidates, settings.select).structure
        tried = _orders(candidates)
    model = structure.fit(*data)
    fit, test = ([_figures(model, s, settings.output) for s in data] for data in (fit_on, try_on))
    fpe = metrics.fpe(model.loss, model.parameters, model.samples)
    result = {
        **heading("identify", 3),
        "settings": {
            "structure": {"text": structure.text, **structure.document()},
            "sampling_time": settings.sampling_time,
            "offsets": settings.offsets,
            "criterion": settings.select,
            "input": {"channel": settings.input, "unit": records[0].unit(settings.input)},
            "output": {"channel": settings.output, "unit": records[0].unit(settings.output)},
        },
        "verdict": _verdict(structure, model, test),
        "model": _model_document(model),
        "orders": tried,
        "fit": {**_pooled(fit), "mse": model.loss, "fpe": fpe, "records": fit},
        "test": {**_pooled(test), "fpe": fpe, "records": test},
    }
    return result, model


def about(result: dict[str, Any]) -> dict[str, Any]:
    """What a model's file says besides the model: name, channels and units, orders, data, and how well it fits."""
    settings, held = result["settings"], result["test"]
    ends = f"{settings['input']['channel']} to {settings['output']['channel']}"
    return {
        "name": f"{settings['structure']['text']} from {ends}",
        "created": result["created"],
        "software": result["software"],
        "input": settings["input"],
        "output": settings["output"],
        "orders": settings["structure"],
        "records": [r["source"] for r in result["fit"]["records"]],
        "test": {
            key: held[key] for key in ("best_fit_free_run", "best_fit_one_step", "mse_free_run", "mse_one_step", "fpe")
        },
    }


def _orders(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Rows of the table of orders, each with the criteria that would choose it."""
    chosen: dict[int, list[str]] = {}
    for criterion in CRITERIA:
        if any(np.isfinite(getattr(c, criterion)) for c in candidates):
            chosen.setdefault(id(best(candidates, criterion)), []).append(criterion)
    return [
        {
            "text": c.structure.text,
            **c.structure.document(),
            **{key: getattr(c, key) for key in ("parameters", "loss", "fpe", "aic", "bic", "cv")},
            "best_by": chosen.get(id(c), []),
        }
        for c in candidates
    ]


def _series(record: Record, settings: IdentificationSettings) -> _Series:
    record.require(settings.input, settings.output, error=IdentificationError)
    try:
        u = held_average(record[settings.input], record.dt, settings.sampling_time)
        y = sampled(record[settings.output], record.dt, settings.sampling_time)
    except RecordError as error:
        raise IdentificationError(f"{record.name}: {error}") from None
    shortest = 2 * settings.structure.memory + 2
    if u.size < shortest:
        raise IdentificationError(
            f"{record.name}: {u.size} samples at {settings.sampling_time:g} s are too few (at least "
            f"{shortest}): hold out a larger part or shorten the sampling time"
        )
    return _Series(record, u, y)


def _figures(model: LinearModel, series: _Series, output: str) -> dict[str, Any]:
    free = model.simulate(series.u, series.y)
    if not np.isfinite(free).all():
        free = np.full_like(series.y, np.nan)  # an unstable model has no free run worth a figure
    one = model.predict(series.u, series.y)
    past = model.memory
    y, u, ahead = series.y[past:], series.u[past:], one[past:]
    time = series.record.time[0] + model.dt * np.arange(series.y.size)
    merits = {"best_fit": metrics.best_fit, "mse": metrics.mse, "r_squared": metrics.r_squared}
    traces = {
        "input": series.u,
        "measured": series.y,
        "free_run": free,
        "one_step": one,
        "free_run_error": series.y - free,
        "one_step_error": series.y - one,
    }
    return {
        "name": series.record.name,
        "source": str(series.record.source),
        "samples": series.y.size,
        "duration": series.y.size * model.dt,
        "noise_std": noise_std(series.record[output]),
        **{f"{name}_free_run": _or_nan(merit, series.y, free) for name, merit in merits.items()},
        **{f"{name}_one_step": _or_nan(merit, y, ahead) for name, merit in merits.items()},
        "residual_tests": residual_tests(y - ahead, u) if np.isfinite(ahead).all() else None,
        "free_run_tests": residual_tests(series.y - free, series.u) if np.isfinite(free).all() else None,
        "traces": {name: trace(time, values) for name, values in traces.items()},
    }


def _or_nan(figure: Callable[[Array, Array], float], measured: Array, predicted: Array) -> float:
    """A figure of merit; NaN where an unstable model predicts nothing."""
    return figure(measured, predicted) if np.isfinite(predicted).all() else float("nan")


def _pooled(parts: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Mean square errors over all samples, and the mean and the smallest best fit of the records."""
    samples = [p["samples"] for p in parts]
    return {
        "samples": int(sum(samples)),
        **{k: float(np.average([p[k] for p in parts], weights=samples)) for k in ("mse_one_step", "mse_free_run")},
        **{k: float(np.mean([p[k] for p in parts])) for k in ("best_fit_free_run", "best_fit_one_step")},
        "worst_best_fit_free_run": float(min(p["best_fit_free_run"] for p in parts)),
    }


def _model_document(model: LinearModel) -> dict[str, Any]:
    return {
        "type": type(model).__name__.removesuffix("Model"),
        "coefficients": [
            {"name": name, "value": value, "standard_error": error} for name, value, error in model.coefficients()
        ],
        **{k: getattr(model, k) for k in ("minimised", "parameters", "input_offset", "output_offset")},
        "transfer_function": model_file.transfer_function(model),
        "poles": model_file.poles(model),
        "condition_number": getattr(model, "condition_number", None),
        "singular_values": getattr(model, "singular_values", None),
    }


def _verdict(structure: Structure, model: LinearModel, validation: Sequence[dict[str, Any]]) -> dict[str, str]:
    name = f"{structure.text[0].upper()}{structure.text[1:]} at {model.dt * 1e3:g} ms"
    fits = [p["best_fit_free_run"] for p in validation]
    one_step = np.mean([p["best_fit_one_step"] for p in validation])
    # What growth a continuous pole's s means per sample.
    growth = [abs(p.value) if p.sampled else float(np.exp(p.value.real * model.dt)) for p in model.poles()]
    if max(growth) > _UNSTABLE or not np.isfinite(fits).all():
        text = (
            f"{name} is unstable (pole at |z| = {max(growth):.3g}): its free run says "
            f"nothing, one step ahead it fits test data to {one_step:.1f} %. Try another sampling time or "
            "order, or a richer drive."
        )
        return {"level": "off", "text": text}
    where = "test data" if len(fits) == 1 else f"{len(fits)} test records (mean; worst {min(fits):.1f} %)"
    text = f"{name} fits {where} to {np.mean(fits):.1f} % in free run and {one_step:.1f} % one step ahead."
    level = "explained" if min(fits) >= 95.0 else "close" if min(fits) >= 80.0 else "off"
    return {"level": level, "text": text}
