"""Figures of a monitoring. Each function takes one parameter's part of the result and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]
_DAY = 86400.0


def _time(row: Result, unit: str) -> tuple[Any, float, str]:
    """Times as shown, their factor and unit."""
    times = np.asarray(row["times"], dtype=float)
    if unit != "s":
        return times, 1.0, "bag"
    factor, name = (1.0 / _DAY, "days") if times.max(initial=0.0) > 2.0 * _DAY else (1.0 / 3600.0, "hours")
    return times * factor, factor, f"time since the first bag [{name}]"


def history(row: Result, unit: str) -> go.Figure:
    """Values with 95 % intervals over time, onset, trend and limit; below, the sums of the chart over its threshold."""
    times, factor, title = _time(row, unit)
    scale, shown = style.shown(row["unit"])
    panels = Panels(2, heights=[1.6, 0.8], gap=(0.0, 0.06), one_time=True)
    values, errors = (np.asarray(row[k], dtype=float) * scale for k in ("values", "errors"))
    bars = {"type": "data", "array": style.values(1.96 * errors), "width": 2, "thickness": 1}
    look = {"mode": "markers", "marker": {"color": style.HORIZON, "size": 6}, "error_y": bars}
    panels.line(0, style.values(times), style.values(values), "each bag, 95 %", legend=True, text=row["bags"], **look)
    alarm, trend = row["alarm"], row["trend"]
    if trend and alarm:
        ends = style.values([times[trend["since"]], times[-1]])
        line = {"color": style.FREE_RUN, "width": 2}
        panels.line(0, ends, style.values(trend["line"], scale), "trend since the onset", legend=True, line=line)
    if alarm:
        for panel in (0, 1):
            panels.limit(panel, x=float(times[alarm["onset_index"]]), colour=style.FREE_RUN)
    if row["limit"] is not None:
        panels.limit(0, y=row["limit"] * scale, colour=style.FREE_RUN)
    panels.y_axis(0, f"[{shown}]")
    sums = {"up": style.HORIZON, "down": style.ONE_STEP}
    for name, colour in sums.items():
        panels.line(
            1, style.values(times), style.values(row["chart"][name]), f"sum {name}", True, line={"color": colour}
        )
    panels.limit(1, y=row["chart"]["threshold"], colour=style.MEASURED)
    panels.y_axis(1, "CUSUM")
    panels.x_axis(0, title)
    return panels.figure(380)
