"""Names and units as a user reads them. Results are SI; pages, tables and sentences are not."""

from __future__ import annotations

SHOWN: dict[str, tuple[float, str]] = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "Pa": (1e-6, "MPa"),
    "N": (1e-3, "kN"),
    "m^3/s": (6e4, "l/min"),
    "V": (1.0, "V"),
    "s": (1.0, "s"),
    "1": (100.0, "%"),
}
"""SI unit → factor and unit shown."""

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

MODES = {"free_run": "Free run", "horizon": "Horizon", "one_step": "One step"}


def number(value: float) -> str:
    """Three significant digits, whole numbers from a hundred on, with a true minus sign."""
    shown = f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.3g}"
    return shown.replace("-", "−")


def quantity(value: float, unit: str) -> str:
    """A number with the unit that users of such benches read: 0.0123 m → ``12.3 mm``."""
    scale, name = SHOWN.get(unit, (1.0, unit))
    return f"{number(value * scale)} {name}"


def span(low: float, high: float, unit: str) -> str:
    """Two numbers with one unit: ``−546 … 579 mm``."""
    scale, name = SHOWN.get(unit, (1.0, unit))
    return f"{number(low * scale)} … {number(high * scale)} {name}"


def percent(share: float | None) -> str:
    """A share in percent to one digit, with a true minus sign; a dash where there is none."""
    return "–" if share is None or share != share else f"{100.0 * share:.1f} %".replace("-", "−")


def first_upper(text: str) -> str:
    """The text with its first letter in upper case, the others as they are."""
    return text[:1].upper() + text[1:]
