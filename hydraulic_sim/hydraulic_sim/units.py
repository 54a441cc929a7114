"""Units at the edge: text such as ``12.5 in^2`` or ``22e4 psi`` to SI numbers. Inside, everything is SI."""

from __future__ import annotations

import math
from functools import lru_cache

import pint

from .errors import ModelError


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    registry: pint.UnitRegistry = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    registry.define("percent_opening = 0.01 = percent_open")
    return registry


def to_si(value: float | int | str, unit: str, where: str = "value") -> float:
    """``value`` in SI unit ``unit``: a number is taken to be in it, a text may carry a unit of its own.

    Raises `ModelError` (naming ``where``) for text that is no quantity, a unit of another dimension, NaN or infinity.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ModelError(f"{where}: {value!r} is not a number or a quantity such as '12.5 {unit}'")
    if isinstance(value, str):
        try:
            quantity = _registry().Quantity(value)
            number = (
                float(quantity.to(unit).magnitude)
                if not quantity.unitless or unit == "1"
                else float(quantity.magnitude)
            )
        except pint.DimensionalityError as error:
            raise ModelError(f"{where}: {value!r} is in {error.units1}, which does not convert to {unit}") from None
        except Exception:
            raise ModelError(f"{where}: {value!r} is not a quantity; expected for example '1.5 {unit}'") from None
    else:
        number = float(value)
    if not math.isfinite(number):
        raise ModelError(f"{where}: {value!r} is not finite")
    return number


def conversion(unit: str, si_unit: str, where: str = "unit") -> tuple[float, float]:
    """(factor, offset) so that SI = factor·value + offset; raises `ModelError` for an unknown or other dimension."""
    try:
        zero = float(_registry().Quantity(0.0, unit).to(si_unit).magnitude)
        one = float(_registry().Quantity(1.0, unit).to(si_unit).magnitude)
    except Exception as error:
        raise ModelError(f"{where}: unit {unit!r} does not convert to {si_unit} ({error})") from None
    return one - zero, zero
