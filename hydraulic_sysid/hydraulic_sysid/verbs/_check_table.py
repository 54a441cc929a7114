"""What `calibrate --check` shows on the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sysid.data.display import number, quantity


def show(result: dict[str, Any], console: Console) -> None:
    """Every finding in a row, and in words with what to do."""
    found = result["findings"]
    rows = [
        (f["severity"], f["subject"], _value(f["measured"], f["unit"]), _value(f["stated"], f["unit"])) for f in found
    ]
    if rows:
        columns = ("|severity", "|number or channel", ">|records", ">|model file")
        console.print(tables.table(f"{result['model']['name']}: checked, nothing fitted", columns, rows))
    for f in found:
        where = f" ({', '.join(f['records'])})" if f["records"] else ""
        console.print(f"- {f['text']} {f['remedy']}{where}")
    console.print(result["verdict"]["text"])


def _value(value: float | None, unit: str) -> str:
    if value is None:
        return ""
    return number(value) if unit == "1" else quantity(value, unit)
