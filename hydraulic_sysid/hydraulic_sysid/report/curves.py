"""Figures that several results have: errors over variables, and curves over frequency or time ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, UNITS, first_upper

from . import style
from .style import Panels

_DIRECTIONS = {-1: "retracting", 0: "standing", 1: "extending"}


@dataclass(frozen=True)
class Curves:
    """What one panel shows on logarithmic axes: a title, the unit of y, and x beside several y."""

    title: str
    unit: str
    x: list[float]
    y: dict[str, list[float]]


def log_panels(
    shown: Sequence[Curves],
    parts: Sequence[tuple[str, str, str, str, float]],
    x_title: str,
    y_unit: str,
    marks: Sequence[float] = (),
) -> go.Figure:
    """A panel for each of the curves, three in a row; parts are key, label, colour, dash and width of a line.

    :param y_unit: with braces for the unit shown, as ``{}/√Hz``
    :param marks: x of a dotted line in every panel
    """
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    panels = Panels(rows, columns, gap=(0.08, 0.25), titles=[first_upper(curves.title) for curves in shown])
    for panel, curves in enumerate(shown):
        factor, unit = style.shown(curves.unit)
        for key, label, colour, dash, width in parts:
            panels.line(
                panel, style.values(curves.x), style.values(curves.y[key], factor), label, panel == 0,
                line={"color": colour, "dash": dash, "width": width}, hovertemplate="%{y:.3g}",
            )  # fmt: skip
        if panel < len(marks):
            panels.limit(panel, x=marks[panel])
        panels.x_axis(panel, x_title, **_log_axis(curves.x))
        panels.y_axis(
            panel,
            f"[{y_unit.format(unit)}]",
            **_log_axis([v * factor for key, *_ in parts for v in curves.y[key] if v]),
        )
    return panels.figure(134 + 205 * rows, legend=style.below(56 / (205 * rows)), margin={**style.TITLED, "b": 86})


def error_maps(maps: dict[str, Any], unit: str, exact: float) -> go.Figure:
    """An error in bins of each variable: mean, middle 80 %, and the RMS error of an exact model, all on one scale."""
    names = [name for name in maps if maps[name]["center"]]
    factor, shown = style.shown(unit)
    columns = 3
    rows = max(1, -(-len(names) // columns))
    titles = [f"{first_upper(TITLES.get(name, name))} · {_explains(maps[name]['explained'])}" for name in names]
    panels = Panels(rows, columns, gap=(0.03, 0.2), titles=titles)
    for panel, name in enumerate(names):
        found = maps[name]
        low, mean, high = (style.values(found[k], factor) for k in ("low", "mean", "high"))
        panels.band(panel, -exact * factor, exact * factor)
        look: dict[str, Any] = {
            "text": [f"{c} samples" for c in found["count"]],
            "hovertemplate": "%{x:.4g}: %{y:.4g}, %{text}<extra></extra>",
        }
        if name == "direction":
            x = style.values(found["center"])
            spread = {"type": "data", "array": high - mean, "arrayminus": mean - low, "symmetric": False}
            look |= {"mode": "markers", "marker": {"size": 9, "color": style.HORIZON}}
            look["error_y"] = {**spread, "thickness": 6, "width": 0, "color": style.BAND}
            panels.x_axis(panel, tickvals=list(_DIRECTIONS), ticktext=list(_DIRECTIONS.values()), range=[-1.6, 1.6])
        else:
            scale, variable_unit = style.shown(UNITS.get(name, "1"))
            x = style.values(found["center"], scale)
            look |= {"mode": "lines+markers", "line": {"color": style.HORIZON, "width": 2}, "marker": {"size": 4}}
            around = np.concatenate((x, x[::-1])), np.concatenate((high, low[::-1]))
            panels.line(panel, *around, fill="toself", line={"width": 0}, fillcolor=style.BAND, hoverinfo="skip")
            panels.x_axis(panel, f"[{variable_unit}]")
        panels.line(panel, x, mean, **look)
        first = panel % columns == 0
        shared = {} if panel == 0 else {"matches": "y"}
        panels.y_axis(panel, f"error [{shown}]" if first else "", showticklabels=first, **shared)
    return panels.figure(104 + 230 * rows, hovermode="closest", margin=style.TITLED)


def _log_axis(data: list[float]) -> dict[str, Any]:
    """A logarithmic axis whose ticks do not crowd: 1, 2, 5 over a decade or two, else decades."""
    decades = float(np.log10(max(data) / min(data))) if data else 1.0
    ticks = "D1" if decades < 0.6 else "D2" if decades < 1.7 else 1 if decades < 4.5 else 2
    return {"type": "log", "tickformat": "~g", "dtick": ticks}


def _explains(share: float | None) -> str:
    return "not tried" if share is None else f"explains {max(0.0, 100.0 * share):.0f} %"
