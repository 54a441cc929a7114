"""Figures of an identification. Each function takes the result document, or a part of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]


def overlay(settings: Result, record: Result) -> go.Figure:
    """Measured output, free run and one-step prediction of one record."""
    traces = record["traces"]
    input_factor, input_unit = style.shown(settings["input"]["unit"])
    factor, unit = style.shown(settings["output"]["unit"])
    panels = Panels(3, heights=[0.8, 2.0, 1.2], gap=(0.0, 0.03), one_time=True)
    parts = (
        ("input", 0, "input", style.MEASURED, 1.3, input_factor),
        ("measured", 1, "measured", style.MEASURED, 3.2, factor),
        ("free_run", 1, "free run", style.FREE_RUN, 1.5, factor),
        ("one_step", 1, "one step ahead", style.ONE_STEP, 1.5, factor),
        ("free_run_error", 2, "free run", style.FREE_RUN, 1.2, factor),
        ("one_step_error", 2, "one step ahead", style.ONE_STEP, 1.2, factor),
    )
    for key, panel, label, colour, width, scale in parts:
        panels.trace(panel, traces[key], scale, label, colour, width, legend=panel == 1)
    panels.y_axis(0, f"{settings['input']['channel']}\n[{input_unit}]", nticks=4)
    panels.y_axis(1, f"{settings['output']['channel']}\n[{unit}]", nticks=6)
    panels.y_axis(2, f"error\n[{unit}]", nticks=5)
    return panels.figure(430)


def residual_tests(record: Result) -> go.Figure | None:
    """Correlations of the one-step residual with itself and with the input, of the free run's error with the input.

    With their bounds of 99 %; None where the record was too short for the test.
    """
    tests, free = record["residual_tests"], record["free_run_tests"]
    if tests is None:
        return None
    shown = [
        ("One-step residual with itself", tests, "autocorrelation", "bound"),
        ("One-step residual with the input", tests, "cross_correlation", "cross_bound"),
    ]
    if free is not None:
        shown.append(("Free run's error with the input", free, "cross_correlation", "cross_bound"))
    panels = Panels(1, len(shown), gap=(0.06, 0.0), titles=[title for title, *_ in shown])
    for panel, (_, source, key, limit) in enumerate(shown):
        lags, bound = source["lags"], source[limit]
        y = style.values(source[key])
        x = np.arange(0 if key == "autocorrelation" else -lags, lags + 1, dtype=np.float32)
        expected = (np.abs(y) <= bound) | ((x == 0) & (key == "autocorrelation"))
        colours = [style.ONE_STEP if ok else style.FREE_RUN for ok in expected]
        panels.line(panel, x, y, type="bar", marker={"color": colours})
        panels.band(panel, -bound, bound)
        panels.x_axis(panel, "lag [samples]")
    return panels.figure(270, bargap=0.35, margin=style.TITLED)


def poles(model: Result) -> go.Figure:
    """Poles of the model: in the z plane with the unit circle, or in the s plane with the imaginary axis."""
    found = model["poles"]
    panels = Panels(1)
    if model["transfer_function"]["domain"] == "continuous":
        reach = max(1e-9, *(abs(p["imaginary"]) for p in found), *(abs(p["real"]) for p in found))
        border = style.values([0.0, 0.0]), style.values([-1.2 * reach, 1.2 * reach])
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, 181)
        border = style.values(np.cos(angle)), style.values(np.sin(angle))
    panels.line(0, *border, hoverinfo="skip", line={"color": style.FLOOR, "width": 1})
    places = style.values([p["real"] for p in found]), style.values([p["imaginary"] for p in found])
    colours = [style.HORIZON if p["stable"] else style.FREE_RUN for p in found]
    words = [f"{p['natural_frequency_hz']:.3g} Hz, damping {p['damping']:.2f}" for p in found]
    cross = {"symbol": "x", "size": 10, "color": colours}
    panels.line(0, *places, mode="markers", marker=cross, text=words, hoverinfo="text+x+y")
    panels.x_axis(0, "real")
    panels.y_axis(0, "imaginary", scaleanchor="x")
    return panels.figure(300, hovermode="closest")
