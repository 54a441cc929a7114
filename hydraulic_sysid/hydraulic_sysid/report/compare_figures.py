"""Figures of a comparison. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import first_upper

from . import style
from .style import Panels

Result = dict[str, Any]

_MARGIN = {"l": 66, "r": 14, "t": 52, "b": 44}  # room for titles below the tool bar
_DIRECTIONS = {-1: "retracting", 0: "standing", 1: "extending"}


def overlay(result: Result, record: int) -> go.Figure:
    """Measured and simulated channels of one record, the error beneath each, all on one time axis."""
    document = result["records"][record]
    channels = [name for name in result["channels"] if name in document["channels"]]
    heights = [0.9] + [1.6, 1.0] * len(channels)
    panels = Panels(len(heights), heights=heights, gap=(0.0, 0.011), one_time=True)
    _trace(panels, 0, document["drive"], 1.0, "drive", style.MEASURED, 1.2, legend=False)
    panels.y_axis(0, "drive<br>[V]", nticks=5)
    for number, name in enumerate(channels):
        factor, unit = style.shown(result["channels"][name]["unit"])
        traces, panel = document["traces"][name], 1 + 2 * number
        parts = (
            ("measured", "measured", style.MEASURED, 3.0),
            ("free_run", "free run", style.FREE_RUN, 1.3),
            ("horizon", f"{result['settings']['horizon']:g} s ahead", style.HORIZON, 1.3),
        )
        for key, label, colour, width in parts:
            _trace(panels, panel, traces[key], factor, label, colour, width, legend=number == 0)
            if key != "measured":
                _trace(panels, panel + 1, traces[f"{key}_error"], factor, label, colour, 1.0, legend=False)
        noise = 2.0 * document["channels"][name]["noise_std"] * factor
        panels.band(panel + 1, -noise, noise)
        panels.y_axis(panel, f"{result['channels'][name]['title']}<br>[{unit}]", nticks=5)
        panels.y_axis(panel + 1, f"error<br>[{unit}]", nticks=5)
    panels.x_axis(0, "time [s]", anchor=f"y{len(heights)}", mirror="all")
    return panels.figure(110 + int(66 * sum(heights)), hovermode="x unified", hoversubplots="axis")


def error_maps(result: Result, channel: str, record: int | None = None) -> go.Figure:
    """Error of one channel over every variable, of all records or one: mean, middle 80 %, noise floor."""
    source = result if record is None else result["records"][record]
    maps = source["error_maps"][channel]
    names = [v for v in result["variables"] if v in maps and maps[v]["center"]]
    factor, unit = style.shown(result["channels"][channel]["unit"])
    columns = 3
    rows = max(1, -(-len(names) // columns))
    titles = [f"{_title(result, v)} · {_explains(maps[v]['explained'])}" for v in names]
    panels = Panels(rows, columns, gap=(0.03, 0.2), titles=titles)
    figures = result["summary"] if record is None else result["records"][record]["channels"]
    floor = figures[channel]["horizon"]["exact_rmse"] * factor
    for panel, name in enumerate(names):
        m = maps[name]
        scale, variable_unit = style.shown(result["variables"][name]["unit"])
        low, mean, high = (style.values(m[k], factor) for k in ("low", "mean", "high"))
        x = style.values(m["center"], 1.0 if name == "direction" else scale)
        panels.band(panel, -floor, floor)
        about: dict[str, Any] = {
            "text": [f"{c} samples" for c in m["count"]],
            "hovertemplate": "%{x:.4g}: %{y:.4g}, %{text}<extra></extra>",
        }
        if name == "direction":
            spread = {"type": "data", "array": high - mean, "arrayminus": mean - low, "symmetric": False}
            bars = {**spread, "thickness": 6, "width": 0, "color": style.BAND}
            panels.line(
                panel, x, mean, mode="markers", error_y=bars, marker={"size": 9, "color": style.HORIZON}, **about
            )
            panels.x_axis(panel, tickvals=list(_DIRECTIONS), ticktext=list(_DIRECTIONS.values()), range=[-1.6, 1.6])
        else:
            around = np.concatenate((x, x[::-1])), np.concatenate((high, low[::-1]))
            panels.line(panel, *around, fill="toself", line={"width": 0}, fillcolor=style.BAND, hoverinfo="skip")
            panels.line(
                panel,
                x,
                mean,
                mode="lines+markers",
                line={"color": style.HORIZON, "width": 2},
                marker={"size": 4},
                **about,
            )
            panels.x_axis(panel, f"[{variable_unit}]")
        panels.y_axis(panel, f"error [{unit}]" if panel % columns == 0 else "", **_shared(panel, columns))
    return panels.figure(104 + 230 * rows, hovermode="closest", margin=_MARGIN)


def spectra(result: Result, record: int) -> go.Figure:
    """Amplitude densities of measurement, free-run error and noise, one panel per channel."""
    document = result["records"][record]
    parts = (
        ("measured", "measured", style.MEASURED, "solid", 2.5),
        ("free_run_error", "error of the free run", style.FREE_RUN, "solid", 1.6),
        ("noise", "noise floor", style.FLOOR, "dot", 1.5),
    )
    channels = [name for name in result["channels"] if name in document["spectra"]]
    x = {name: document["spectra"][name]["frequency"] for name in channels}
    return _log_panels(result, channels, document["spectra"], x, parts, "Hz", "{}/√Hz")


def growth(result: Result, record: int) -> go.Figure:
    """RMS error over how far ahead was predicted, one panel per channel, beside that of an exact model."""
    document = result["records"][record]["error_growth"]
    parts = (
        ("rms", "error of the model", style.HORIZON, "solid", 2.0),
        ("exact_rms", "an exact model at this noise", style.FLOOR, "dot", 1.5),
    )
    channels = [name for name in result["channels"] if name in document]
    return _log_panels(
        result, channels, document, dict.fromkeys(channels, document["lead_time"]), parts, "seconds ahead", "{} RMS"
    )


def _log_panels(
    result: Result,
    channels: list[str],
    source: dict[str, Any],
    x: dict[str, Any],
    parts: tuple[tuple[str, str, str, str, float], ...],
    x_title: str,
    y_unit: str,
) -> go.Figure:
    columns = min(3, len(channels))
    rows = -(-len(channels) // columns)
    panels = Panels(rows, columns, gap=(0.08, 0.24), titles=[_title(result, name) for name in channels])
    for panel, name in enumerate(channels):
        factor, unit = style.shown(result["channels"][name]["unit"])
        for key, label, colour, dash, width in parts:
            panels.line(
                panel, style.values(x[name]), style.values(source[name][key], factor), label, panel == 0,
                line={"color": colour, "dash": dash, "width": width}, hovertemplate="%{y:.3g}",
            )  # fmt: skip
        panels.x_axis(panel, x_title, **_log_axis(x[name]))
        curves = [v * factor for key, *_ in parts for v in source[name][key] if v]
        panels.y_axis(panel, f"[{y_unit.format(unit)}]", **_log_axis(curves))
    legend = {"orientation": "h", "x": 0, "y": -56 / (200 * rows), "yanchor": "top"}
    return panels.figure(134 + 200 * rows, legend=legend, margin={**_MARGIN, "b": 86})


def _log_axis(data: list[float]) -> dict[str, Any]:
    """A logarithmic axis whose ticks do not crowd: 1, 2, 5 over a decade or two, else decades."""
    decades = float(np.log10(max(data) / min(data))) if data else 1.0
    ticks = "D1" if decades < 0.6 else "D2" if decades < 1.7 else 1 if decades < 4.5 else 2
    return {"type": "log", "tickformat": "~g", "dtick": ticks}


def _trace(
    panels: Panels,
    panel: int,
    trace: dict[str, Any],
    factor: float,
    label: str,
    colour: str,
    width: float,
    legend: bool,
) -> None:
    panels.line(
        panel, style.values(trace["time"]), style.values(trace["value"], factor), label, legend=legend,
        line={"color": colour, "width": width}, hovertemplate="%{y:.4g}",
    )  # fmt: skip


def _shared(panel: int, columns: int) -> dict[str, Any]:
    """All panels of a figure on one y scale, labelled in the first column."""
    shared: dict[str, Any] = {} if panel == 0 else {"matches": "y"}
    return shared if panel % columns == 0 else {**shared, "showticklabels": False}


def _title(result: Result, name: str) -> str:
    known = result["channels"].get(name) or result["variables"][name]
    return first_upper(known["title"])


def _explains(share: float | None) -> str:
    return "not tried" if share is None else f"explains {max(0.0, 100.0 * share):.0f} %"
