"""A designed excitation on the page."""

from __future__ import annotations

from math import log10
from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, number, quantity

from . import style
from .html import Figures, choice, made_on, section, table, tag, text
from .style import Panels

Result = dict[str, Any]

_CHANNELS = (
    ("drive", "V", style.MEASURED),
    ("position", "m", style.HORIZON),
    ("velocity", "m/s", style.ONE_STEP),
    ("pressure_a", "Pa", style.FREE_RUN),
)
_BOUNDS = {"drive": "drive", "position": "travel", "velocity": "velocity"}


def html(result: Result, place: Figures) -> str:
    """The design's part of the page."""
    verdict = result["verdict"]
    low, high = result["band"]
    kind = tag("div", f"Excitation design · {made_on(result)}", "kind")
    lead = f"{number(low)} … {number(high)} Hz on {result['model']['name']}; predicted before anything moves"
    head = tag("header", kind + tag("h1", text(result["signal"].capitalize())) + tag("p", text(lead), "lead"), "top")
    verdict_box = tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")
    return head + verdict_box + _limits(result) + _plans(result, place)


def _limits(result: Result) -> str:
    limits = result["limits"]
    rows = []
    for plan in result["plans"]:
        p = plan["prediction"]
        rows.append(
            [
                text(plan["name"]),
                quantity(p["drive_peak"], "V"),
                f"{quantity(p['position_min'], 'm')} … {quantity(p['position_max'], 'm')}",
                quantity(p["velocity_peak"], "m/s"),
                quantity(p["pressure_min"], "Pa"),
                quantity(p["pressure_max"], "Pa"),
                text(p["limited_by"]),
                f"{plan['crest_factor']:.2f}",
                tag("code", text(plan["file"])),
            ]
        )
    allowed = [
        tag("em", "allowed"), quantity(limits["drive"], "V"), f"±{quantity(limits['travel'], 'm')} from the centre",
        *(_limit(limits[k], u) for k, u in (("velocity", "m/s"), ("pressure_min", "Pa"), ("pressure_max", "Pa"))),
        "", "", "",
    ]  # fmt: skip
    head = ["Plan", "Drive", "Position", "Speed", "Least pressure", "Largest", "Limited by", "Crest factor", "File"]
    lead = (
        "The amplitude is the largest at which the rehearsal on the model keeps every limit. The run on the bench "
        "aborts beyond the same travel."
    )
    return section("Within the limits", lead, table(head, [*rows, allowed]))


def _limit(value: float | None, unit: str) -> str:
    return "–" if value is None else quantity(value, unit)


def _plans(result: Result, place: Figures) -> str:
    options = [
        (p["name"], place.place(traces(p, result["limits"])) + place.place(spectrum(p))) for p in result["plans"]
    ]
    return section(
        "What the model does", "Rehearsed with the code that plays the plan on the bench.", choice("plan", options)
    )


def traces(plan: dict[str, Any], limits: dict[str, Any]) -> go.Figure:
    """Drive and what the model does under it, with the limits as dotted lines."""
    panels = Panels(len(_CHANNELS), gap=(0.0, 0.025), one_time=True)
    for panel, (channel, unit, colour) in enumerate(_CHANNELS):
        factor, shown = style.shown(unit)
        trace = plan["traces"][channel]
        line = {"color": colour, "width": 1.2}
        panels.line(
            panel, style.values(trace["time"]), style.values(trace["value"], factor), TITLES[channel], line=line
        )
        if channel == "pressure_a":
            other = plan["traces"]["pressure_b"]
            panels.line(
                panel, style.values(other["time"]), style.values(other["value"], factor), TITLES["pressure_b"],
                line={"color": style.HORIZON, "width": 1.0},
            )  # fmt: skip
        panels.y_axis(panel, f"{TITLES[channel] if channel != 'pressure_a' else 'pressures'}\n[{shown}]", nticks=5)
        limit = limits.get(_BOUNDS.get(channel, ""))
        if limit is not None:
            centre = float(plan["plan"].get("centre", 0.0)) if channel == "position" else 0.0
            for bound in (centre - limit, centre + limit):
                panels.shapes.append(
                    {"type": "line", "xref": "x domain", "yref": f"y{panel + 1 if panel else ''}", "x0": 0, "x1": 1,
                     "y0": bound * factor, "y1": bound * factor,
                     "line": {"color": style.FREE_RUN, "width": 1, "dash": "dot"}}
                )  # fmt: skip
    panels.x_axis(0, "time [s]", anchor=f"y{len(_CHANNELS)}", mirror="all")
    return panels.figure(520, hovermode="x unified", hoversubplots="axis", showlegend=False)


def spectrum(plan: dict[str, Any]) -> go.Figure:
    """Amplitudes of the drive's lines."""
    panels = Panels(1)
    x, y = (style.values(plan["spectrum"][k]) for k in ("frequency", "amplitude"))
    panels.line(0, x, y, "drive", line={"color": style.MEASURED, "width": 1.5})
    panels.x_axis(0, "frequency [Hz]", type="log", tickformat="~g")
    largest = float(max(y)) if len(y) else 1.0
    panels.y_axis(0, "amplitude of the drive [V]", type="log", tickformat="~g", dtick=1, range=_decades(largest))
    return panels.figure(260, hovermode="closest", showlegend=False)


def _decades(largest: float) -> list[float]:
    top = log10(2.0 * largest) if largest > 0.0 else 0.0
    return [top - 4.0, top]
