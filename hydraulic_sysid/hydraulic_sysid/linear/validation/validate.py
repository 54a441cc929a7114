"""Try identified models on drives that they were not fitted to: one document."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.resampling import held_average, sampled
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.linear.models import IdentificationError, LinearModel

from .residuals import residual_tests
from .rmse_grid import Grid, records_rmse, rmse_grid


@dataclass(frozen=True)
class Subject:
    """A model to be tried, where it came from, and the channels it takes and gives."""

    model: LinearModel
    source: str
    input: str = "drive"
    output: str = "position"
    unit: str = "m"


def validate(
    subjects: Mapping[str, Subject], plant: Plant | None, grid: Grid, records: Sequence[Record] = ()
) -> dict[str, Any]:
    """Result document: errors of all models (by name) over the grid, against ``plant``, and over ``records``.

    :raises IdentificationError: nothing to try on, models of different channels, a model that is not of drive and
    position for the plant, a record without their channels, or one that a model cannot be sampled from.
    """
    if not subjects:
        raise IdentificationError("nothing to validate: give models")
    first = next(iter(subjects.values()))
    for name, subject in subjects.items():
        if (subject.input, subject.output) != (first.input, first.output):
            ends = f"{subject.input} to {subject.output}, not {first.input} to {first.output}"
            raise IdentificationError(f"{name}: goes from {ends}: validate it by itself")
    if plant is None and not records:
        raise IdentificationError("nothing to validate on: give a plant model or records")
    if plant is not None and (first.input, first.output) != ("drive", "position"):
        raise IdentificationError(
            f"models from {first.input} to {first.output}: a plant can be compared in drive and position only"
        )
    for record in records:
        _check(record, subjects)
    models = {name: subject.model for name, subject in subjects.items()}
    cells = rmse_grid(models, plant, grid) if plant is not None else []
    rows = records_rmse(models, records, first.input, first.output)
    for row, record in zip(rows, records, strict=True):
        for name, model in models.items():
            row["models"][name] |= _one_step(model, record, first)
    return {
        **heading("validate", 2),
        "title": "Validation of identified models",
        "models": [
            {
                "name": name,
                "source": s.source,
                "sampling_time": s.model.dt,
                "stable": all(pole.stable for pole in s.model.poles()),
            }
            for name, s in subjects.items()
        ],
        "plant": None if plant is None else plant.model.name,
        "settings": {
            "shapes": list(grid.shapes),
            "amplitudes": list(grid.amplitudes),
            "frequencies": list(grid.frequencies),
            "input": first.input,
            "output": {"channel": first.output, "unit": first.unit},
        },
        "verdict": _verdict(list(subjects), cells, rows),
        "summary": {name: _summary(name, cells) for name in subjects} if cells else None,
        "grid": cells,
        "records": rows,
    }


def _check(record: Record, subjects: Mapping[str, Subject]) -> None:
    for name, subject in subjects.items():
        record.require(subject.input, subject.output, error=IdentificationError)
        if subject.model.dt < record.dt * (1.0 - 1e-9):
            raise IdentificationError(
                f"{record.name} is sampled every {record.dt:g} s, {name} needs {subject.model.dt:g} s"
            )


def _one_step(model: LinearModel, record: Record, subject: Subject) -> dict[str, Any]:
    """Best fit one step ahead, and the tests of its residual."""
    u = held_average(record[subject.input], record.dt, model.dt)
    y = sampled(record[subject.output], record.dt, model.dt)
    one = model.predict(u, y)[model.memory :]
    left = y[model.memory :] - one
    if not np.isfinite(left).all():
        return {"best_fit_one_step": float("nan"), "residual_tests": None}
    spread = float(np.linalg.norm(y - y.mean()))
    return {
        "best_fit_one_step": 100.0 * (1.0 - float(np.linalg.norm(left)) / spread) if spread else float("nan"),
        "residual_tests": residual_tests(left, u[model.memory :]),
    }


def _summary(name: str, cells: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Over the drives on which the plant stayed off its stops."""
    inside = [c for c in cells if c["within_travel"] and np.isfinite(c["models"][name]["rmse"])]
    if not inside:
        return {"drives": 0, "rmse": float("nan"), "median_best_fit": float("nan"), "worst": None}
    worst = min(inside, key=lambda c: c["models"][name]["best_fit"])
    return {
        "drives": len(inside),
        "rmse": float(np.sqrt(np.mean([c["models"][name]["rmse"] ** 2 for c in inside]))),
        "median_best_fit": float(np.median([c["models"][name]["best_fit"] for c in inside])),
        "worst": {key: worst[key] for key in ("shape", "amplitude", "frequency")} | worst["models"][name],
    }


def _verdict(names: Sequence[str], cells: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """The best model by the median best fit of what was tried."""
    tried = [c for c in cells if c["within_travel"]] + list(rows)
    fits = {name: [c["models"][name]["best_fit"] for c in tried] for name in names}
    usable = {name: f for name, f in fits.items() if f and np.isfinite(f).all()}
    if not usable:
        return {"level": "off", "text": "No model can be run on all drives."}
    best = max(usable, key=lambda name: float(np.median(usable[name])))
    median, worst = float(np.median(usable[best])), min(usable[best])
    what = f"{len(fits[best])} drives" if cells else f"{len(rows)} record{'s' if len(rows) > 1 else ''}"
    lead = f"Of {len(names)} models {best} fits best: " if len(names) > 1 else f"{best}: "
    text = f"{lead}{median:.1f} % in the median of {what} that it was run free on, {worst:.1f} % on the worst."
    level = "explained" if worst >= 95.0 else "close" if median >= 80.0 else "off"
    return {"level": level, "text": text}
