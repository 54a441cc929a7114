"""Figures of a frequency response. Each function takes the result document and returns a Plotly figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

_MARGIN = {"l": 74, "r": 14, "t": 34, "b": 44}
EVEN, ODD, NOISE, LINEAR = style.HORIZON, style.FREE_RUN, style.ONE_STEP, style.MEASURED
_CLEAR = 0.3  # coherence below which a response is not drawn
_LOG = {"type": "log", "tickformat": "~g", "dtick": 1, "minor": {"showgrid": True, "gridcolor": style.FAINT}}
_FREQUENCY = {"type": "log", "tickformat": "~g", "dtick": "D2"}


def bode(result: Result) -> go.Figure:
    """Magnitude, phase and coherence over the frequency; of multisines with the deviations of the response."""
    panels = Panels(3, heights=[2.2, 1.2, 0.9], gap=(0.0, 0.03), one_time=True)
    (down, below), (up, above) = (style.shown(result["settings"][end]["unit"]) for end in ("input", "output"))
    factor, lines = up / down, result["lines"]
    shown: list[tuple[str, str, dict[str, Any]]] = []
    if lines is not None:
        dots = {"mode": "markers", "marker": {"color": style.HORIZON, "size": 4}}
        shown.append(("lines", "best linear approximation", dots))
        x = style.values(lines["frequency"])
        for key, name, colour in (
            ("noise_std", "its deviation by noise", NOISE),
            ("total_std", "its deviation between realisations", ODD),
        ):
            if lines[key] is not None:
                panels.line(0, x, style.values(lines[key], factor), name, True, line={"color": colour, "width": 1})
    else:
        shown.append(("etfe", "empirical, smoothed", {"line": {"color": style.MEASURED, "width": 1.2}}))
    welch = (style.MEASURED, 1.2) if lines else (style.HORIZON, 2.0)
    shown.append(("welch", "Welch", {"line": dict(zip(("color", "width"), welch, strict=True))}))
    for key, name, look in shown:
        curve = result[key]
        x = style.values(curve["frequency"])
        clear = np.where(np.asarray(curve["coherence"], dtype=float) >= _CLEAR, 1.0, np.nan)
        magnitude = clear * np.asarray(curve["magnitude"], dtype=float)
        panels.line(0, x, style.values(magnitude, factor), name, legend=True, **look)
        panels.line(1, x, style.values(clear * _wrapped(curve["phase"])), name, **look)
        panels.line(2, x, style.values(curve["coherence"]), name, **look)
    panels.y_axis(0, f"magnitude\n[{above}/{below}]", **_LOG)
    panels.y_axis(1, "phase [°]", dtick=90, range=[-275.0, 95.0])
    panels.y_axis(2, "coherence", range=[0.0, 1.05], nticks=3)
    panels.x_axis(0, "frequency [Hz]", range=_span(result), **_FREQUENCY)
    return panels.figure(520, margin=_MARGIN, hovermode="closest")


def levels(result: Result) -> go.Figure | None:
    """Output at the lines played, and beside them: odd and even distortion, and noise; None without such lines."""
    lines = result["lines"]
    if lines is None:
        return None
    output = result["settings"]["output"]
    factor, unit = style.shown(output["unit"])
    panels = Panels(1)
    parts = [("output at the lines played", lines["frequency"], lines["output"], LINEAR, "circle")]
    for key, name, colour, symbol in (
        ("odd_lines", "odd distortion", ODD, "diamond"),
        ("even_lines", "even distortion", EVEN, "square"),
    ):
        if result[key] is not None:
            parts.append((name, result[key]["frequency"], result[key]["amplitude"], colour, symbol))
    if lines["distortion"] is not None:
        distortion, magnitude, played = (
            np.asarray(lines[key], dtype=float) for key in ("distortion", "magnitude", "output")
        )
        between = distortion / magnitude * played
        between[between <= 0.0] = np.nan
        parts.append(("differs between realisations", lines["frequency"], between, style.MORE[0], "x"))
    parts.append(("noise", lines["frequency"], lines["output_noise_std"], NOISE, "cross"))
    for name, x, y, colour, symbol in parts:
        panels.line(
            0, style.values(x), style.values(y, factor), name, legend=True, mode="markers",
            marker={"color": colour, "size": 5, "symbol": symbol}, hovertemplate="%{x:.3g} Hz: %{y:.3g} " + unit,
        )  # fmt: skip
    panels.x_axis(0, "frequency [Hz]", **_FREQUENCY)
    panels.y_axis(0, f"amplitude of {output['channel']} [{unit}]", **_LOG)
    return panels.figure(400, margin=_MARGIN, hovermode="closest")


def _wrapped(phase: Any) -> Any:
    """Phase [rad] in degrees between −270° and 90°: around that of an integrator."""
    return np.mod(np.degrees(np.asarray(phase, dtype=float)) + 270.0, 360.0) - 270.0


def _span(result: Result) -> list[float]:
    """Where the response is worth a look: the lines played, or where the coherence holds."""
    f = np.asarray((result["lines"] or result["welch"])["frequency"], dtype=float)
    if result["lines"] is None:
        trusted = f[np.asarray(result["welch"]["coherence"], dtype=float) >= 0.5]
        f = trusted if trusted.size > 3 else f
    return [float(np.log10(f.min() / 1.2)), float(np.log10(f.max() * 1.2))]
