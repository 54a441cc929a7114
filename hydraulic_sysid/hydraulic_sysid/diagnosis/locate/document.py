"""From a model and records to one document: which balance is violated, by how much, over what, and whose it is."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.diagnosis.compare.document import model_document

from . import figures, words
from .balances import NEEDS, Balances, LocateError, formable
from .blame import PARAMETERS, Verdict, rank
from .knots import Knots
from .lines import common_lines
from .moments import Moments
from .noise_model import ORDER, RATE
from .study import Study, moments, size_of, study

_SHORTEST = 2.0  # s of a record
LEAST_MOVE = 1e-6  # of its size, that a parameter at its bound may move


def balance_figures(model: Model, records: Sequence[Record]) -> list[dict[str, Any]]:
    """The balances of all records together, their residuals and noise (as in `locate`), and nobody is blamed.

    :raises LocateError: as `locate`.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    names = _names(model, records)
    if not names:
        return []
    balances = Balances(model, spool_measured="spool" in names)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        return figures.balances(_studies(pool, balances, records, names, ()), names, maps=False)


def locate(
    model: Model, records: Sequence[Record], progress: Callable[[str], None] | None = None, maps: bool = True
) -> dict[str, Any]:
    """Result document (see docs/report-json.md) of a calibrated model's balances on records; arrays NumPy, SI.

    Best on a model that was calibrated; its free parameters may still move, to first order, before anything is blamed
    on a subsystem. ``maps=False`` leaves out the maps, spectra and correlations, for callers that want the ranking.

    :raises LocateError: no record, or one that lacks drive or position or is too short.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    names = _names(model, records)
    balances = Balances(model, spool_measured="spool" in names)
    keys = list(model.movable_keys()) if names else []

    studies: list[Study] = []
    verdict: Verdict | None = None
    lines: list[float] = []
    if names:
        with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
            studies = _studies(pool, balances, records, names, keys, progress)
            lines = common_lines([s.own.white for s in studies], studies[0].rate)
            verdict = judge(balances, studies, keys, lines, pool)
    entries = figures.balances(studies, names, maps) if studies else []
    result: dict[str, Any] = {
        **heading("locate", 2),
        "model": model_document(model),
        "settings": {
            "rate": studies[0].rate if studies else RATE,
            "whitening_order": ORDER,
            "refitted_parameters": keys,
            "spectral_lines": lines,
        },
        "records": [
            {"name": r.name, "source": str(r.source), "duration": r.duration, "samples": len(r)} for r in records
        ],
        "not_formed": not_formed(model, records, names),
        "balances": entries,
        "misfit": figures.misfit(verdict),
        "attribution": figures.subsystems(verdict),
        "whiteness": figures.whiteness(studies, names) if maps and studies else {},
    }
    result["findings"] = words.findings(result)
    result["verdict"] = words.verdict(result)
    return result


def _studies(
    pool: Executor, balances: Balances, records: Sequence[Record], names: tuple[str, ...], keys: Sequence[str],
    progress: Callable[[str], None] | None = None,
) -> list[Study]:  # fmt: skip
    def one(index: int) -> Study:
        if progress is not None:
            progress(records[index].name)
        return study(balances, records[index], names, keys, seed=index)

    return list(pool.map(one, range(len(records))))


def judge(
    balances: Balances, studies: Sequence[Study], keys: Sequence[str], lines: Sequence[float], pool: Executor
) -> Verdict:
    """Blame over all records together."""
    knots = Knots.of([s.own.signals for s in studies])
    jobs = [(i, side) for i in range(len(studies)) for side in ("own", "twin")]

    def one(job: tuple[int, str]) -> tuple[Moments, list[str], list[str]]:
        i, side = job
        return moments(studies[i], getattr(studies[i], side), knots, lines, i, len(studies))

    done = dict(zip(jobs, pool.map(one, jobs), strict=True))
    own, twin = (reduce(add, [done[i, side][0] for i in range(len(studies))]) for side in ("own", "twin"))
    _, subsystems, variables = done[0, "own"]
    bounds = []
    for key in keys:
        low, high = balances.model.entry(key).bounds or (-np.inf, np.inf)
        value, size = balances.plant.value(key), size_of(balances, key)
        bounds.append((min((low - value) / size, -LEAST_MOVE), max((high - value) / size, LEAST_MOVE)))
    bounds += [(-np.inf, np.inf)] * (subsystems.count(PARAMETERS) - len(keys))
    return rank(own, twin, subsystems, variables, bounds)


def _names(model: Model, records: Sequence[Record]) -> tuple[str, ...]:
    """The balances that every record allows."""
    if not records:
        raise LocateError("there is no record to form balances of")
    for record in records:
        for channel in ("drive", "position"):
            if channel not in record:
                raise LocateError(f"{record.name}: no channel {channel!r}; balances need drive and position")
        if record.duration < _SHORTEST:
            raise LocateError(f"{record.name}: {record.duration:g} s long; balances need at least {_SHORTEST:g} s")
    shared = set.intersection(*(set(r.channels) for r in records))
    return formable(model, shared)


def not_formed(model: Model, records: Sequence[Record], names: Sequence[str]) -> list[dict[str, str]]:
    """Balances that these records do not allow, and why."""
    if model.kind == "mechanical":
        return []
    found = []
    for name, needs in NEEDS.items():
        if name not in names:
            lacking: Mapping[str, list[str]] = {n: [r.name for r in records if n not in r] for n in needs}
            why = "; ".join(f"{n} is not in {', '.join(where)}" for n, where in lacking.items() if where)
            found.append({"name": name, "why": why})
    return found
