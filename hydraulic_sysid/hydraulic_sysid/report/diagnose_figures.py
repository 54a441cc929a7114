"""Figures of a diagnosis. Each function takes the result document, or a part of it, and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, number

from . import style
from .style import Panels

Result = dict[str, Any]

BEFORE, AFTER = style.FREE_RUN, style.HORIZON
_UNITS = {"position": "m", "pressure_a": "Pa", "pressure_b": "Pa", "drive": "V"}
_VARIABLE_UNITS = {
    "velocity": "m/s", "speed": "m/s", "position": "m", "reading": "m", "opening": "1", "size_of_opening": "1",
    "time": "s", "pressure_difference": "Pa", "size_of_pressure_difference": "Pa", "mean_pressure": "Pa",
}  # fmt: skip


def steps(result: Result) -> go.Figure:
    """The waterfall: residual over noise on validation data, before and after each effect."""
    names = ["before", *(f"+ {s['name']}" for s in result["residual"]["after_each_effect"])]
    levels = [at["validation"] for at in (result["residual"]["before"], *result["residual"]["after_each_effect"])]
    panels = Panels(1)
    panels.line(
        0,
        np.array(names),
        style.values(levels),
        type="bar",
        marker={"color": [style.MEASURED] + [AFTER] * (len(levels) - 1)},
        text=[number(v) for v in levels],
        textposition="outside",
        cliponaxis=False,
        hovertemplate="%{x}: %{y:.4g}<extra></extra>",
    )
    for i, (high, low) in enumerate(zip(levels[:-1], levels[1:], strict=True)):
        panels.line(
            0,
            np.array([names[i], names[i + 1]]),
            style.values([high, high]),
            mode="lines",
            line={"color": style.MEASURED, "width": 1, "dash": "dot"},
            hoverinfo="skip",
        )
        panels.annotations.append(
            {"x": names[i + 1], "y": np.log10(high) if _tall(levels) else high, "xref": "x", "yref": "y",
             "text": f"−{100.0 * (1.0 - low / high):.0f} %" if high - low > 0.08 * max(levels) else "",
             "showarrow": False,
             "yanchor": "bottom", "font": {"size": 12}}
        )  # fmt: skip
    _at_one(panels, 0)
    if _tall(levels):
        low, high = np.log10(min(*levels, 1.0) / 1.5), np.log10(max(levels))
        panels.y_axis(0, "× noise", type="log", range=[low, high + 0.15 * (high - low)], dtick=1, tickformat="~g")
    else:
        panels.y_axis(0, "× noise", range=[0.0, 1.2 * max(levels)])
    panels.x_axis(0, type="category", range=[-0.5, max(len(names), 3) - 0.5])
    return panels.figure(320, bargap=0.45)


def curves(curve: dict[str, Any]) -> go.Figure:
    """One segment: drive, and per channel measured, before and after, with the residuals over noise below."""
    channels = list(curve["channels"])
    panels = Panels(1 + 2 * len(channels), heights=[0.7, *([1.2, 0.8] * len(channels))], gap=(0, 0.03), one_time=True)
    time = style.values(curve["time"])
    panels.line(0, time, style.values(curve["drive"]), "drive", line={"color": style.MEASURED, "shape": "hv"})
    panels.y_axis(0, "drive [V]")
    for i, channel in enumerate(channels):
        data = curve["channels"][channel]
        factor, unit = style.shown(_UNITS.get(channel, "1"))
        row = 1 + 2 * i
        for key, colour, width in (("measured", style.MEASURED, 3), ("before", BEFORE, 1.5), ("after", AFTER, 1.5)):
            panels.line(
                row, time, style.values(data[key], factor), key, legend=i == 0, line={"color": colour, "width": width}
            )
        panels.y_axis(row, f"{TITLES.get(channel, channel)} [{unit}]")
        measured = np.asarray(data["measured"], dtype=float)
        for key, colour in (("before", BEFORE), ("after", AFTER)):
            left = (measured - np.asarray(data[key], dtype=float)) / data["noise_std"]
            panels.line(row + 1, time, style.values(left), key, line={"color": colour, "width": 1})
        panels.y_axis(row + 1, "× noise")
    panels.x_axis(0, "time [s]")
    figure = panels.figure(160 + 250 * len(channels))
    figure.update_layout(xaxis={"anchor": f"y{1 + 2 * len(channels)}"})
    return figure


def shape(curve: dict[str, Any]) -> go.Figure:
    """A curve without a law behind it, with its 95 % band."""
    x_factor, x_unit = style.shown(_VARIABLE_UNITS.get(curve["variable"], "1"))
    y_factor, y_unit = (
        (1.0, curve["unit"]) if curve["unit"] not in ("Pa", "m", "N", "1") else style.shown(curve["unit"])
    )
    x = style.values(curve["knots"], x_factor)
    panels = Panels(1)
    panels.line(0, x, style.values(curve["high"], y_factor), line={"width": 0}, hoverinfo="skip")
    panels.line(
        0, x, style.values(curve["low"], y_factor), "95 % band", legend=True, fill="tonexty", fillcolor=style.BAND,
        line={"width": 0}, hoverinfo="skip",
    )  # fmt: skip
    panels.line(
        0, x, style.values(curve["value"], y_factor), curve["summary"], legend=True, mode="lines+markers",
        line={"color": AFTER, "width": 2},
    )  # fmt: skip
    panels.x_axis(0, f"{curve['variable'].replace('_', ' ')} [{x_unit}]")
    panels.y_axis(0, f"{curve['summary'].removesuffix(' of any shape')} [{y_unit}]", zeroline=True)
    return panels.figure(340)


def balances(result: Result) -> go.Figure:
    """Ratio of each balance's residual to its noise, before and after."""
    rows = result["balances"]
    names = np.array([r["name"].replace("_", " ") for r in rows])
    panels = Panels(1)
    bars: list[float] = []
    for key, label, colour in (("ratio", "before", style.MEASURED), ("ratio_after", "after", AFTER)):
        found = [r[key] for r in rows]
        if all(v is None for v in found):
            continue
        bars += [v for v in found if v is not None]
        panels.line(
            0, names, style.values(found), label, legend=True, type="bar", marker={"color": colour},
            text=["" if v is None else number(v) for v in found], textposition="outside", cliponaxis=False,
            hovertemplate="%{x}: %{y:.3g}",
        )  # fmt: skip
    _at_one(panels, 0)
    panels.y_axis(0, "× noise", range=[0.0, 1.2 * max([*bars, 1.2])])
    panels.x_axis(0, type="category")
    return panels.figure(320, barmode="group", bargap=0.35)


def _tall(levels: list[float]) -> bool:
    return max(levels) > 30.0


def _at_one(panels: Panels, panel: int) -> None:
    name = "" if panel == 0 else str(panel + 1)
    panels.shapes.append(
        {"type": "line", "xref": f"x{name} domain", "yref": f"y{name}", "x0": 0, "x1": 1, "y0": 1, "y1": 1,
         "line": {"color": style.ONE_STEP, "width": 2, "dash": "dot"}}
    )  # fmt: skip
