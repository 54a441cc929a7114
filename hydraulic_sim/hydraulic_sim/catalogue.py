"""The effect library as plain data: what the `effects` verb prints and documents are made from."""

from __future__ import annotations

from . import slots
from .effect import Effect, Parameter
from .registry import Library


def describe(library: Library, name: str) -> dict[str, object]:
    """Everything that an effect's record says, JSON-ready.

    :raises EffectError: an unknown name.
    """
    effect = library[name]
    slot = slots.SLOTS[effect.slot]
    return {
        "name": effect.name,
        "summary": effect.summary,
        "slot": effect.slot,
        "subsystem": slot.subsystem,
        "kind": slot.kind,
        "always_on": effect.always_on,
        "equation": effect.equation,
        "source": effect.source,
        "excited_by": effect.excited_by,
        "confused_with": list(effect.confused_with),
        "told_apart_by": effect.told_apart_by,
        "parameters": [_parameter(p) for p in effect.parameters],
        "states": [{"name": s.name, "unit": s.unit, "kind": s.kind} for s in effect.states],
        "memory": effect.memory,
        "file": str(library.source_file(name)),
    }


def _parameter(parameter: Parameter) -> dict[str, object]:
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "default": parameter.default,
        "bounds": list(parameter.bounds),
        "null": parameter.null,
        "free": parameter.free,
        "description": parameter.description,
        "source": parameter.source,
    }


def parameters_line(effect: Effect) -> str:
    """The parameters in short: ``level 450 N, …``."""
    return ", ".join(f"{p.name} {p.default:g}{'' if p.unit == '1' else ' ' + p.unit}" for p in effect.parameters)
