"""The effect library as plain data: what the `effects` verb prints and documents are made from."""

from __future__ import annotations

from . import slots
from .effect import Effect
from .registry import Library

_EFFECT = ("name", "summary", "slot", "always_on", "equation", "source", "excited_by", "distinguished_by", "wear",
           "memory")  # fmt: skip
_PARAMETER = ("name", "unit", "default", "null", "free", "description", "source")


def describe(library: Library, name: str) -> dict[str, object]:
    """Everything that an effect's record says, JSON-ready.

    :raises EffectError: an unknown name.
    """
    effect = library[name]
    slot = slots.SLOTS[effect.slot]
    return {
        **{key: getattr(effect, key) for key in _EFFECT},
        "subsystem": slot.subsystem,
        "kind": slot.kind,
        "confused_with": list(effect.confused_with),
        "parameters": [
            {**{key: getattr(p, key) for key in _PARAMETER}, "bounds": list(p.bounds)} for p in effect.parameters
        ],
        "states": [{"name": s.name, "unit": s.unit, "kind": s.kind} for s in effect.states],
        "file": str(library.source_file(name)),
    }


def parameters_line(effect: Effect) -> str:
    """The parameters in short: ``level 450 N, …``."""
    return ", ".join(f"{p.name} {p.default:g}{'' if p.unit == '1' else ' ' + p.unit}" for p in effect.parameters)
