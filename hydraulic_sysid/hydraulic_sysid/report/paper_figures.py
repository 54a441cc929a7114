"""Figures of the paper's study. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from . import style
from .style import Panels

Result = dict[str, Any]

COLOURS = {"chirp": style.HORIZON, "multisine": style.FREE_RUN}
_MARGIN = {"l": 66, "r": 14, "t": 40, "b": 44}


def data(excitation: dict[str, Any]) -> go.Figure:
    """Drive and position of one excitation, and where the held-out part begins."""
    panels = Panels(2, gap=(0.0, 0.03), one_time=True)
    for panel, (key, factor, title) in enumerate((("drive", 1.0, "drive\n[V]"), ("position", 1e3, "position\n[mm]"))):
        trace = excitation["traces"][key]
        line = {"color": style.MEASURED if panel == 0 else COLOURS[excitation["excitation"]], "width": 1.3}
        panels.line(panel, style.values(trace["time"]), style.values(trace["value"], factor), key, line=line)
        panels.y_axis(panel, title, nticks=5)
        panels.shapes.append(
            {"type": "rect", "xref": "x", "yref": f"y{panel + 1 if panel else ''} domain", "y0": 0, "y1": 1,
             "x0": excitation["test_from"], "x1": excitation["duration"], "fillcolor": style.FLOOR_BAND,
             "line": {"width": 0}, "layer": "below"}
        )  # fmt: skip
    panels.x_axis(0, "time [s]", anchor="y2", mirror="all")
    return panels.figure(330, margin=_MARGIN, hovermode="x unified", hoversubplots="axis", showlegend=False)


def fit(excitation: dict[str, Any]) -> go.Figure:
    """Measured and simulated position on the held-out part, and their difference."""
    panels = Panels(2, heights=[2.0, 1.0], gap=(0.0, 0.04), one_time=True)
    for key, name, colour, width, panel in (
        ("measured", "measured", style.MEASURED, 3.2, 0),
        ("free_run", "identified model, free run", COLOURS[excitation["excitation"]], 1.5, 0),
        ("error", "difference", style.ONE_STEP, 1.2, 1),
    ):
        trace = excitation["traces"][key]
        x, y = style.values(trace["time"]), style.values(trace["value"], 1e3)
        panels.line(panel, x, y, name, legend=panel == 0, line={"color": colour, "width": width})
    panels.y_axis(0, "position\n[mm]", nticks=6)
    panels.y_axis(1, "difference\n[mm]", nticks=4)
    panels.x_axis(0, "time in the held-out part [s]", anchor="y2", mirror="all")
    return panels.figure(360, margin=_MARGIN, hovermode="x unified", hoversubplots="axis")


def rmse(result: Result) -> go.Figure:
    """RMSE of both models over the shapes: one bar per amplitude and frequency, both panels on one scale."""
    names = [e["name"] for e in result["excitations"] if e["band"] == "in"]
    shapes = list(dict.fromkeys(cell["shape"] for cell in result["grid"]))
    amplitudes = sorted({cell["amplitude"] for cell in result["grid"]})
    frequencies = sorted({cell["frequency"] for cell in result["grid"]})
    panels = Panels(len(names), gap=(0.0, 0.1), titles=[f"{name} model" for name in names])
    highest = max(cell["models"][n]["rmse"] or 0.0 for cell in result["grid"] for n in names) * 1e3
    for panel, name in enumerate(names):
        for a, amplitude in enumerate(amplitudes):
            for f, frequency in enumerate(frequencies):
                cells = {
                    c["shape"]: c["models"][name]["rmse"]
                    for c in result["grid"]
                    if c["amplitude"] == amplitude and c["frequency"] == frequency
                }
                shade = 0.35 + 0.65 * f / max(len(frequencies) - 1, 1)
                label = f"{amplitude:g} V, {frequency:.2g} Hz"
                panels.line(
                    panel,
                    np.array(shapes),
                    style.values([cells[s] for s in shapes], 1e3),
                    label,
                    legend=panel == 0,
                    type="bar",
                    marker={"color": (style.HORIZON, style.FREE_RUN)[a % 2], "opacity": shade},
                    hovertemplate="%{x}, " + label + ": %{y:.3g} mm<extra></extra>",
                )
        panels.y_axis(panel, "RMSE [mm]", range=[0.0, 1.08 * highest])
    legend = {"orientation": "h", "x": 0, "y": -0.1, "yanchor": "top"}
    return panels.figure(520, barmode="group", legend=legend, margin={**_MARGIN, "b": 90}, hovermode="closest")


def thesis(result: Result) -> go.Figure:
    """For every excitation: what its model misses of a perfect fit in the paper's band, and its RMSE over the grid."""
    rows = result["thesis"]["rows"]
    bands = list(dict.fromkeys(r["band"] for r in rows))
    words = {"in": "0.1 … 2 (the paper's)", "below": "0.01 … 0.1", "above": "2 … 20"}
    order = [b for b in ("below", "in", "above") if b in bands]
    panels = Panels(1, 2, gap=(0.1, 0.0), titles=["100 % − best fit in the paper's band", "RMSE over the grid"])
    for kind, colour in COLOURS.items():
        mine = {r["band"]: r for r in rows if r["excitation"] == kind}
        for panel, values in enumerate(
            (
                [_missing(mine.get(b)) for b in order],
                [None if b not in mine or mine[b]["rmse"] is None else 1e3 * mine[b]["rmse"] for b in order],
            )
        ):
            shown = np.array([np.nan if v is None else v for v in values], dtype=float)
            panels.line(
                panel,
                np.array([words[b] for b in order]),
                style.values(shown),
                kind,
                legend=panel == 0,
                type="bar",
                marker={"color": colour},
                text=["no stable model" if not np.isfinite(v) else f"{v:.3g}" for v in shown],
                textposition="outside",
                cliponaxis=False,
            )
    panels.y_axis(0, "%", type="log", tickformat="~g", dtick=1)
    panels.y_axis(1, "mm", type="log", tickformat="~g", dtick=1)
    for panel in (0, 1):
        panels.x_axis(panel, "excitation over the bandwidth", type="category")
    legend = {"orientation": "h", "x": 0, "y": -0.22, "yanchor": "top"}
    margin = {**_MARGIN, "t": 60, "b": 90}
    return panels.figure(380, barmode="group", bargap=0.3, legend=legend, margin=margin, hovermode="closest")


def _missing(row: dict[str, Any] | None) -> float | None:
    return None if row is None or row["best_fit_in_band"] is None else 100.0 - row["best_fit_in_band"]
