"""Compares a model with records and gathers every figure in one document (see docs/report-json.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from hydraulic_node_utils import processors
from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.display import TITLES, number, percent
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.estimation import noise

from . import findings
from .channels import UNITS
from .document import record_document
from .error_maps import DIRECTION_EDGES, Binning, ErrorMap, directions, error_map, folds_of, independent_samples
from .findings import Finding
from .prediction import TILES, ComparisonError, check
from .reference_run import MODES, Compared, run
from .spectra import SEGMENT_SECONDS
from .subject import Subject

Progress = Callable[[str], None]

VARIABLES = {"velocity": "m/s", "drive": "V", "spool": "1", "load_pressure": "Pa", "position": "m", "time": "s"}
DIRECTION = "direction"
_STANDING = 3.0  # standard deviations of the velocity's noise below which a piston counts as standing
HEADLINE = ("position", "load_pressure")
"""Channels whose fit stands in the verdict."""
_HEADLINE_SHARE = 0.25
_CLOSE = 0.1  # relative error up to which a model that is not exact is called close
_SECOND = 0.8  # a second variable is named if it explains at least this part of what the first explains


def compare(
    subject: Subject,
    records: Sequence[Record],
    horizon: float = 0.5,
    progress: Progress | None = None,
    keep: Callable[[Sequence[Compared]], None] | None = None,
) -> dict[str, Any]:
    """Result document of a model (`ModelSubject`) or another subject set against records; arrays are NumPy, SI.

    ``horizon``: seconds ahead of the finite-horizon prediction. ``progress`` is called with the name of each record as
    its turn comes, ``keep`` with all samples before they become figures (see `samples`).

    :raises ComparisonError: no record, or one that lacks what a comparison needs.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run over a record.
    """
    if not records:
        raise ComparisonError("there is no record to compare with")
    for record in records:
        check(record, horizon)
    compared = _run_all(subject, records, horizon, progress)
    if keep is not None:
        keep(compared)
    channels = [name for name in UNITS if any(name in c.data.compared for c in compared)]
    maps = _maps(compared, channels)
    documents = [{**record_document(c), "error_maps": _plain_maps(_maps([c], c.data.compared))} for c in compared]
    summary = {name: _pooled(documents, name) for name in channels}
    found = _findings(documents, summary, maps, horizon)
    return {
        **heading("compare", 2),
        "model": subject.document(),
        "settings": {
            "horizon": horizon,
            "horizon_part": 1.0 / TILES,
            "velocity_filter": "Savitzky–Golay derivative of the position, cubic, zero phase; length per record",
            "noise_method": noise.METHOD,
            "spectrum_segment": SEGMENT_SECONDS,
        },
        "channels": {name: {"unit": UNITS[name], "title": TITLES[name]} for name in channels},
        "variables": {
            name: {"unit": unit, "title": TITLES[name]}
            for name, unit in {**VARIABLES, "direction": "1"}.items()
            if any(name in by for by in maps.values())
        },
        "verdict": _verdict(summary, found, horizon),
        "findings": [dict(vars(f)) for f in found],
        "summary": summary,
        "error_maps": _plain_maps(maps),
        "records": documents,
    }


def _run_all(subject: Subject, records: Sequence[Record], horizon: float, progress: Progress | None) -> list[Compared]:
    """All records in their order; the plant's kernels run beside each other on as many cores as there are."""

    def one(index: int) -> Compared:
        if progress is not None:
            progress(records[index].name)
        return run(subject, records[index], horizon, seed=index)

    with ThreadPoolExecutor(max_workers=processors.usable()) as pool:
        return list(pool.map(one, range(len(records))))


def _maps(compared: Sequence[Compared], channels: Sequence[str]) -> dict[str, dict[str, ErrorMap]]:
    """Maps of every channel's horizon error over every variable that all records have, records pooled."""
    folds = folds_of([c.data.record.time for c in compared])
    values = [variables_of(c) for c in compared]
    binnings = {}
    for name in (*VARIABLES, DIRECTION):
        if all(name in known for known in values):
            edges = DIRECTION_EDGES if name == DIRECTION else None
            binnings[name] = Binning.of(np.concatenate([known[name] for known in values]), edges)
    maps: dict[str, dict[str, ErrorMap]] = {}
    for channel in channels:
        errors = [
            c.error("horizon", channel) if channel in c.data.compared else np.full(c.data.record.time.size, np.nan)
            for c in compared
        ]
        error = np.concatenate(errors)
        independent = independent_samples(error, folds)
        maps[channel] = {v: error_map(error, b, folds, independent) for v, b in binnings.items()}
    return maps


def variables_of(c: Compared) -> dict[str, Array]:
    """What the errors of a record are looked at over, each ``(N,)``."""
    time, known = c.data.record.time, c.data.channels
    found = {name: time - time[0] if name == "time" else known[name] for name in VARIABLES if name in (*known, "time")}
    return {**found, DIRECTION: directions(known["velocity"], _STANDING * c.data.noise["velocity"])}


