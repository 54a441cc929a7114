"""Figures of a bandwidth."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import number
from hydraulic_sysid.report import style

_HALF_POWER = -3.0103  # dB


def responses(result: dict[str, Any]) -> go.Figure:
    """Velocity response over its value at low frequencies, and closed position loop, with both −3 dB frequencies."""
    f = np.asarray(result["frequency"], dtype=float)
    g = np.asarray(result["response"]["real"], dtype=float) + 1j * np.asarray(result["response"]["imaginary"])
    velocity = np.abs(2.0 * np.pi * f * g) / result["velocity_gain"]
    closed = np.asarray(result["closed_loop"]["magnitude"], dtype=float)
    panels = style.Panels(1)
    reach = result["velocity_bandwidth"] or f[-1]
    keep = (f >= 0.02 * result["position_bandwidth"]) & (f <= 5.0 * reach)
    keep &= np.arange(f.size) % max(1, int(np.count_nonzero(keep) / 1500)) == 0
    for name, magnitude, colour, at in (
        ("position, closed loop", closed, style.HORIZON, result["position_bandwidth"]),
        ("velocity, open loop", velocity, style.FREE_RUN, result["velocity_bandwidth"]),
    ):
        level = style.values(20.0 * np.log10(np.maximum(magnitude[keep], 1e-9)))
        panels.line(0, style.values(f[keep]), level, name, legend=True, line={"color": colour, "width": 2})
        if at is not None:
            ring = {"color": colour, "size": 11, "symbol": "circle-open", "line": {"width": 2}}
            at_point = style.values([at]), style.values([_HALF_POWER])
            panels.line(0, *at_point, f"{name}: {number(at)} Hz", mode="markers", marker=ring)
    panels.limit(0, y=_HALF_POWER)
    panels.x_axis(0, "frequency [Hz]", type="log", tickformat="~g")
    panels.y_axis(0, "magnitude [dB]", range=[-45.0, 35.0])
    return panels.figure(380, hovermode="closest")
