"""Units at the edge: text such as ``12.5 in^2`` or ``22e4 psi`` to SI numbers. Inside, everything is SI."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING

from .errors import ModelError

if TYPE_CHECKING:
    import pint  # otherwise only where it is needed: it takes as long to load as everything else of a node

# A number in the notation of YAML and Python (no thousands separators, a point before decimals), then a unit or none.
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")

EVERYDAY = {
    ("um", "m"): 1e-6,
    ("mm", "m"): 1e-3,
    ("cm", "m"): 1e-2,
    ("in", "m"): 0.0254,
    ("mm^2", "m^2"): 1e-6,
    ("cm^2", "m^2"): 1e-4,
    ("in^2", "m^2"): 0.00064516,
    ("l/min", "m^3/s"): 1.666666666666667e-05,
    ("bar", "Pa"): 1e5,
    ("MPa", "Pa"): 1e6,
    ("psi", "Pa"): 6894.7572931683635,
    ("ms", "s"): 1e-3,
}
"""Factors of the units that model files are full of, which are so read without pint; they are pint's, bit by bit."""


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    registry: pint.UnitRegistry = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    registry.define("percent_opening = 0.01 = percent_open")
    return registry


def to_si(value: float | int | str, unit: str, where: str = "value") -> float:
    """``value`` in SI unit ``unit``: a number is taken to be in it, a text may carry a unit of its own.

    :raises ModelError: a text that is no number with a unit, a unit of another dimension, an angle where there must be
        none (2 rad/s is not 2 Hz), NaN or infinity; the text names ``where``.
    """
    _check_kind(value, f"12.5 {unit}", where)
    number = _from_text(value, unit, where) if isinstance(value, str) else float(value)
    if not math.isfinite(number):
        raise ModelError(f"{where}: {value!r} is not finite")
    return number


def check_quantity(value: object, where: str = "value") -> None:
    """Check that ``value`` is a number or a text of a number with a unit, whichever.

    :raises ModelError: it is neither; the text names ``where``.
    """
    _check_kind(value, "12.5 mm", where)
    if isinstance(value, str) and _QUANTITY.fullmatch(value) is None:
        raise ModelError(f"{where}: {value!r} is not a quantity; expected for example '1.5 mm'")


def _check_kind(value: object, example: str, where: str) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ModelError(f"{where}: {value!r} is not a number or a quantity such as '{example}'")


def _from_text(text: str, unit: str, where: str) -> float:
    parts = _QUANTITY.fullmatch(text)
    example = f"expected for example '1.5{'' if unit == '1' else ' ' + unit}'"
    if parts is None:
        raise ModelError(f"{where}: {text!r} is not a quantity; {example}")
    number, own = float(parts[1]), parts[2]
    if not own or own == unit:
        return number
    if (own, unit) in EVERYDAY:
        return number * EVERYDAY[own, unit]
    import pint

    try:
        quantity = _registry().Quantity(number, own)
        if _angle(quantity) != _angle(_registry().Quantity(1.0, unit)):
            raise ModelError(f"{where}: {text!r} counts angles, which {unit} does not; give it in {unit}")
        return float(quantity.to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ModelError(f"{where}: {text!r} is in {error.units1}, which does not convert to {unit}") from None
    except ModelError:
        raise
    except Exception:
        raise ModelError(f"{where}: {text!r} is not a quantity; {example}") from None


def _angle(quantity: pint.Quantity) -> float:
    """The power of the radian in a unit, which dimensional analysis takes for a plain number."""
    return float(dict(quantity.to_root_units().unit_items()).get("radian", 0))


def conversion(unit: str, si_unit: str, where: str = "unit") -> tuple[float, float]:
    """(factor, offset) so that SI = factor·value + offset.

    :raises ModelError: an unknown or other dimension.
    """
    try:
        zero = float(_registry().Quantity(0.0, unit).to(si_unit).magnitude)
        one = float(_registry().Quantity(1.0, unit).to(si_unit).magnitude)
    except Exception as error:
        raise ModelError(f"{where}: unit {unit!r} does not convert to {si_unit} ({error})") from None
    return one - zero, zero
