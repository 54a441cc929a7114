"""A black box on top of the white one: how much is left that the physics does not name.

What a physical model misses of the measurement is, at a finite horizon, either noise (what an exact model would miss
too), or a function of drive and motion that comes back on fresh data, or neither. A black box fitted to the error and
judged on test data distinguishes the second from the third; its terms say what the missing physics looks like. The grey
box is the sum of both [1, 2].

[1] L. Li, T. Thurner, Accurate modeling and identification of servo-hydraulic cylinder systems (2013).
[2] L. Jin, Q. Wang, Accurate model identification of the inertial mass dynamic of hydraulic cylinder (2019).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.model_file import Model
from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.display import TITLES
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.diagnosis.compare.channels import UNITS
from hydraulic_sysid.diagnosis.compare.prediction import check
from hydraulic_sysid.diagnosis.compare.reference_run import Compared, run
from hydraulic_sysid.diagnosis.compare.subject import ModelSubject

from .selection import FOLDS, Selected, select
from .terms import Scales, Terms, terms
from .verdict import shares, verdict

TARGETS = ("velocity", "load_pressure")
"""Channels whose error is modelled, as far as the records have them. The position's error is the velocity's, summed."""
STEP_S = 0.01
BLOCK_S = 0.5
_SIGNALS = ("velocity", "position", "load_pressure")


class GreyBoxError(HydraulicError, ValueError):
    """Records, or how they are divided, do not allow a black box on top of the white one."""


@dataclass(frozen=True)
class _Data:
    """One record, brought to `STEP_S`: signals of the white box, and of every target the error and an exact model's."""

    name: str
    dt: float
    time: Array
    signals: dict[str, Array]
    error: dict[str, Array]
    exact: dict[str, Array]


Side = Sequence[tuple[_Data, Terms]]
"""Records with their candidate terms."""


