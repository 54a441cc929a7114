"""Figures of the paper's study. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

COLOURS = {"chirp": style.HORIZON, "multisine": style.FREE_RUN}
_MARGIN = {"l": 66, "r": 14, "t": 40, "b": 44}


def data(excitation: dict[str, Any]) -> go.Figure:
    """Drive and position of one excitation, and where the test data begin."""
    panels = Panels(2, gap=(0.0, 0.03), one_time=True)
    colours = style.MEASURED, COLOURS[excitation["excitation"]]
    for panel, (key, unit) in enumerate((("drive", "V"), ("position", "m"))):
        factor, shown = style.shown(unit)
        panels.trace(panel, excitation["traces"][key], factor, key, colours[panel], 1.3)
        panels.y_axis(panel, f"{key}\n[{shown}]", nticks=5)
        panels.interval(panel, excitation["test_from"], excitation["duration"])
    return panels.figure(330, margin=_MARGIN, showlegend=False)


def fit(excitation: dict[str, Any]) -> go.Figure:
    """Measured and simulated position on the test data, and their difference."""
    panels = Panels(2, heights=[2.0, 1.0], gap=(0.0, 0.04), one_time=True)
    factor, unit = style.shown("m")
    for key, name, colour, width, panel in (
        ("measured", "measured", style.MEASURED, 3.2, 0),
        ("free_run", "identified model, free run", COLOURS[excitation["excitation"]], 1.5, 0),
        ("error", "difference", style.ONE_STEP, 1.2, 1),
    ):
        panels.trace(panel, excitation["traces"][key], factor, name, colour, width, legend=panel == 0)
    panels.y_axis(0, f"position\n[{unit}]", nticks=6)
    panels.y_axis(1, f"difference\n[{unit}]", nticks=4)
    panels.x_axis(0, "time in the test data [s]")
    return panels.figure(360, margin=_MARGIN)


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
    return panels.figure(
        520, barmode="group", legend=style.below(0.1), margin={**_MARGIN, "b": 90}, hovermode="closest"
    )


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
    margin = {**_MARGIN, "t": 60, "b": 90}
    return panels.figure(380, barmode="group", bargap=0.3, legend=style.below(0.22), margin=margin, hovermode="closest")


def _missing(row: dict[str, Any] | None) -> float | None:
    return None if row is None or row["best_fit_in_band"] is None else 100.0 - row["best_fit_in_band"]
