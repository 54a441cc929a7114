"""Names and units as a user reads them. Results are SI; pages, tables and sentences are not."""

from __future__ import annotations

import math
from collections.abc import Sequence

SHOWN: dict[str, tuple[float, str]] = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "m^2": (1e4, "cm²"),
    "m^3": (1e6, "cm³"),
    "Pa": (1e-5, "bar"),
    "N": (1e-3, "kN"),
    "N/m": (1e-6, "kN/mm"),
    "m^3/s": (6e4, "l/min"),
    "m^3/Pa": (1e11, "cm³/bar"),
    "m^3/(s*Pa)": (6e9, "(l/min)/bar"),
    "m^3/(s*Pa^0.5)": (6e4 * 1e5**0.5, "(l/min)/√bar"),
    "1": (100.0, "%"),
}
"""SI unit → factor and unit shown; every other unit is shown as it is."""

TITLES = {
    "position": "position",
    "velocity": "velocity",
    "pressure_a": "pressure A",
    "pressure_b": "pressure B",
    "load_pressure": "load pressure",
    "pressure_supply": "supply pressure",
    "force": "force",
    "drive": "drive",
    "command": "command",
    "spool": "spool opening",
    "reference": "reference",
    "direction": "direction of motion",
    "time": "time since the start",
}
"""Channel or variable → words."""

UNITS = {
    "position": "m",
    "reading": "m",
    "velocity": "m/s",
    "speed": "m/s",
    "lagged_velocity": "m/s",
    "pressure_a": "Pa",
    "pressure_b": "Pa",
    "load_pressure": "Pa",
    "pressure_difference": "Pa",
    "size_of_pressure_difference": "Pa",
    "mean_pressure": "Pa",
    "drive": "V",
    "time": "s",
}
"""Channel or variable → SI unit; what is not here is a pure number."""

MODES = {"free_run": "Free run", "horizon": "Horizon", "one_step": "One step"}


_TYPESET = str.maketrans({"*": "·", "2": "²", "3": "³", "^": None})
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LARGE = 1e6
_SHORT = 0.1
"""Seconds below which a time is shown in milliseconds."""


def shown(unit: str) -> tuple[float, str]:
    """Factor to, and name of, the unit in which a user reads a quantity of an SI unit."""
    return SHOWN.get(unit, (1.0, unit.translate(_TYPESET)))


def number(value: float | None, digits: int = 3) -> str:
    """So many significant digits, up to a million as a whole number, with a true minus sign; a dash for no number."""
    if value is None or not math.isfinite(value):
        return "–"
    whole = 10.0 ** (digits - 1) - 0.5 <= abs(value) < _LARGE
    mantissa, _, power = (f"{value:.0f}" if whole else f"{value:.{digits}g}").partition("e")
    return (f"{mantissa}·10{str(int(power)).translate(_RAISED)}" if power else mantissa).replace("-", "−")


def quantity(value: float | None, unit: str, digits: int = 3, power: int = 1, error: float | None = None) -> str:
    """A number with the unit that users of such benches read: 0.0123 m → ``12.3 mm``; a dash for no number.

    :param digits: significant ones; with an error those that show two digits of it (`resolving`)
    :param power: of the unit, 2 for mean squares
    :param error: standard error, after ±
    """
    if value is None or not math.isfinite(value):
        return "–"
    scale, name = (1e3, "ms") if unit == "s" and 0.0 < abs(value) < _SHORT else shown(unit)
    if power == 2:
        name = f"({name})²" if "/" in name else f"{name}²"
    if error is not None:
        digits = resolving(value, error)
    spread = "" if error is None else f" ± {number(error * scale, 2)}"
    return f"{number(value * scale**power, digits)}{spread} {name}"


def resolving(value: float | None, error: float | None) -> int:
    """Significant digits of a value that show two digits of its error: 2 to 6; 4 where either is unknown or 0."""
    if not (value and error and math.isfinite(value) and math.isfinite(error) and error > 0.0):
        return 4
    return min(max(math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2, 2), 6)


def span(low: float, high: float, unit: str) -> str:
    """Two numbers with one unit: ``−546 … 579 mm``."""
    scale, name = shown(unit)
    return f"{number(low * scale)} … {number(high * scale)} {name}"


def percent(share: float | None) -> str:
    """A share in percent to one digit, with a true minus sign; a dash where there is none."""
    return "–" if share is None or share != share else f"{100.0 * share:.1f} %".replace("-", "−")


def listed(words: Sequence[str]) -> str:
    """Words one after the other: "a, b and c"."""
    return " and ".join(words) if len(words) < 3 else ", ".join(words[:-1]) + " and " + words[-1]


def first_upper(text: str) -> str:
    """The text with its first letter in upper case, the others as they are."""
    return text[:1].upper() + text[1:]
