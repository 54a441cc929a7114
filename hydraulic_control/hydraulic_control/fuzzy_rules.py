"""Fuzzy rules on error and rate of error: tables as data, inference compiled.

Seven triangular sets on each of e and ė, product inference and weighted mean of singletons (M. Sugeno, T. Takagi 1985):
between the peaks this is bilinear interpolation of the table. The table of the drive is that of P. J. MacVicar-Whelan,
Fuzzy sets for man-machine interaction, Int. J. Man-Mach. Stud. 8 (1976).
"""

from __future__ import annotations

import csv
import math
from functools import lru_cache
from pathlib import Path

import numpy as np
from numba import njit

from hydraulic_control.errors import ControlError
from hydraulic_control.law import Values, number
from hydraulic_node_utils.parameter_spec import ParameterSpec

SETS = 7
SHAPE = (SETS, SETS)
_FOLDER = Path(__file__).parent / "rule_tables"


@lru_cache(maxsize=16)
def table(name: str) -> np.ndarray:
    """(7, 7) conclusions −1 … 1: rows for the error, columns for its rate, negative big to positive big.

    :raises ControlError: the file holds something else.
    """
    path = _FOLDER / f"{name}.csv"
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = [[float(cell) for cell in row[1:]] for row in list(csv.reader(stream))[1:]]
        found = np.array(rows)
    except (OSError, ValueError) as error:
        raise ControlError(f"{path}: {error}") from None
    if found.shape != SHAPE or not (np.abs(found) <= 1.0).all():
        raise ControlError(f"{path}: expected {SETS} rows and columns of numbers within −1 … 1")
    found.setflags(write=False)
    return found


def drive_rules(values: Values) -> dict[str, np.ndarray]:
    """`Law.design` of what has the table of the drive, in the field ``rules``."""
    return {"rules": table("drive")}


def scales(law: str, output: float) -> tuple[ParameterSpec, ParameterSpec, ParameterSpec]:
    """The parameters that scale error, rate and conclusion of a table."""
    return (
        number(f"{law}.error", 0.03, "error that is big", "m", 1e-6, 10.0),
        number(f"{law}.rate", 4.0, "rate of the error that is big", "m/s", 1e-6, 100.0),
        number(f"{law}.output", output, "drive of a big conclusion", "V", 0.0, 20.0),
    )


@njit(cache=True, error_model="numpy")
def place(value, scale):
    """Set below ``value`` and the share of the one above it."""
    part = min(value / scale, 1.0) if value == value else -1.0
    at = 3.0 * part + 3.0 if part > -1.0 else 0.0  # what is no number, too
    below = min(int(math.floor(at)), SETS - 2)
    return below, at - below


@njit(cache=True, error_model="numpy")
def inferred(rules, e, error, rate, rate_scale):
    """The conclusion of a table for an error ``e`` [m] and its rate [m/s] by their scales."""
    i, a = place(e, error)
    j, b = place(rate, rate_scale)
    low = (1.0 - b) * rules[i, j] + b * rules[i, j + 1]
    return (1.0 - a) * low + a * ((1.0 - b) * rules[i + 1, j] + b * rules[i + 1, j + 1])
