"""Figures of a rehearsal."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

_CHANNELS = (
    ("drive", "V", style.MEASURED, 0),
    ("position", "m", style.HORIZON, 1),
    ("pressure_a", "Pa", style.FREE_RUN, 2),
    ("pressure_b", "Pa", style.HORIZON, 2),
)
"""Channel, unit, colour, panel."""


def traces(result: dict[str, Any]) -> go.Figure:
    """Drive, position and pressures of the run on the model, with the limits as dotted lines."""
    panels = Panels(3, gap=(0.0, 0.03), one_time=True)
    limits = result["limits"]
    drawn = {0: [-limits["drive"], limits["drive"]], 1: limits["travel"], 2: limits["pressure"]}
    for channel, unit, colour, panel in _CHANNELS:
        factor, shown = style.shown(unit)
        panels.trace(panel, result["traces"][channel], factor, channel.replace("_", " "), colour)
        panels.y_axis(panel, f"{channel if panel < 2 else 'pressures'}\n[{shown}]", nticks=5)
        for end in drawn.pop(panel, ()):
            if end is not None:
                panels.limit(panel, y=end * factor, colour=style.FREE_RUN)
    return panels.figure(460, showlegend=False)
