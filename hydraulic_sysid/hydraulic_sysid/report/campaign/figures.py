"""Figures of a campaign. Each function takes the result document and returns a Plotly figure, or None."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.data.display import number
from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]
_COLUMNS = 3


def answers(result: Result) -> go.Figure:
    """How often each answer was given."""
    names = [a["answer"] for a in result["answers"]][::-1]
    counts = [a["count"] for a in result["answers"]][::-1]
    panels = Panels(1)
    colours = [style.FREE_RUN if name == "failed" else style.HORIZON for name in names]
    panels.bars(0, names, counts, "cases", colours, [number(c) for c in counts], lying=True)
    panels.x_axis(0, "cases", rangemode="tozero")
    return panels.figure(110 + 26 * len(names), margin=style.LYING)


def distributions(result: Result) -> go.Figure | None:
    """A histogram of each figure over the cases."""
    known: Mapping[str, list[float]] = {n: v for n, v in result["distributions"].items() if v}
    if not known:
        return None
    rows = -(-len(known) // _COLUMNS)
    titles = [name.replace("_", " ").replace(".", " · ") for name in known]
    panels = Panels(rows, _COLUMNS, gap=(0.06, 0.32 / rows), titles=titles)
    for i, (name, found) in enumerate(known.items()):
        look: dict[str, Any] = {"type": "histogram", "marker": {"color": style.HORIZON}, "nbinsx": 24}
        panels.line(i, style.values(found), style.values([]), name, **look)
        del panels.traces[-1]["y"]
    for i in range(len(known), rows * _COLUMNS):
        panels.x_axis(i, visible=False)
        panels.y_axis(i, visible=False)
    return panels.figure(90 + 190 * rows, margin=style.TITLED, hovermode="closest", bargap=0.05)
