"""A bandwidth on the page."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import number

from . import style
from .html import Figures, made_on, section, tag, text
from .style import Panels

Result = dict[str, Any]

_SOURCES = {
    "model": "Linearised around rest, without dry friction: the least damping, and so the bandwidth to count on.",
    "simulation": "A probe played on the model, with friction and the damping of an open valve at that amplitude.",
    "record": "Measured by a probe, with the damping that the plant has at that amplitude.",
}


def html(result: Result, place: Figures) -> str:
    """The bandwidth's part of the page."""
    verdict = result["verdict"]
    kind = tag("div", f"Bandwidth · {made_on(result)}", "kind")
    title = tag("h1", text(result["source"]["name"])) + tag("p", _SOURCES[result["source"]["kind"]], "lead")
    return (
        tag("header", kind + title, "top")
        + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")
        + _cards(result)
        + _definition(result, place)
    )


def _cards(result: Result) -> str:
    low, high = result["excitation_band"]
    cards = (
        ("Position bandwidth", f"{number(result['position_bandwidth'])}<small> Hz</small>", "closed loop, −3 dB"),
        ("Excite", f"{low:.2g} … {high:.2g}<small> Hz</small>", "0.1 … 2 times the position bandwidth"),
        ("Velocity bandwidth", f"{_or_beyond(result)}<small> Hz</small>", "open loop, −3 dB"),
        (
            "Critical gain",
            f"{number(result['critical_gain'])}<small> V/m</small>",
            f"at {number(result['phase_crossover'])} Hz",
        ),
    )
    return tag(
        "div",
        "".join(
            tag("div", tag("div", a, "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _or_beyond(result: Result) -> str:
    """The velocity bandwidth, or the end of the response that lies below it."""
    found = result["velocity_bandwidth"]
    return f"&gt; {number(result['frequency'][-1])}" if found is None else number(found)


def _definition(result: Result, place: Figures) -> str:
    lead = (
        "The plant integrates, so that its position response has no −3 dB frequency of its own. The position "
        f"bandwidth is that of the loop closed at {100 * result['gain_share']:.0f} % of the critical gain (gain margin "
        "6 dB): how fast the actuator can be told to move. The velocity bandwidth says how fast valve and oil follow."
    )
    return section("Responses", lead, place.place(responses(result)))


def responses(result: Result) -> go.Figure:
    """Velocity response over its value at low frequencies, and closed position loop, with both −3 dB frequencies."""
    f = np.asarray(result["frequency"], dtype=float)
    g = np.asarray(result["response"]["real"], dtype=float) + 1j * np.asarray(result["response"]["imaginary"])
    velocity = np.abs(2.0 * np.pi * f * g) / result["velocity_gain"]
    closed = np.asarray(result["closed_loop"]["magnitude"], dtype=float)
    panels = Panels(1)
    reach = result["velocity_bandwidth"] or f[-1]
    keep = (f >= 0.02 * result["position_bandwidth"]) & (f <= 5.0 * reach)
    keep &= np.arange(f.size) % max(1, int(np.count_nonzero(keep) / 1500)) == 0
    for name, magnitude, colour, at in (
        ("position, closed loop", closed, style.HORIZON, result["position_bandwidth"]),
        ("velocity, open loop", velocity, style.FREE_RUN, result["velocity_bandwidth"]),
    ):
        level = 20.0 * np.log10(np.maximum(magnitude[keep], 1e-9))
        panels.line(
            0, style.values(f[keep]), style.values(level), name, legend=True, line={"color": colour, "width": 2}
        )
        if at is None:
            continue
        panels.line(
            0, style.values([at]), style.values([-3.0103]), f"{name}: {number(at)} Hz", mode="markers",
            marker={"color": colour, "size": 11, "symbol": "circle-open", "line": {"width": 2}},
        )  # fmt: skip
    panels.shapes.append(
        {"type": "line", "xref": "x domain", "yref": "y", "x0": 0, "x1": 1, "y0": -3.0103, "y1": -3.0103,
         "line": {"color": style.MEASURED, "width": 1, "dash": "dot"}}
    )  # fmt: skip
    panels.x_axis(0, "frequency [Hz]", type="log", tickformat="~g")
    panels.y_axis(0, "magnitude [dB]", range=[-45.0, 35.0])
    return panels.figure(380, hovermode="closest")
