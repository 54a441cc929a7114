"""From a model and records to one document: which balance is violated, by how much, where, and by which subsystem."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from hydraulic_node_utils import processors
from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.diagnosis.compare.subject import model_document

from .attribution import PARAMETERS, Attribution, attribute
from .balance_statistics import balance_entries, whiteness
from .balances import NEEDS, Balances, LocateError, formable
from .basis import Knots
from .findings import findings, verdict
from .record_balances import RecordBalances, normal_equations, record_balances, size_of
from .spectral_lines import common_lines
from .whitening import ORDER, RATE

_SHORTEST = 2.0  # s of a record
_LEAST_MOVE = 1e-6  # of its size, that a parameter at its bound may move
_ALIKE = 0.01  # of what is missing: subsystems that explain as much as the best but for this are indistinguishable


def balance_figures(model: Model, records: Sequence[Record]) -> list[dict[str, Any]]:
    """The balances of all records together, their residuals and noise, as in `locate`, without attribution.

    :raises LocateError: as `locate`.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    names = _names(model, records)
    if not names:
        return []
    balances = Balances(model, spool_measured="spool" in names)
    with ThreadPoolExecutor(max_workers=processors.usable()) as pool:
        return balance_entries(_studied(pool, balances, records, names, ()), names, maps=False)


def locate(
    model: Model, records: Sequence[Record], progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Result document (see docs/report-json.md) of a calibrated model's balances on records; arrays NumPy, SI.

    Best on a model that was calibrated; what a fit may move may still move, to first order, before anything is
    attributed to a subsystem.

    :raises LocateError: no record, or one that lacks drive or position or is too short.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    names = _names(model, records)
    keys = list(model.movable_keys()) if names else []
    studied: list[RecordBalances] = []
    found: Attribution | None = None
    lines: list[float] = []
    if names:
        balances = Balances(model, spool_measured="spool" in names)
        with ThreadPoolExecutor(max_workers=processors.usable()) as pool:
            studied = _studied(pool, balances, records, names, keys, progress)
            lines = common_lines([s.own.white for s in studied], studied[0].rate)
            found = _attributed(balances, studied, keys, lines, pool)
    result: dict[str, Any] = {
        **heading("locate", 2),
        "model": model_document(model),
        "settings": {
            "rate": studied[0].rate if studied else RATE,
            "whitening_order": ORDER,
            "refitted_parameters": keys,
            "spectral_lines": lines,
        },
        "records": [
            {"name": r.name, "source": str(r.source), "duration": r.duration, "samples": len(r)} for r in records
        ],
        "not_formed": _not_formed(model, records, names),
        "balances": balance_entries(studied, names, maps=True) if studied else [],
        "misfit": None if found is None else _misfit(found),
        "attribution": [] if found is None else _shares(found),
        "whiteness": whiteness(studied, names) if studied else {},
    }
    result["findings"] = findings(result)
    result["verdict"] = verdict(result)
    return result


def _studied(
    pool: Executor, balances: Balances, records: Sequence[Record], names: tuple[str, ...], keys: Sequence[str],
    progress: Callable[[str], None] | None = None,
) -> list[RecordBalances]:  # fmt: skip
    def one(index: int) -> RecordBalances:
        if progress is not None:
            progress(records[index].name)
        return record_balances(balances, records[index], names, keys, seed=index)

    return list(pool.map(one, range(len(records))))


def _attributed(
    balances: Balances, studied: Sequence[RecordBalances], keys: Sequence[str], lines: Sequence[float], pool: Executor
) -> Attribution:
    """Attribution over all records together."""
    knots, count = Knots.of([s.own.signals for s in studied]), len(studied)
    jobs = [(i, side) for i, s in enumerate(studied) for side in (s.own, s.reference)]
    done = list(pool.map(lambda job: normal_equations(studied[job[0]], job[1], knots, lines, job[0], count), jobs))
    _, subsystems, variables = done[0]
    own, reference = (reduce(add, [equations for equations, *_ in done[first::2]]) for first in (0, 1))
    bounds = []
    for key in keys:
        low, high = balances.model.entry(key).bounds or (-np.inf, np.inf)
        value, size = balances.plant.value(key), size_of(balances, key)
        bounds.append((min((low - value) / size, -_LEAST_MOVE), max((high - value) / size, _LEAST_MOVE)))
    bounds += [(-np.inf, np.inf)] * (subsystems.count(PARAMETERS) - len(keys))
    return attribute(own, reference, subsystems, variables, bounds)


def _misfit(found: Attribution) -> dict[str, Any]:
    """Mean square over noise of all whitened balances: of the model, refitted, and with all shares taken off."""
    return {
        "model": found.before,
        "refitted": found.refitted,
        "attributed": found.left,
        "exact_model": found.exact,
        "samples": int(found.count),
    }


def _shares(found: Attribution) -> list[dict[str, Any]]:
    best = max(s.alone for s in found.ranked)
    return [
        {
            "name": s.subsystem,
            "share": s.share,
            "alone": s.alone,
            "reduction": s.reduction,
            "variables": s.variables,
            "indistinguishable": best > 0.0 and s.alone >= best - _ALIKE,
        }
        for s in found.ranked
    ]


def _names(model: Model, records: Sequence[Record]) -> tuple[str, ...]:
    """The balances that every record allows."""
    if not records:
        raise LocateError("there is no record to form balances of")
    for record in records:
        record.require("drive", "position", error=LocateError)
        if record.duration < _SHORTEST:
            raise LocateError(f"{record.name}: {record.duration:g} s long; balances need at least {_SHORTEST:g} s")
    shared = set.intersection(*(set(r.channels) for r in records))
    return formable(model, shared)


def _not_formed(model: Model, records: Sequence[Record], names: Sequence[str]) -> list[dict[str, str]]:
    """Balances that these records do not allow, and why."""
    if model.kind == "mechanical":
        return []
    found = []
    for name, needs in NEEDS.items():
        if name not in names:
            lacking = {n: [r.name for r in records if n not in r] for n in needs}
            why = "; ".join(f"{n} is not in {', '.join(where)}" for n, where in lacking.items() if where)
            found.append({"name": name, "why": why})
    return found
