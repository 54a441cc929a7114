"""Figures of a fleet. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]
_LIKELY = 0.5


def units(result: Result, parameter: str) -> go.Figure:
    """Values of a parameter with their 95 % intervals, unit by unit; out of family in another colour."""
    rows = sorted((r for r in result["rows"] if r["parameter"] == parameter), key=lambda r: r["unit"])
    scale, shown = style.shown(rows[0]["measure"])
    colours = [style.FREE_RUN if r["probability"] > _LIKELY else style.HORIZON for r in rows]
    bars = {"type": "data", "array": style.values([1.96 * r["error"] for r in rows], scale), "width": 3}
    panels = Panels(1)
    look: dict[str, Any] = {"mode": "markers", "marker": {"color": colours, "size": 9}, "error_y": bars}
    panels.line(
        0, np.array([r["unit"] for r in rows]), style.values([r["value"] for r in rows], scale), parameter, **look
    )
    panels.x_axis(0, type="category")
    panels.y_axis(0, f"{parameter.replace('_', ' ')} [{shown}]")
    return panels.figure(320, hovermode="closest")
