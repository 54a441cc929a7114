"""Figures of a diagnosis. Each function takes the result document, or a part of it, and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, UNITS, number
from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

BEFORE, AFTER = style.FREE_RUN, style.HORIZON


def steps(result: Result) -> go.Figure:
    """The waterfall: residual over noise on validation data, before and after each effect."""
    residual = result["residual"]
    names = ["before", *(f"+ {s['name']}" for s in residual["after_each_effect"])]
    heights = [residual["before"]["validation"], *(s["validation"] for s in residual["after_each_effect"])]
    panels = Panels(1)
    colours = [style.MEASURED] + [AFTER] * (len(heights) - 1)
    panels.bars(0, names, heights, "residual", colours, [number(v) for v in heights])
    panels.over_noise(0, heights)
    tall = panels.axes["yaxis"].get("type") == "log"
    for i, (high, low) in enumerate(zip(heights[:-1], heights[1:], strict=True)):
        dotted = {"color": style.MEASURED, "width": 1, "dash": "dot"}
        ends = np.array(names[i : i + 2]), style.values([high, high])
        panels.line(0, *ends, line=dotted, hoverinfo="skip")
        if high - low > 0.08 * max(heights):
            panels.annotations.append(
                {"x": names[i + 1], "y": np.log10(high) if tall else high, "xref": "x", "yref": "y", "showarrow": False,
                 "text": f"−{100.0 * (1.0 - low / high):.0f} %", "yanchor": "bottom", "font": {"size": 12}}
            )  # fmt: skip
    panels.x_axis(0, type="category", range=[-0.5, max(len(names), 3) - 0.5])
    return panels.figure(320, bargap=0.45)


def segment(worst: Result) -> go.Figure:
    """One segment: drive, and per channel measured, before and after, with the residuals over noise below."""
    channels = list(worst["channels"])
    panels = Panels(1 + 2 * len(channels), heights=[0.7, *([1.2, 0.8] * len(channels))], gap=(0, 0.03), one_time=True)
    time = style.values(worst["time"])
    panels.line(0, time, style.values(worst["drive"]), "drive", line={"color": style.MEASURED, "shape": "hv"})
    panels.y_axis(0, "drive\n[V]")
    for i, channel in enumerate(channels):
        data = worst["channels"][channel]
        factor, unit = style.shown(UNITS.get(channel, "1"))
        row = 1 + 2 * i
        measured = np.asarray(data["measured"], dtype=float)
        for key, colour, width in (("measured", style.MEASURED, 3), ("before", BEFORE, 1.5), ("after", AFTER, 1.5)):
            line = {"color": colour, "width": width}
            panels.line(row, time, style.values(data[key], factor), key, legend=i == 0, line=line)
            if key != "measured":
                left = (measured - np.asarray(data[key], dtype=float)) / data["noise_std"]
                panels.line(row + 1, time, style.values(left), key, line={"color": colour, "width": 1})
        panels.y_axis(row, f"{TITLES.get(channel, channel)}\n[{unit}]")
        panels.y_axis(row + 1, "× noise")
    return panels.figure(160 + 250 * len(channels))


def nonparametric(curve: Result) -> go.Figure:
    """A curve, with its 95 % band where it has one: one without a law behind it, or the law that was proposed."""
    x_factor, x_unit = style.shown(UNITS.get(curve["variable"], "1"))
    y_factor, y_unit = style.shown(curve["unit"])
    x = style.values(curve["knots"], x_factor)
    panels = Panels(1)
    look: dict[str, Any] = {"line": {"color": AFTER, "width": 2}}
    if "low" in curve:
        band: dict[str, Any] = {"line": {"width": 0}, "hoverinfo": "skip"}
        panels.line(0, x, style.values(curve["high"], y_factor), **band)
        low = style.values(curve["low"], y_factor)
        panels.line(0, x, low, "95 % band", legend=True, fill="tonexty", fillcolor=style.BAND, **band)
        look["mode"] = "lines+markers"
    panels.line(0, x, style.values(curve["value"], y_factor), curve["summary"], legend=True, **look)
    panels.x_axis(0, f"{curve['variable'].replace('_', ' ')} [{x_unit}]")
    panels.y_axis(0, f"{curve['summary'].removesuffix(' of any shape')}\n[{y_unit}]", zeroline=True)
    return panels.figure(340)


def balances(result: Result) -> go.Figure:
    """Ratio of each balance's residual to that of an exact model, before and after."""
    rows = result["balances"]
    panels, every = Panels(1), []
    for key, label, colour in (("ratio", "before", style.MEASURED), ("ratio_after", "after", AFTER)):
        found = [r[key] for r in rows]
        known = [v for v in found if v is not None]
        if known:
            numbers = ["" if v is None else number(v) for v in found]
            panels.bars(0, [r["name"].replace("_", " ") for r in rows], found, label, colour, numbers, legend=True)
            every += known
    panels.over_noise(0, every, "× exact model")
    panels.x_axis(0, type="category")
    return panels.figure(320, barmode="group", bargap=0.35)
