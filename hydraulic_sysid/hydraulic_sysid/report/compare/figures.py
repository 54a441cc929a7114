"""Figures of a comparison. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import first_upper
from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

_DIRECTIONS = {-1: "retracting", 0: "standing", 1: "extending"}


def overlay(result: Result, record: Result, channels: Iterable[str] = ()) -> go.Figure:
    """Measured and simulated channels (all, if none is named) of one record, the error beneath each, on one time."""
    shown = [name for name in channels or result["channels"] if name in record["channels"]]
    heights = [0.9] + [1.6, 1.0] * len(shown)
    panels = Panels(len(heights), heights=heights, gap=(0.0, 0.011), one_time=True)
    panels.trace(0, record["drive"], 1.0, "drive", style.MEASURED)
    panels.y_axis(0, "drive\n[V]", nticks=5)
    for number, name in enumerate(shown):
        factor, unit = style.shown(result["channels"][name]["unit"])
        traces, panel = record["traces"][name], 1 + 2 * number
        parts = (
            ("measured", "measured", style.MEASURED, 3.0),
            ("free_run", "free run", style.FREE_RUN, 1.3),
            ("horizon", f"{result['settings']['horizon']:g} s ahead", style.HORIZON, 1.3),
        )
        for key, label, colour, width in parts:
            panels.trace(panel, traces[key], factor, label, colour, width, legend=number == 0)
            if key != "measured":
                panels.trace(panel + 1, traces[f"{key}_error"], factor, label, colour, 1.0)
        noise = 2.0 * record["channels"][name]["noise_std"] * factor
        panels.band(panel + 1, -noise, noise)
        panels.y_axis(panel, f"{result['channels'][name]['title']}\n[{unit}]", nticks=5)
        panels.y_axis(panel + 1, f"error\n[{unit}]", nticks=5)
    panels.x_axis(0, "time [s]", anchor=f"y{len(heights)}", mirror="all")
    return panels.figure(110 + int(66 * sum(heights)), hovermode="x unified", hoversubplots="axis")


def error_maps(result: Result, channel: str, record: Result | None = None) -> go.Figure:
    """Error of one channel over every variable, of all records or one: mean, middle 80 %, noise floor."""
    maps = (record or result)["error_maps"][channel]
    names = [v for v in result["variables"] if v in maps and maps[v]["center"]]
    factor, unit = style.shown(result["channels"][channel]["unit"])
    columns = 3
    rows = max(1, -(-len(names) // columns))
    titles = [f"{_title(result, v)} · {_explains(maps[v]['explained'])}" for v in names]
    panels = Panels(rows, columns, gap=(0.03, 0.2), titles=titles)
    figures = record["channels"] if record else result["summary"]
    floor = figures[channel]["horizon"]["exact_rmse"] * factor
    for panel, name in enumerate(names):
        m = maps[name]
        scale, variable_unit = style.shown(result["variables"][name]["unit"])
        low, mean, high = (style.values(m[k], factor) for k in ("low", "mean", "high"))
        panels.band(panel, -floor, floor)
        look: dict[str, Any] = {
            "text": [f"{c} samples" for c in m["count"]],
            "hovertemplate": "%{x:.4g}: %{y:.4g}, %{text}<extra></extra>",
            "mode": "lines+markers",
            "line": {"color": style.HORIZON, "width": 2},
            "marker": {"size": 4},
        }
        if name == "direction":
            scale = 1.0
            spread = {"type": "data", "array": high - mean, "arrayminus": mean - low, "symmetric": False}
            look["error_y"] = {**spread, "thickness": 6, "width": 0, "color": style.BAND}
            look |= {"mode": "markers", "marker": {"size": 9, "color": style.HORIZON}}
            panels.x_axis(panel, tickvals=list(_DIRECTIONS), ticktext=list(_DIRECTIONS.values()), range=[-1.6, 1.6])
        x = style.values(m["center"], scale)
        if name != "direction":
            around = np.concatenate((x, x[::-1])), np.concatenate((high, low[::-1]))
            panels.line(panel, *around, fill="toself", line={"width": 0}, fillcolor=style.BAND, hoverinfo="skip")
            panels.x_axis(panel, f"[{variable_unit}]")
        panels.line(panel, x, mean, **look)
        first = panel % columns == 0
        shared = {} if panel == 0 else {"matches": "y"}
        panels.y_axis(panel, f"error [{unit}]" if first else "", showticklabels=first, **shared)
    return panels.figure(104 + 230 * rows, hovermode="closest", margin=style.TITLED)


def spectra(result: Result, record: Result) -> go.Figure:
    """Amplitude densities of measurement, free-run error and noise, one panel per channel."""
    parts = (
        ("measured", "measured", style.MEASURED, "solid", 2.5),
        ("free_run_error", "error of the free run", style.FREE_RUN, "solid", 1.6),
        ("noise", "noise", style.FLOOR, "dot", 1.5),
    )
    return _log_panels(result, record["spectra"], parts, "Hz", "{}/√Hz")


def growth(result: Result, record: Result) -> go.Figure:
    """RMS error over how far ahead was predicted, one panel per channel, beside that of an exact model."""
    parts = (
        ("rms", "error of the model", style.HORIZON, "solid", 2.0),
        ("exact_rms", "an exact model at this noise", style.FLOOR, "dot", 1.5),
    )
    return _log_panels(result, record["error_growth"], parts, "seconds ahead", "{} RMS")


def _log_panels(
    result: Result,
    source: dict[str, Any],
    parts: tuple[tuple[str, str, str, str, float], ...],
    x_title: str,
    y_unit: str,
) -> go.Figure:
    channels = [name for name in result["channels"] if name in source]
    columns = min(3, len(channels))
    rows = -(-len(channels) // columns)
    panels = Panels(rows, columns, gap=(0.08, 0.24), titles=[_title(result, name) for name in channels])
    for panel, name in enumerate(channels):
        factor, unit = style.shown(result["channels"][name]["unit"])
        x = source[name].get("frequency") or source["lead_time"]
        for key, label, colour, dash, width in parts:
            panels.line(
                panel, style.values(x), style.values(source[name][key], factor), label, panel == 0,
                line={"color": colour, "dash": dash, "width": width}, hovertemplate="%{y:.3g}",
            )  # fmt: skip
        panels.x_axis(panel, x_title, **_log_axis(x))
        curves = [v * factor for key, *_ in parts for v in source[name][key] if v]
        panels.y_axis(panel, f"[{y_unit.format(unit)}]", **_log_axis(curves))
    return panels.figure(134 + 200 * rows, legend=style.below(56 / (200 * rows)), margin={**style.TITLED, "b": 86})


def _log_axis(data: list[float]) -> dict[str, Any]:
    """A logarithmic axis whose ticks do not crowd: 1, 2, 5 over a decade or two, else decades."""
    decades = float(np.log10(max(data) / min(data))) if data else 1.0
    ticks = "D1" if decades < 0.6 else "D2" if decades < 1.7 else 1 if decades < 4.5 else 2
    return {"type": "log", "tickformat": "~g", "dtick": ticks}


def _title(result: Result, name: str) -> str:
    known = result["channels"].get(name) or result["variables"][name]
    return first_upper(known["title"])


def _explains(share: float | None) -> str:
    return "not tried" if share is None else f"explains {max(0.0, 100.0 * share):.0f} %"
