"""Models and effects as the page shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hydraulic_sim.catalogue import describe as describe_effect
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.display import shown
from hydraulic_sysid.data.results import plain


def display(unit: str) -> dict[str, Any]:
    """Factor to, and name of, the unit that users read."""
    factor, name = shown(unit)
    return {"factor": factor, "unit": name}


def title(key: str) -> str:
    """A parameter's key in words: ``coulomb friction: level``."""
    return key.replace("_", " ").replace(".", ": ")


def describe(file: Path) -> dict[str, Any]:
    """Name, kind of plant, effects, length of the history."""
    model = load_model(file)
    added = [str(row["change"]).removeprefix("added ") for row in model.history if _adds(row)]
    return {
        "name": " + ".join([model.name, *added]),
        "kind": model.kind,
        "description": model.description,
        "effects": list(model.effects),
        "changes": len(model.history),
    }


def _adds(row: Any) -> bool:
    return str(row.get("change", "")).startswith("added ")


def whole(file: Path) -> dict[str, Any]:
    """A model with all its parameters, its history and its text."""
    model = load_model(file)
    rows = [_parameter(model, key) for key in model.keys()]  # noqa: SIM118 - a model is no mapping
    history = [dict(row) for row in model.history]
    return {**describe(file), "parameters": plain(rows), "history": plain(history), "text": file.read_text("utf-8")}


def _parameter(model: Model, key: str) -> dict[str, Any]:
    record, entry = model.parameter(key), model.entry(key)
    return {
        "key": key,
        "title": title(key),
        "description": record.description,
        "value": entry.value,
        "unit": record.unit,
        "display": display(record.unit),
        "free": bool(entry.free),
        "standard_error": entry.standard_error,
        "bounds": list(entry.bounds or ()),
        "source": entry.source,
    }


def effects(file: Path) -> list[dict[str, Any]]:
    """The effects that a model can have and has not, with their parameters."""
    model = load_model(file)
    found = []
    for name, effect in model.library.items():
        if effect.always_on or name in model.effects:
            continue
        record = describe_effect(model.library, name)
        parameters = [
            {"name": p.name, "unit": p.unit, "display": display(p.unit), "default": p.default,
             "minimum": p.bounds[0], "maximum": p.bounds[1], "description": p.description}
            for p in effect.parameters
        ]  # fmt: skip
        wanted = {key: record[key] for key in ("name", "summary", "subsystem", "equation", "excited_by")}
        found.append({**wanted, "title": name.replace("_", " "), "parameters": plain(parameters)})
    return found
