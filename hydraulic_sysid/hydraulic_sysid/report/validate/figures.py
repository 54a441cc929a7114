"""Figure of a validation: bars of RMSE over the grid."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

_COLOURS = (style.HORIZON, style.FREE_RUN, style.ONE_STEP, style.MEASURED)


def rmse_bars(result: dict[str, Any]) -> go.Figure:
    """RMSE of every model over amplitudes and frequencies, a panel for each shape."""
    shapes = result["settings"]["shapes"]
    factor, unit = style.shown(result["settings"]["output"]["unit"])
    rows, columns = (len(shapes) + 1) // 2, min(2, len(shapes))
    panels = Panels(rows, columns, gap=(0.08, 0.26 if rows > 1 else 0.0), titles=[s.capitalize() for s in shapes])
    for panel, shape in enumerate(shapes):
        cells = [c for c in result["grid"] if c["shape"] == shape]
        names = [f"{c['amplitude']:g} V\n{c['frequency']:g} Hz{'' if c['within_travel'] else ' *'}" for c in cells]
        for index, model in enumerate(result["models"]):
            heights = style.values([c["models"][model["name"]]["rmse"] for c in cells], factor)
            panels.bars(panel, names, heights, model["name"], _COLOURS[index % len(_COLOURS)], legend=panel == 0)
        panels.y_axis(panel, f"RMSE [{unit}]" if panel % columns == 0 else "", rangemode="tozero", nticks=6)
        panels.x_axis(panel, tickfont={"size": 10})
    legend = {"orientation": "h", "x": 0, "y": 1.06, "yanchor": "bottom", "xanchor": "left"}
    margin = {"l": 66, "r": 14, "t": 30 + 22 * len(result["models"]), "b": 50}
    return panels.figure(60 + 260 * rows, bargap=0.25, legend=legend, margin=margin)
