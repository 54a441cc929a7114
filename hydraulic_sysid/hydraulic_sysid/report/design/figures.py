"""Figures of a designed excitation, one plan each."""

from __future__ import annotations

from math import log10
from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

_CHANNELS = (
    ("drive", "V", style.MEASURED, "drive"),
    ("position", "m", style.HORIZON, "travel"),
    ("velocity", "m/s", style.ONE_STEP, "velocity"),
    ("pressure_a", "Pa", style.FREE_RUN, ""),
    ("pressure_b", "Pa", style.HORIZON, ""),
)
"""Channel, unit, colour, and the limit that bounds it; both pressures share a panel."""


def traces(plan: dict[str, Any], limits: dict[str, Any]) -> go.Figure:
    """Drive and what the model does under it, with the limits as dotted lines."""
    panels = Panels(4, gap=(0.0, 0.025), one_time=True)
    for number, (channel, unit, colour, bound) in enumerate(_CHANNELS):
        panel = min(number, 3)
        factor, shown = style.shown(unit)
        panels.trace(panel, plan["traces"][channel], factor, channel.replace("_", " "), colour)
        panels.y_axis(panel, f"{channel if number < 3 else 'pressures'}\n[{shown}]", nticks=5)
        limit = limits.get(bound)
        if limit is not None:
            centre = float(plan["plan"].get("centre", 0.0)) if channel == "position" else 0.0
            for end in (centre - limit, centre + limit):
                panels.limit(panel, y=end * factor, colour=style.FREE_RUN)
    return panels.figure(520, showlegend=False)


def spectrum(plan: dict[str, Any]) -> go.Figure:
    """Amplitudes of the drive's lines."""
    panels = Panels(1)
    x, y = (style.values(plan["spectrum"][k]) for k in ("frequency", "amplitude"))
    panels.line(0, x, y, "drive", line={"color": style.MEASURED, "width": 1.5})
    panels.x_axis(0, "frequency [Hz]", type="log", tickformat="~g")
    top = log10(2.0 * max(float(max(y, default=1.0)), 1e-9))
    panels.y_axis(0, "amplitude of the drive [V]", type="log", tickformat="~g", dtick=1, range=[top - 4.0, top])
    return panels.figure(260, hovermode="closest", showlegend=False)
