"""Figures of the paper's study. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

COLOURS = {"chirp": style.HORIZON, "multisine": style.FREE_RUN}
_BANDS = {"below": "0.01 … 0.1", "in": "0.1 … 2 (the paper's)", "above": "2 … 20"}
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
    names, grid = [e["name"] for e in result["excitations"] if e["band"] == "in"], result["grid"]
    shapes = list(dict.fromkeys(cell["shape"] for cell in grid))
    amplitudes, frequencies = (sorted({cell[key] for cell in grid}) for key in ("amplitude", "frequency"))
    panels = Panels(len(names), gap=(0.0, 0.1), titles=[f"{name} model" for name in names])
    factor, unit = style.shown("m")
    highest = max(cell["models"][n]["rmse"] or 0.0 for cell in grid for n in names) * factor
    for panel, name in enumerate(names):
        for a, f in np.ndindex(len(amplitudes), len(frequencies)):
            drive = amplitudes[a], frequencies[f]
            cells = {c["shape"]: c for c in grid if (c["amplitude"], c["frequency"]) == drive}
            heights = style.values([cells[shape]["models"][name]["rmse"] for shape in shapes], factor)
            shade = 0.35 + 0.65 * f / max(len(frequencies) - 1, 1)
            label, colour = f"{drive[0]:g} V, {drive[1]:.2g} Hz", (style.HORIZON, style.FREE_RUN)[a % 2]
            panels.bars(panel, shapes, heights, label, colour, legend=panel == 0, opacity=shade)
        panels.y_axis(panel, f"RMSE [{unit}]", range=[0.0, 1.08 * highest])
    margin = {**_MARGIN, "b": 90}
    return panels.figure(520, barmode="group", legend=style.below(0.1), margin=margin, hovermode="closest")


def thesis(result: Result) -> go.Figure:
    """For every excitation: what its model misses of a perfect fit in the paper's band, and its RMSE over the grid."""
    rows = {(r["excitation"], r["band"]): r for r in result["thesis"]["rows"]}
    bands = [b for b in _BANDS if b in {band for _, band in rows}]
    factor, unit = style.shown("m")
    panels = Panels(1, 2, gap=(0.1, 0.0), titles=["100 % − best fit in the paper's band", "RMSE over the grid"])
    for kind, colour in COLOURS.items():
        mine = [rows.get((kind, band), {"best_fit_in_band": None, "rmse": None}) for band in bands]
        missing = 100.0 - style.values([r["best_fit_in_band"] for r in mine])
        for panel, heights in enumerate((missing, style.values([r["rmse"] for r in mine], factor))):
            numbers = ["no stable model" if not np.isfinite(v) else f"{v:.3g}" for v in heights]
            panels.bars(panel, [_BANDS[b] for b in bands], heights, kind, colour, numbers, legend=panel == 0)
    for panel, title in enumerate(("%", unit)):
        panels.y_axis(panel, title, type="log", tickformat="~g", dtick=1)
        panels.x_axis(panel, "excitation over the bandwidth", type="category")
    margin = {**_MARGIN, "t": 60, "b": 90}
    return panels.figure(380, barmode="group", bargap=0.3, legend=style.below(0.22), margin=margin, hovermode="closest")
