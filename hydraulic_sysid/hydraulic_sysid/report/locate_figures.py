"""Figures of a location. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, first_upper

from . import style
from .style import Panels

Result = dict[str, Any]

VARIABLE_UNITS = {
    "velocity": "m/s", "opening": "1", "load_pressure": "Pa", "position": "m", "time": "s", "direction": "1",
}  # fmt: skip
_MARGIN = {"l": 66, "r": 14, "t": 52, "b": 44}


def as_maps(result: Result) -> Result:
    """The document's maps in the form of a comparison's, whose figure shows them."""
    known = [b for b in result["balances"] if b.get("error_maps")]
    return {
        "error_maps": {b["name"]: b["error_maps"] for b in known},
        "variables": {
            n: {"unit": unit, "title": TITLES.get(n, n)}
            for n, unit in VARIABLE_UNITS.items()
            if any(n in b["error_maps"] for b in known)
        },
        "channels": {b["name"]: {"unit": b["unit"], "title": b["title"]} for b in known},
        "summary": {b["name"]: {"horizon": {"exact_rmse": b["exact_rms"]}} for b in known},
    }


def shares(result: Result, titles: Mapping[str, str]) -> go.Figure:
    """Share of each subsystem in what is missing: in the order of their taking in, and alone."""
    rows = list(reversed(result["attribution"]))
    names = np.array([titles.get(s["name"], s["name"]) for s in rows])
    panels = Panels(1)
    panels.line(
        0, np.clip(style.values([s["share"] for s in rows], 100.0), 0.0, 100.0), names, "taken in order", True,
        type="bar", orientation="h", marker={"color": style.HORIZON},
        text=[f"{100.0 * s['share']:.1f} %" for s in rows], textposition="outside", cliponaxis=False,
        hovertemplate="%{y}: %{x:.3g} %<extra></extra>",
    )  # fmt: skip
    panels.line(
        0, np.clip(style.values([s["alone"] for s in rows], 100.0), 0.0, 100.0), names, "alone", True,
        mode="markers", marker={"size": 11, "color": style.FREE_RUN, "symbol": "diamond-open", "line": {"width": 2}},
        hovertemplate="%{y} alone: %{x:.3g} %<extra></extra>",
    )  # fmt: skip
    panels.x_axis(0, "share of what is missing [%]", range=[0.0, 112.0])
    panels.y_axis(0, automargin=True, type="category")
    return panels.figure(
        110 + 36 * len(rows), hovermode="closest", bargap=0.45, margin={"l": 20, "r": 14, "t": 40, "b": 44}
    )


def spectra(result: Result) -> go.Figure:
    """Amplitude densities of every residual and of an exact model's, one panel per balance."""
    known = [b for b in result["balances"] if "spectrum" in b]
    columns = min(3, len(known))
    rows = -(-len(known) // columns)
    panels = Panels(rows, columns, gap=(0.08, 0.26), titles=[first_upper(b["title"]) for b in known])
    parts = (
        ("residual", "residual", style.FREE_RUN, "solid", 2.0),
        ("exact", "an exact model at this noise", style.FLOOR, "dot", 1.6),
    )
    for panel, b in enumerate(known):
        factor, unit = style.shown(b["unit"])
        for key, label, colour, dash, width in parts:
            panels.line(
                panel, style.values(b["spectrum"]["frequency"]), style.values(b["spectrum"][key], factor), label,
                panel == 0, line={"color": colour, "dash": dash, "width": width}, hovertemplate="%{y:.3g}",
            )  # fmt: skip
        x, y = ("x", "y") if panel == 0 else (f"x{panel + 1}", f"y{panel + 1}")
        limit = b["band"][1]
        panels.shapes.append(
            {"type": "line", "xref": x, "yref": f"{y} domain", "x0": limit, "x1": limit, "y0": 0, "y1": 1,
             "line": {"color": style.MEASURED, "width": 1, "dash": "dash"}}
        )  # fmt: skip
        panels.x_axis(panel, "Hz", type="log", dtick=1)
        panels.y_axis(panel, f"[{unit}/√Hz]", type="log", dtick=1, exponentformat="power")
    legend = {"orientation": "h", "x": 0, "y": -56 / (210 * rows), "yanchor": "top"}
    return panels.figure(134 + 210 * rows, legend=legend, margin={**_MARGIN, "b": 86})


def whiteness(result: Result) -> go.Figure:
    """Correlation of every whitened balance with itself and with the drive, the bounds grey."""
    known = result["whiteness"]
    titles = {b["name"]: first_upper(b["title"]) for b in result["balances"]}
    heads = [f"{titles[name]} · {what}" for what in ("with itself", "with the drive") for name in known]
    panels = Panels(2, len(known), gap=(0.06, 0.26), titles=heads)
    for column, w in enumerate(known.values()):
        for row, (lag, key) in enumerate((("lag", "autocorrelation"), ("cross_lag", "cross_correlation"))):
            panel = row * len(known) + column
            first = 1 if row == 0 else 0  # the correlation at lag zero is one
            panels.band(panel, -w["bound"], w["bound"])
            panels.line(
                panel, style.values(w[lag][first:], 1e3), style.values(w[key][first:]), "residual",
                line={"color": style.HORIZON, "width": 1.6}, hovertemplate="%{x:.0f} ms: %{y:.3f}<extra></extra>",
            )  # fmt: skip
            panels.x_axis(panel, "lag [ms]" if row == 1 else "")
            panels.y_axis(panel, "correlation" if column == 0 else "", nticks=5)
    return panels.figure(520, hovermode="closest", margin=_MARGIN)
