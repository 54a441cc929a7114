"""Figures of a calibration. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES

from . import style
from .style import Panels

Result = dict[str, Any]

BEFORE, AFTER = style.MEASURED, style.HORIZON
_MANY = 5  # records from which only the bars after the fit carry numbers
_TALL = 30.0  # residual over noise from which a bar at 1 cannot be seen any more
_DIVERGING = [[0.0, style.FREE_RUN], [0.5, "rgba(128,138,150,0.10)"], [1.0, style.HORIZON]]


def changes(result: Result) -> go.Figure | None:
    """What became of each parameter, relative to its value before, with its 95 % interval; None if none is known.

    A parameter that was zero is given relative to its scale.
    """
    told = [p for p in reversed(result["parameters"]) if p["standard_error"] is not None and p["identifiable"]]
    if not told:
        return None
    size = np.array([_reference(p) for p in told])
    change = 100.0 * np.array([p["value"] - p["before"] for p in told]) / size
    high = 100.0 * np.array([p["interval"][1] - p["value"] for p in told]) / size
    panels = Panels(1)
    panels.line(
        0,
        style.values(change),
        np.array([p["key"] for p in told]),
        mode="markers",
        marker={
            "size": 10,
            "color": AFTER,
            "symbol": ["diamond-open" if p["at_bound"] else "circle" for p in told],
        },
        error_x={"type": "data", "array": style.values(high), "thickness": 2, "width": 5, "color": AFTER},
        text=[f"±{h:.2g} %" for h in high],
        hovertemplate="%{y}: %{x:.3g} % %{text}<extra></extra>",
    )
    panels.x_axis(0, "change [% of the value before]", zeroline=True, zerolinewidth=2)
    panels.y_axis(0, automargin=True, type="category")
    return panels.figure(70 + 34 * len(told) + 30, hovermode="closest", margin={"l": 20, "r": 14, "t": 34, "b": 44})


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
            panels.line(
                panel,
                names,
                style.values([r[key] for r in found]),
                key,
                legend=panel == 0,
                type="bar",
                marker={"color": colour},
                text=[f"{r[key]:.3g}" for r in found] if key == "after" or len(found) < _MANY else None,
                textposition="outside",
                textangle=0,
                cliponaxis=False,
                hovertemplate="%{x}: %{y:.3g}",
            )
        _noise_line(panels, panel)
        bars = [r[key] for r in found for key in ("before", "after") if r[key] is not None]
        panels.y_axis(panel, "× noise" if column == 0 else "", **_scale(bars))
        panels.x_axis(panel, type="category", range=[-0.5, max(len(found), 3) - 0.5])
    height = 100 + 220 * len(parts)
    legend = {"orientation": "h", "x": 0, "y": -44 / (height - 96), "yanchor": "top"}
    return panels.figure(
        height, barmode="group", bargap=0.3, legend=legend, margin={"l": 66, "r": 14, "t": 52, "b": 76}
    )


def correlation(result: Result) -> go.Figure:
    """Correlations of the parameters' errors as a heat map with the numbers in it."""
    keys = result["correlation"]["keys"]
    matrix = np.array(result["correlation"]["matrix"], dtype=float)
    panels = Panels(1)
    panels.line(
        0,
        np.array(keys),
        np.array(keys),
        type="heatmap",
        z=style.values(matrix),
        zmin=-1.0,
        zmax=1.0,
        colorscale=_DIVERGING,
        xgap=2,
        ygap=2,
        text=[[f"{v:+.2f}".replace("-", "−") if i != j else "" for j, v in enumerate(row)] for i, row in
              enumerate(matrix)],
        texttemplate="%{text}",
        hovertemplate="%{y} and %{x}: %{z:.3f}<extra></extra>",
        colorbar={"thickness": 12, "outlinewidth": 0, "tickvals": [-1, 0, 1], "ticktext": ["−1", "0", "1"]},
    )  # fmt: skip
    panels.x_axis(0, automargin=True, tickangle=-30, type="category", showgrid=False)
    panels.y_axis(0, automargin=True, autorange="reversed", type="category", showgrid=False)
    return panels.figure(150 + 40 * len(keys), hovermode="closest", margin={"l": 20, "r": 14, "t": 34, "b": 20})


def _reference(parameter: dict[str, Any]) -> float:
    """What a change is relative to: the value before, or the scale where that was zero."""
    return abs(parameter["before"]) or parameter["scale"]


def _noise_line(panels: Panels, panel: int) -> None:
    name = "" if panel == 0 else str(panel + 1)
    panels.shapes.append(
        {"type": "line", "xref": f"x{name} domain", "yref": f"y{name}", "x0": 0, "x1": 1, "y0": 1, "y1": 1,
         "line": {"color": style.ONE_STEP, "width": 2, "dash": "dot"}}
    )  # fmt: skip


def _scale(bars: list[float]) -> dict[str, Any]:
    """From zero while a residual at the noise can be seen there, else logarithmic; room for the numbers above."""
    most = max([*bars, 1.2])
    if most < _TALL:
        return {"range": [0.0, 1.2 * most], "nticks": 5}
    low, high = np.log10(min([*bars, 1.0]) / 2.0), np.log10(most)
    return {"type": "log", "range": [low, high + 0.2 * (high - low)], "dtick": 1, "tickformat": "~g"}