def _plain_maps(maps: dict[str, dict[str, ErrorMap]]) -> dict[str, Any]:
    return {name: {v: dict(vars(m)) for v, m in by.items()} for name, by in maps.items()}


def _pooled(documents: Sequence[dict[str, Any]], channel: str) -> dict[str, Any]:
    """Figures over all samples of all records, per mode, and the record with the largest error."""
    parts = [(d["name"], d["channels"][channel]) for d in documents if channel in d["channels"]]
    samples = np.array([p["horizon"]["samples"] for _, p in parts], dtype=float)

    def pool(values: list[float]) -> float:
        return float(np.sqrt(np.average(np.square(values), weights=samples)))

    pooled: dict[str, Any] = {"noise_std": pool([p["noise_std"] for _, p in parts])}
    for mode in MODES:
        rmse = pool([p[mode]["rmse"] for _, p in parts])
        spread = pool([p[mode]["std"] for _, p in parts])
        exact = pool([p[mode]["exact_rmse"] for _, p in parts])
        pooled[mode] = {
            "rmse": rmse,
            "exact_rmse": exact,
            "nrmse": rmse / spread if spread > 0.0 else float("nan"),
            "bias": float(np.average([p[mode]["bias"] for _, p in parts], weights=samples)),
            "ratio": rmse / exact if exact > 0.0 else float("nan"),
            "worst_record": max(parts, key=lambda part: part[1][mode]["rmse"])[0],
        }
    return pooled


def _findings(
    documents: Sequence[dict[str, Any]],
    summary: dict[str, dict[str, Any]],
    maps: dict[str, dict[str, ErrorMap]],
    horizon: float,
) -> list[Finding]:
    """All sentences, the strongest first."""
    found: list[Finding] = []
    for channel, figures in summary.items():
        unit, at = UNITS[channel], figures["horizon"]
        noise_std = figures["noise_std"]
        size = findings.size_finding(channel, unit, at["rmse"], at["exact_rmse"], noise_std, horizon)
        found.append(size)
        if size.kind == "at_noise":
            continue
        constant = findings.bias_finding(channel, unit, at["bias"], at["rmse"])
        found += [constant] if constant is not None else []
        units = {**VARIABLES, "direction": "1"}
        patterns = [findings.map_finding(channel, unit, v, units[v], m) for v, m in maps[channel].items()]
        ranked = sorted((p for p in patterns if p is not None), key=lambda p: -p.weight)
        others = [p for p in ranked if p.kind == "depends_on"]
        found += [p for p in others[:2] if p.weight >= _SECOND * others[0].weight]
        found += [p for p in ranked if p.kind == "amplitude"][:1]
        worst = next(d for d in documents if d["name"] == figures["free_run"]["worst_record"])
        spectrum = worst["spectra"][channel]
        banded = findings.frequency_finding(
            channel, worst["name"], spectrum["frequency"], spectrum["free_run_error"], spectrum["noise"]
        )
        found += [banded] if banded is not None else []
    for document in documents:
        free = document["channels"]["position"]["free_run"]
        drift = findings.drift_finding(
            free["drift"], free["rmse_detrended"], free["rmse"], document["name"], document["duration"]
        )
        found += [drift] if drift is not None else []
    order = {"above_noise": 0, "at_noise": 0, "bias": 1, "depends_on": 1, "amplitude": 2, "frequency": 3, "drift": 4}
    return sorted(found, key=lambda f: (order[f.kind], -f.weight))


def _verdict(summary: dict[str, dict[str, Any]], found: Sequence[Finding], horizon: float) -> dict[str, Any]:
    """One sentence on top of the page, and a level: explained, close or off."""
    at = {name: s["horizon"] for name, s in summary.items()}
    missed = sorted((n for n in at if at[n]["ratio"] > findings.AT_FLOOR), key=lambda n: -at[n]["ratio"])
    if not missed:
        text = f"The model explains these records to within the measurement noise, {horizon:g} s ahead."
        return {"level": "explained", "text": text}
    fits = [f"{TITLES[n]} to {percent(1.0 - at[n]['nrmse'])}" for n in HEADLINE if n in at]
    text = (
        f"{horizon:g} s ahead the model fits {' and '.join(fits)}. Its errors are up to "
        f"{number(at[missed[0]]['ratio'])} times ({TITLES[missed[0]]}) what an exact model would show "
        "at this noise."
    )
    patterns = [f for f in found if f.kind in ("bias", "depends_on") and f.weight >= _HEADLINE_SHARE]
    if patterns:
        text += f" {patterns[0].text}"
    else:
        text += " No single variable explains most of them."
    return {"level": "close" if all(at[n]["nrmse"] <= _CLOSE for n in missed) else "off", "text": text}
