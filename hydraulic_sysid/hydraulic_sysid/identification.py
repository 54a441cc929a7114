"""Identify a linear model from records and try it on held-out data: every figure in one document."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import metrics
from .decimation import trace
from .linear_models import ArxModel, ArxOrder, IdentificationError, fit_arx
from .noise import noise_floor
from .records import Record
from .resampling import held_average, sampled
from .results import heading

Array = NDArray[np.float64]

_LAGS = 25
_UNSTABLE = 1.01  # |z|; an estimated integrator may come out a little beyond 1
_SHORTEST_TEST = 100  # samples from which on a residual's correlations mean something


@dataclass(frozen=True)
class Settings:
    """What a user may choose about an identification."""

    order: ArxOrder = ArxOrder(3, 3, 1)
    sampling_time: float = 0.05
    """Seconds; the records are brought to it (see `resampling`)."""
    holdout: float = 0.2
    """Last part of every record that is kept from the fit, unless records are held out as a whole."""
    offsets: str = "estimate"
    input: str = "drive"
    output: str = "position"


@dataclass(frozen=True)
class _Series:
    """One stretch of a record at the model's sampling time."""

    record: Record
    u: Array
    y: Array


def identify(
    records: Sequence[Record], held_out: Sequence[Record] | None = None, settings: Settings | None = None
) -> dict[str, Any]:
    """Result document of an ARX model fitted to ``records`` and tried on ``held_out``.

    Without ``held_out`` the last part of every record is kept from the fit and tried on.

    :raises IdentificationError: no record, a channel missing, too little or too poor data, an impossible
    sampling time.
    """
    settings = settings or Settings()
    if not records:
        raise IdentificationError("there is no record to identify from")
    if held_out is None:
        if not 0.0 < settings.holdout < 1.0:
            raise IdentificationError(f"holdout is {settings.holdout:g}: a part between 0 and 1 is allowed")
        parts = [record.split(1.0 - settings.holdout) for record in records]
        records, held_out = [first for first, _ in parts], [last for _, last in parts]
    fit_on = [_series(record, settings) for record in records]
    try_on = [_series(record, settings) for record in held_out]
    model = fit_arx(
        [s.u for s in fit_on], [s.y for s in fit_on], settings.sampling_time, settings.order, settings.offsets
    )
    estimation = [_figures(model, s, noise_floor_of(s, settings)) for s in fit_on]
    validation = [_figures(model, s, noise_floor_of(s, settings)) for s in try_on]
    fpe = metrics.fpe(model.loss, model.parameters, model.samples)
    return {
        **heading("identify"),
        "settings": {
            "order": {"na": settings.order.na, "nb": settings.order.nb, "nk": settings.order.nk},
            "sampling_time": settings.sampling_time,
            "offsets": settings.offsets,
            "input": {"channel": settings.input, "unit": records[0].unit(settings.input)},
            "output": {"channel": settings.output, "unit": records[0].unit(settings.output)},
        },
        "verdict": _verdict(settings, model, validation),
        "model": _model_document(model),
        "estimation": {"mse": model.loss, "fpe": fpe, "samples": model.samples, "records": estimation},
        "validation": {**_pooled(validation), "fpe": fpe, "records": validation},
    }


def noise_floor_of(series: _Series, settings: Settings) -> float:
    """Noise of the output as recorded."""
    return noise_floor(series.record[settings.output])


def _series(record: Record, settings: Settings) -> _Series:
    for channel in (settings.input, settings.output):
        if channel not in record:
            raise IdentificationError(
                f"{record.name}: no channel {channel!r}; the record has {', '.join(sorted(record.channels))}"
            )
    try:
        u = held_average(record[settings.input], record.dt, settings.sampling_time)
        y = sampled(record[settings.output], record.dt, settings.sampling_time)
    except ValueError as error:
        raise IdentificationError(f"{record.name}: {error}") from None
    shortest = 2 * settings.order.memory + 2
    if u.size < shortest:
        raise IdentificationError(
            f"{record.name}: {u.size} samples at {settings.sampling_time:g} s are too few (at least "
            f"{shortest}): hold out a larger part or shorten the sampling time"
        )
    return _Series(record, u, y)


