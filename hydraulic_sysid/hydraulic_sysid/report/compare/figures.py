"""Figures of a comparison. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.report import curves, style
from hydraulic_sysid.report.curves import Curves
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]


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
    return panels.figure(110 + int(66 * sum(heights)))


def error_maps(result: Result, channel: str, record: Result | None = None) -> go.Figure:
    """Error of one channel over every variable, of all records or one."""
    summary = record["channels"] if record else result["summary"]
    maps = (record or result)["error_maps"][channel]
    return curves.error_maps(maps, result["channels"][channel]["unit"], summary[channel]["horizon"]["exact_rmse"])


def spectra(result: Result, record: Result) -> go.Figure:
    """Amplitude densities of measurement, free-run error and noise, one panel per channel."""
    parts = (
        ("measured", "measured", style.MEASURED, "solid", 2.5),
        ("free_run_error", "error of the free run", style.FREE_RUN, "solid", 1.6),
        ("noise", "noise", style.FLOOR, "dot", 1.5),
    )
    shown = [
        Curves(known["title"], known["unit"], record["spectra"][name]["frequency"], record["spectra"][name])
        for name, known in result["channels"].items()
        if name in record["spectra"]
    ]
    return curves.log_panels(shown, parts, "Hz", "{}/√Hz")


def growth(result: Result, record: Result) -> go.Figure:
    """RMS error over how far ahead was predicted, one panel per channel, beside that of an exact model."""
    parts = (
        ("rms", "error of the model", style.HORIZON, "solid", 2.0),
        ("exact_rms", "an exact model at this noise", style.FLOOR, "dot", 1.5),
    )
    source = record["error_growth"]
    shown = [
        Curves(known["title"], known["unit"], source["lead_time"], source[name])
        for name, known in result["channels"].items()
        if name in source
    ]
    return curves.log_panels(shown, parts, "seconds ahead", "{} RMS")
