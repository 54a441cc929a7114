"""What `diagnose` and `add` show on the terminal."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sysid.diagnosis.check import warnings

_SHOWN = 8


def show(result: dict[str, Any], console: Console) -> None:
    """What contradicts the model file, the table of effects and the sentence a user reads."""
    for warning in warnings(result.get("check", ())):
        console.print(f"warning: {warning}")
    rows = [
        (
            "→" if row["added"] else "", row["name"], row["subsystem"], f"{row['residual_before']:.4g}",
            f"{row['residual_after']:.4g}", ", ".join(_value(p) for p in row["parameters"]),
        )
        for row in result["effects"][:_SHOWN]
    ]  # fmt: skip
    columns = ("", "effect", "acts on", ">before", ">after", "parameters")
    console.print(tables.table(f"{result['model']['name']}: residual over noise on validation data", columns, rows))
    console.print(result["verdict"]["text"])


def _value(parameter: dict[str, Any]) -> str:
    error, unit = parameter["standard_error"], parameter["unit"]
    low, high = parameter["interval"] or (-math.inf, math.inf)
    spread = f" ± {error:.2g}" if error is not None and error < math.inf else ""
    if parameter["at_bound"] and math.isfinite(high - low):
        spread = f" ({low:.3g} … {high:.3g})"
    return f"{parameter['key'].split('.')[1]} {parameter['value']:.4g}{spread}{'' if unit == '1' else ' ' + unit}"
