"""The same parameters fitted to each bag by itself: a campaign, shared among workers and kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.campaign import Case, Outcome, digest
from hydraulic_sysid.campaign.outcome import CaseError
from hydraulic_sysid.campaign.verb_case import code, content
from hydraulic_sysid.data.errors import RecordError
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import calibrate
from hydraulic_sysid.estimation.errors import CalibrationError

_LARGEST = 1e3  # standard error, in scales of the parameter, from which a bag says nothing


@dataclass(frozen=True)
class Estimates:
    """One parameter over n bags: names (n,), times (n,) [s since the first, or the count], values and errors (n,)."""

    key: str
    unit: str
    bags: list[str]
    times: Array
    values: Array
    errors: Array


def watched(model: Model, names: Sequence[str] = ()) -> list[str]:
    """Effects or parameters to follow: those named, or the effects that grow with wear and add no state.

    :raises hydraulic_sim.errors.ModelError: a name is neither an effect of the library nor a parameter.
    """
    if names:
        return list(dict.fromkeys(names))
    return [e.name for e in model.library.values() if e.wear and (not e.states or e.name in model.effects)]


def followed(model: Model, names: Sequence[str]) -> tuple[Model, list[str]]:
    """The model with the effects on, and the keys of the parameters to fit: those by which an effect vanishes.

    A part that wears leaves what its data sheet allows: the library's bounds hold.

    :raises hydraulic_sim.errors.ModelError: as `watched`.
    """
    keys: list[str] = []
    for name in names:
        if name in model.library:
            effect = model.library[name]
            shaped = {p.name: p.null for p in effect.parameters if p.null is not None and p.free}
            if name not in model.effects:
                model = model.with_effect(name)
            keys += [f"{name}.{p}" for p in shaped]
        else:
            model.parameter(name)
            keys.append(name)
    for key in keys:
        model = model.with_entry(key, bounds=model.parameter(key).bounds)
    return model, keys


def bag_cases(model: Path | str, bags: Mapping[str, str], columns: str | None, names: Sequence[str]) -> list[Case]:
    """A case for each bag: name → path."""
    file = load_model(model).path
    inputs = {"model": content(str(file)), "names": list(names), "columns": columns, "code": code()}
    return [
        Case(digest([inputs, content(path)]), {"bag": name}, (str(model), path, columns, list(names)))
        for name, path in bags.items()
    ]


def estimate(argument: tuple[str, str, str | None, list[str]], place: Path) -> dict[str, Any]:
    """Fit the followed parameters to one bag: values, standard errors, misfit and the bag's time.

    :raises CaseError: the bag cannot be read or fitted.
    """
    file, path, columns, names = argument
    model, keys = followed(load_model(file), names)
    try:
        records = read_all([path], columns)
        done = calibrate(model, records, keys=keys)
    except (RecordError, CalibrationError) as error:
        raise CaseError(str(error)) from error
    starts = [r.description["start_ns"] for r in records if "start_ns" in r.description]
    return {
        "start_s": min(starts) * 1e-9 if starts else None,
        "misfit": done.result["fit"]["after"],
        "parameters": {
            p["key"]: {"value": p["value"], "error": p["standard_error"], "scale": p["scale"], "unit": p["unit"]}
            for p in done.result["parameters"]
        },
    }


def gathered(outcomes: Sequence[Outcome]) -> list[Estimates]:
    """Each parameter over the bags that have a result, in the order of their times (of the bags, where one has none).

    A bag that says nothing of a parameter is left out of its series.
    """
    done = [o for o in outcomes if not o.failed]
    starts = [o.row["start_s"] for o in done]
    timed = None not in starts
    order = sorted(range(len(done)), key=lambda i: starts[i]) if timed else list(range(len(done)))
    at = {i: starts[i] - min(starts) if timed else float(i) for i in order}
    found = []
    for key in dict.fromkeys(k for o in done for k in o.row["parameters"]):
        rows = [(done[i].labels["bag"], at[i], done[i].row["parameters"].get(key)) for i in order]
        told = [(b, t, r) for b, t, r in rows if r and r["error"] is not None and r["error"] < _LARGEST * r["scale"]]
        if told:
            values, errors = (np.array([r[name] for _, _, r in told]) for name in ("value", "error"))
            times = np.array([t for _, t, _ in told])
            found.append(Estimates(key, told[0][2]["unit"], [b for b, _, _ in told], times, values, errors))
    return found
