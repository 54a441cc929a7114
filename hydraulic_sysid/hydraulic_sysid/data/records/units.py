"""Factors from the units of files to SI."""

from __future__ import annotations

from hydraulic_sysid.data.errors import ColumnMapError
from hydraulic_sysid.data.records.channels import CHANNELS, TIME_UNIT


def si_unit(quantity: str) -> str:
    """SI unit of a channel or of "time"."""
    return TIME_UNIT if quantity == "time" else CHANNELS[quantity].unit


def to_si(unit: str, quantity: str, where: str) -> tuple[float, float]:
    """``(factor, offset)`` with SI = factor·value + offset, for values of ``quantity`` given in ``unit``.

    :raises ColumnMapError: a unit that does not exist, or one of another dimension.
    """
    wanted = si_unit(quantity)
    if unit == wanted:
        return 1.0, 0.0
    # Loaded only where a unit is to be converted: pint takes a good part of a second.
    from hydraulic_sim.errors import ModelError
    from hydraulic_sim.units import conversion

    if not unit.strip():
        raise ColumnMapError(f"{where}: no unit; expected one that converts to {wanted}")
    try:
        return conversion(unit.replace("_per_", "/").replace("_", " "), wanted)
    except ModelError:
        raise ColumnMapError(f"{where}: unit {unit!r} does not convert to {wanted}") from None
