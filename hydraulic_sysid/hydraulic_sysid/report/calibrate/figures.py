"""Figures of a calibration. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES
from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

BEFORE, AFTER = style.MEASURED, style.HORIZON
_MANY = 5  # records from which only the bars after the fit carry numbers
_DIVERGING = [[0.0, style.FREE_RUN], [0.5, style.FAINT], [1.0, style.HORIZON]]


def changes(result: Result) -> go.Figure | None:
    """What became of each parameter, relative to its value before, with its 95 % interval; None if none is known.

    A parameter that was zero is given relative to its scale.
    """
    known = [p for p in reversed(result["parameters"]) if p["standard_error"] is not None and p["identifiable"]]
    if not known:
        return None
    size = np.array([abs(p["before"]) or p["scale"] for p in known])
    change = 100.0 * np.array([p["value"] - p["before"] for p in known]) / size
    high = 100.0 * np.array([p["interval"][1] - p["value"] for p in known]) / size
    bars = {"type": "data", "array": style.values(high), "thickness": 2, "width": 5, "color": AFTER}
    symbols = ["diamond-open" if p["at_bound"] else "circle" for p in known]
    panels = Panels(1)
    panels.line(
        0, style.values(change), np.array([p["key"] for p in known]), mode="markers", error_x=bars,
        marker={"size": 10, "color": AFTER, "symbol": symbols}, text=[f"±{h:.2g} %" for h in high],
        hovertemplate="%{y}: %{x:.3g} % %{text}<extra></extra>",
    )  # fmt: skip
    panels.x_axis(0, "change [% of the value before]", zeroline=True, zerolinewidth=2)
    panels.y_axis(0, automargin=True, type="category")
    return panels.figure(100 + 34 * len(known), hovermode="closest", margin=style.LYING)


def residuals(result: Result) -> go.Figure:
    """Residual over noise before and after: test records above those fitted, one column per channel."""
    parts = [(k, t) for k, t in (("test", "Test"), ("fit", "Fit")) if result[k] is not None]
    channels = list(dict.fromkeys(r["channel"] for part, _ in parts for r in result[part]["records"]))
    titles = [f"{title} · {TITLES.get(channel, channel)}" for _, title in parts for channel in channels]
    panels = Panels(len(parts), len(channels), gap=(0.06, 0.2), titles=titles)
    for panel in range(len(titles)):
        row, column = divmod(panel, len(channels))
        found = [r for r in result[parts[row][0]]["records"] if r["channel"] == channels[column]]
        names = np.array([r["record"] for r in found])
        for key, colour in (("before", BEFORE), ("after", AFTER)):
            numbers = [f"{r[key]:.3g}" for r in found] if key == "after" or len(found) < _MANY else None
            panels.bars(panel, names, [r[key] for r in found], key, colour, numbers, legend=panel == 0)
        bars = [r[key] for r in found for key in ("before", "after") if r[key] is not None]
        panels.over_noise(panel, bars, "× noise" if column == 0 else "")
        panels.x_axis(panel, type="category", range=[-0.5, max(len(found), 3) - 0.5])
    height = 100 + 220 * len(parts)
    margin = {**style.TITLED, "b": 76}
    return panels.figure(height, barmode="group", bargap=0.3, legend=style.below(44 / (height - 96)), margin=margin)


def correlation(result: Result) -> go.Figure:
    """Correlations of the parameters' errors as a heat map with the numbers in it."""
    keys = result["correlation"]["keys"]
    matrix = np.array(result["correlation"]["matrix"], dtype=float)
    numbers = [
        [f"{v:+.2f}".replace("-", "−") if i != j else "" for j, v in enumerate(row)] for i, row in enumerate(matrix)
    ]
    bar = {"thickness": 12, "outlinewidth": 0, "tickvals": [-1, 0, 1], "ticktext": ["−1", "0", "1"]}
    panels = Panels(1)
    panels.line(
        0, np.array(keys), np.array(keys), type="heatmap", z=style.values(matrix), zmin=-1.0, zmax=1.0,
        colorscale=_DIVERGING, xgap=2, ygap=2, text=numbers, texttemplate="%{text}", colorbar=bar,
        hovertemplate="%{y} and %{x}: %{z:.3f}<extra></extra>",
    )  # fmt: skip
    panels.x_axis(0, automargin=True, tickangle=-30, type="category", showgrid=False)
    panels.y_axis(0, automargin=True, autorange="reversed", type="category", showgrid=False)
    return panels.figure(150 + 40 * len(keys), hovermode="closest", margin=style.LYING)
