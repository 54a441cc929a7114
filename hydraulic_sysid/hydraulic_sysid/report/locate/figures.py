"""Figures of a location. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import first_upper
from hydraulic_sysid.report import curves, style
from hydraulic_sysid.report.curves import Curves
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

SUBSYSTEMS = {
    "force": "Forces on the piston",
    "flow": "Leakage",
    "fluid": "Oil",
    "valve": "Valve",
    "supply": "Supply and return",
    "sensor": "Sensors",
}


def ratios(result: Result) -> go.Figure:
    """Residual of each balance over what an exact model shows."""
    known = [b for b in result["balances"] if b["ratio"] is not None]
    heights = [b["ratio"] for b in known]
    panels = Panels(1)
    names, numbers = [first_upper(b["title"]) for b in known], [f"{ratio:.3g}" for ratio in heights]
    panels.bars(0, names, heights, "residual", style.HORIZON, numbers)
    panels.over_noise(0, heights, "× exact model")
    panels.x_axis(0, type="category")
    return panels.figure(320, bargap=0.45, hovermode="closest")


def error_maps(balance: Result) -> go.Figure:
    """A balance's residual over every variable."""
    return curves.error_maps(balance["error_maps"], balance["unit"], balance["exact_rms"])


def shares(result: Result) -> go.Figure:
    """Share of each subsystem in what is missing: in the order of their taking in, and alone."""
    rows = list(reversed(result["attribution"]))
    names = np.array([SUBSYSTEMS.get(s["name"], s["name"]) for s in rows])
    ordered, alone = (np.clip([100.0 * s[k] for s in rows], 0.0, 100.0) for k in ("share", "alone"))
    panels = Panels(1)
    numbers = [f"{100.0 * s['share']:.1f} %" for s in rows]
    panels.bars(0, names, ordered, "taken in order", style.HORIZON, numbers, legend=True, lying=True)
    diamond = {"size": 11, "color": style.FREE_RUN, "symbol": "diamond-open", "line": {"width": 2}}
    panels.line(0, style.values(alone), names, "alone", True, mode="markers", marker=diamond)
    panels.x_axis(0, "share of what is missing [%]", range=[0.0, 112.0])
    return panels.figure(110 + 36 * len(rows), hovermode="closest", bargap=0.45, margin=style.LYING)


def spectra(result: Result) -> go.Figure:
    """Amplitude densities of every residual and of an exact model's, one panel per balance."""
    parts = (
        ("residual", "residual", style.FREE_RUN, "solid", 2.0),
        ("exact", "an exact model at this noise", style.FLOOR, "dot", 1.6),
    )
    known = [b for b in result["balances"] if "spectrum" in b]
    shown = [Curves(b["title"], b["unit"], b["spectrum"]["frequency"], b["spectrum"]) for b in known]
    return curves.log_panels(shown, parts, "Hz", "{}/√Hz", [b["band"][1] for b in known])


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
    return panels.figure(520, hovermode="closest", margin=style.TITLED)
