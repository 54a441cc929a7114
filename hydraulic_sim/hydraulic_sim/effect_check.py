"""Checks a new effect before anything compiles: its units, and its kernels called in Python."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from . import base, slots
from .effect import Effect, arguments
from .errors import EffectError, ModelError
from .units import conversion

# Signals of a plant in plain motion; what can have either sign is tried with both, and at rest.
ALWAYS_POSITIVE = {"pressure_a": 6e6, "pressure_b": 5e6, "pressure_supply": 14e6, "pressure_tank": 1e5,
                   "volume_a": 1e-3, "volume_b": 1e-3, "viscosity": 1.0, "t": 0.5, "dt": 1e-3,
                   "interval": 1e-3, "into": 0.0}  # fmt: skip
EITHER_SIGN = {"position": 0.01, "velocity": 0.02, "pressure_difference": 1e6, "load_pressure": 1e6,
               "flow_supply": 1e-4, "flow_tank": 1e-4, "direction": 1.0}  # fmt: skip


def check_effect(effect: Effect, path: Path) -> None:
    """Try an effect's units and kernels.

    :raises EffectError: an unknown unit, or a kernel that does not return what its slot asks; the text names the file.
    """
    units = {p.name: p.unit for p in effect.parameters} | {s.name: s.unit for s in effect.states}
    for name, unit in units.items():
        try:
            conversion(unit, unit, name)
        except ModelError as error:
            raise EffectError(f"{path}: {error}") from None
    _check_returns(effect, path, "kernel", effect.kernel, slots.SLOTS[effect.slot].returns)
    if effect.dynamics is not None:
        wanted = []
        for state in effect.states:
            wanted += [f"d({state.name})/dt"] if state.kind == "rate" else [f"rate of {state.name}", "its target"]
        _check_returns(effect, path, "dynamics", effect.dynamics, tuple(wanted))


def _check_returns(effect: Effect, path: Path, which: str, function: Callable, wanted: tuple[str, ...]) -> None:
    values = {p.name: p.default for p in (*base.PARAMETERS, *effect.parameters)}
    plain = getattr(function, "py_func", function)
    expected = f"{len(wanted)}: {', '.join(wanted)}"
    for sign in (1.0, -1.0, 0.0):
        given = [
            np.zeros(effect.memory) if name == "memory" else values.get(name, _signal(name, sign))
            for name in arguments(plain)
        ]
        try:
            result = plain(*given)
        except ArithmeticError:
            continue  # compiled, a division by zero gives an infinity, which is found when it matters
        except Exception as error:
            raise EffectError(f"{path}: {which} fails: {type(error).__name__}: {error}") from error
        found = result if isinstance(result, tuple) else (result,)
        if len(found) != len(wanted) or (len(wanted) == 1 and isinstance(result, tuple)):
            raise EffectError(f"{path}: {which} returns {result!r}; slot {effect.slot!r} wants {expected}")
        for value in found:
            if isinstance(value, bool) or not isinstance(value, (int, float, np.floating)):
                raise EffectError(f"{path}: {which} returns {value!r}, which is not a number; wanted {expected}")


def _signal(name: str, sign: float) -> float:
    return ALWAYS_POSITIVE.get(name, sign * EITHER_SIGN.get(name, 0.1))
