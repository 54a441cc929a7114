"""Figures of a grey box: shares of what the white box leaves, and the errors over time."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.data.display import first_upper
from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]
PARTS = (
    ("noise", "noise: an exact model has it too", style.MEASURED),
    ("linear", "explained by linear terms", style.HORIZON),
    ("nonlinear", "explained by nonlinear terms", style.ONE_STEP),
    ("unexplained", "explained by neither", style.FREE_RUN),
)


def share_bars(result: Result) -> go.Figure:
    """One bar per channel: the parts of the white box's mean squared error on test data, in percent."""
    panels = Panels(1)
    channels = list(result["channels"].values())[::-1]
    names = [first_upper(c["title"]) for c in channels]
    for key, title, colour in PARTS:
        shares = [100.0 * c["shares"][key] for c in channels]
        panels.bars(0, names, shares, title, colour, legend=True, lying=True)
    panels.x_axis(0, "share of the mean squared error [%]", range=[0, 100])
    height = 130 + 50 * len(names)
    margin, legend = {**style.LYING, "b": 76}, style.below(52 / (height - 110))
    return panels.figure(height, barmode="stack", hovermode="closest", bargap=0.35, legend=legend, margin=margin)


def traces(channel: Result, record: int) -> go.Figure:
    """What the white box misses of one test record, what the black box says of it, and what is left."""
    factor, unit = style.shown(channel["unit"])
    panels = Panels(2, heights=[1.6, 1.0], gap=(0.0, 0.04), one_time=True)
    own = channel["records"][record]["traces"]
    panels.trace(0, own["white"], factor, "missed by the white box", style.MEASURED, 2.6, legend=True)
    panels.trace(0, own["black"], factor, "black box", style.HORIZON, 1.5, legend=True)
    panels.trace(1, own["grey"], factor, "left by both", style.FREE_RUN, legend=True)
    panels.y_axis(0, f"{channel['title']}\n[{unit}]", nticks=6)
    panels.y_axis(1, f"left\n[{unit}]", nticks=4)
    return panels.figure(360)