def grey_box(
    model: Model,
    records: Sequence[Record],
    test: Sequence[Record],
    horizon: float = 0.5,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Result document: the black box is fitted to the errors on ``records`` and judged on ``test``.

    :raises GreyBoxError: no record on either side, or too short ones.
    :raises ComparisonError: a record that lacks what a comparison needs.
    """
    if not records or not test:
        raise GreyBoxError("a grey box needs records to fit and records (or a part of them) to test on")
    subject = ModelSubject(model)
    data: list[_Data] = []
    for record in [*records, *test]:
        check(record, horizon)
        if progress is not None:
            progress(record.name)
        data.append(_data(run(subject, record, horizon, seed=len(data))))
    if sum(d.time.size for d in data[: len(records)]) * STEP_S < 2 * FOLDS * BLOCK_S:
        raise GreyBoxError(f"the records to fit are too short: {2 * FOLDS * BLOCK_S:g} s are needed beyond the horizon")
    scales = Scales.of([d.signals for d in data[: len(records)]])
    both = [(d, terms(d.signals, d.dt, scales)) for d in data]
    fit, judge = both[: len(records)], both[len(records) :]
    channels = [name for name in TARGETS if all(name in d.error for d in data)]
    found = {name: _channel(name, fit, judge) for name in channels}
    return {
        **heading("greybox", 2),
        "title": f"Grey box on {model.name}",
        "model": {"name": model.name, "path": str(model.path) if model.path else None, "effects": list(model.effects)},
        "settings": {"horizon": horizon, "sampling_time": STEP_S, "candidates": len(both[0][1].names)},
        "verdict": verdict(model.name, found),
        "channels": found,
        "fit": [d.name for d, _ in fit],
        "test": [d.name for d, _ in judge],
    }


def _data(compared: Compared) -> _Data:
    record = compared.data.record
    every = max(1, round(STEP_S / record.dt))
    predicted = compared.runs.horizon
    signals = {"drive": record["drive"], **{n: predicted[n] for n in _SIGNALS if n in predicted}}
    targets = [n for n in TARGETS if n in compared.data.compared]
    error = {n: compared.error("horizon", n) for n in targets}
    exact = {n: compared.exact_error("horizon", n) for n in targets}
    finite = np.isfinite(np.column_stack([*signals.values(), *error.values(), *exact.values()])).all(axis=1)
    keep = np.flatnonzero(finite)
    if keep.size < 4 * every:
        raise GreyBoxError(f"{record.name}: nothing is left to compare beyond the horizon")
    # The horizon's prediction has no value at the beginning only: what is kept lies in a row.
    kept = slice(int(keep[0]), int(keep[-1]) + 1)

    def slow(values: dict[str, Array]) -> dict[str, Array]:
        return {name: _means(x[kept], every) for name, x in values.items()}

    return _Data(
        record.name, record.dt * every, _means(record.time[kept], every), slow(signals), slow(error), slow(exact)
    )


def _means(values: Array, every: int) -> Array:
    whole = values.size // every * every
    return values[:whole].reshape(-1, every).mean(axis=1)


def _channel(name: str, fit: Side, test: Side) -> dict[str, Any]:
    """White, linear grey and grey box of one channel: errors on both sides, and the terms."""
    values, target = _joined(name, fit)
    blocks = _blocks([d.time for d, _ in fit])
    linear = np.flatnonzero(fit[0][1].linear)
    only_linear = select(values[:, linear], target, blocks)
    only_linear = replace(only_linear, order=[int(linear[i]) for i in only_linear.order])
    full = select(values, target, blocks)
    if only_linear.cross_validated < full.cross_validated:
        full = only_linear
    sides = {"fit": _errors(name, fit, only_linear, full), "test": _errors(name, test, only_linear, full)}
    records = []
    for d, t in test:
        error, black = d.error[name], full.predict(t.values)
        traces = {"white": error, "black": black, "grey": error - black}
        records.append({"name": d.name, "traces": {key: trace(d.time, x) for key, x in traces.items()}})
    return {
        "unit": UNITS[name],
        "title": TITLES[name],
        **sides,
        "shares": shares(sides["test"]),
        "terms": _contributions(name, test, full),
        "records": records,
    }


def _joined(name: str, side: Side) -> tuple[Array, Array]:
    """Terms (N, k) and error (N,) of all records in a row."""
    return np.vstack([t.values for _, t in side]), np.concatenate([d.error[name] for d, _ in side])


def _errors(name: str, side: Side, linear: Selected, full: Selected) -> dict[str, float]:
    """RMS of the white box's error, of what the black boxes leave of it, and of an exact model's error."""
    values, error = _joined(name, side)
    return {
        "white": _rms(error),
        "linear": _rms(error - linear.predict(values)),
        "grey": _rms(error - full.predict(values)),
        "exact": _rms(np.concatenate([d.exact[name] for d, _ in side])),
    }


def _contributions(name: str, side: Side, full: Selected) -> list[dict[str, Any]]:
    """Every term with the share of the mean squared error that is lost without it."""
    values, error = _joined(name, side)
    left, total = error - full.predict(values), float(np.mean(error**2))
    rows = []
    for index, coefficient in zip(full.order, full.coefficients, strict=True):
        own = values[:, index] * coefficient
        without = float(np.mean((left + own - np.mean(own)) ** 2))
        share = (without - float(np.mean(left**2))) / total
        rows.append({"name": side[0][1].names[index], "coefficient": float(coefficient), "share": share})
    return sorted(rows, key=lambda row: -float(row["share"]))


def _blocks(times: Sequence[Array]) -> Index:
    """Number of the half-second block of every sample, records in a row."""
    numbers, first = [], 0
    for time in times:
        own = np.floor((time - time[0]) / BLOCK_S + 1e-9).astype(np.int64)
        numbers.append(first + own)
        first += int(own[-1]) + 1
    return np.concatenate(numbers)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