def _figures(model: ArxModel, series: _Series, noise: float) -> dict[str, Any]:
    free = model.simulate(series.u, series.y)
    one = model.predict(series.u, series.y)
    past = model.order.memory
    if not np.isfinite(free).all():
        free = np.full_like(series.y, np.nan)  # an unstable model has no free run worth a figure
    runs = bool(np.isfinite(free).all())
    residual = (series.y - one)[past:]
    time = series.record.time[0] + model.dt * np.arange(series.y.size)
    return {
        "name": series.record.name,
        "source": str(series.record.source),
        "samples": series.y.size,
        "duration": series.y.size * model.dt,
        "noise": noise,
        "best_fit_free_run": metrics.best_fit(series.y, free) if runs else float("nan"),
        "best_fit_one_step": metrics.best_fit(series.y[past:], one[past:]),
        "mse_free_run": metrics.mse(series.y, free) if runs else float("nan"),
        "mse_one_step": metrics.mse(series.y[past:], one[past:]),
        "r_squared_free_run": metrics.r_squared(series.y, free) if runs else float("nan"),
        "residual_tests": _residual_tests(residual, series.u[past:]),
        "traces": {
            "input": trace(time, series.u),
            "measured": trace(time, series.y),
            "free_run": trace(time, free),
            "one_step": trace(time, one),
            "free_run_error": trace(time, series.y - free),
            "one_step_error": trace(time, series.y - one),
        },
    }


def _residual_tests(residual: Array, drive: Array) -> dict[str, Any] | None:
    """Correlations of the one-step residual with itself and with the input; None for too short a stretch."""
    if residual.size < _SHORTEST_TEST or not (np.ptp(residual) > 0.0 and np.ptp(drive) > 0.0):
        return None
    return {
        "lags": _LAGS,
        "bound": 1.96 / np.sqrt(residual.size),
        "autocorrelation": metrics.autocorrelation(residual, _LAGS),
        "cross_correlation": metrics.cross_correlation(drive, residual, _LAGS),
    }


def _pooled(parts: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Mean square errors over all held-out samples, and the smallest and the mean best fit of the records."""
    samples = [p["samples"] for p in parts]
    return {
        "samples": int(sum(samples)),
        "mse_one_step": float(np.average([p["mse_one_step"] for p in parts], weights=samples)),
        "mse_free_run": float(np.average([p["mse_free_run"] for p in parts], weights=samples)),
        "best_fit_free_run": float(np.mean([p["best_fit_free_run"] for p in parts])),
        "best_fit_one_step": float(np.mean([p["best_fit_one_step"] for p in parts])),
        "worst_best_fit_free_run": float(min(p["best_fit_free_run"] for p in parts)),
    }


def _model_document(model: ArxModel) -> dict[str, Any]:
    numerator, denominator = model.transfer_function()
    names = [f"a{i + 1}" for i in range(model.order.na)]
    names += [f"b{i + 1}" for i in range(model.order.nb)]
    values = [*model.a, *model.b]
    if model.standard_errors.size > len(values):
        names, values = [*names, "c"], [*values, model.constant]
    return {
        "type": "ARX",
        "coefficients": [
            {"name": n, "value": v, "standard_error": e}
            for n, v, e in zip(names, values, model.standard_errors, strict=True)
        ],
        "input_offset": model.input_offset,
        "output_offset": model.output_offset,
        "transfer_function": {"numerator": numerator, "denominator": denominator, "sampling_time": model.dt},
        "poles": [
            {
                "real": p.value.real,
                "imaginary": p.value.imag,
                "natural_frequency_hz": p.natural_frequency,
                "damping": p.damping,
                "stable": p.stable,
            }
            for p in model.poles()
        ],
        "condition_number": model.condition_number,
    }


def _verdict(settings: Settings, model: ArxModel, validation: Sequence[dict[str, Any]]) -> dict[str, str]:
    order = settings.order
    name = f"ARX({order.na}, {order.nb}, {order.nk}) at {settings.sampling_time * 1e3:g} ms"
    fits = [p["best_fit_free_run"] for p in validation]
    one_step = np.mean([p["best_fit_one_step"] for p in validation])
    outside = [p for p in model.poles() if abs(p.value) > _UNSTABLE]
    if outside or not np.isfinite(fits).all():
        text = (
            f"{name} is unstable (pole at |z| = {max(abs(p.value) for p in outside):.3g}): its free run says "
            f"nothing, one step ahead it fits held-out data to {one_step:.1f} %. Try another sampling time or "
            "order, or a richer drive."
        )
        return {"level": "off", "text": text}
    where = "held-out data" if len(fits) == 1 else f"{len(fits)} held-out records (mean; worst {min(fits):.1f} %)"
    text = f"{name} fits {where} to {np.mean(fits):.1f} % in free run and {one_step:.1f} % one step ahead."
    level = "explained" if min(fits) >= 95.0 else "close" if min(fits) >= 80.0 else "off"
    return {"level": level, "text": text}
