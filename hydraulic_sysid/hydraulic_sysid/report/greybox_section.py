"""A grey box on the page: shares of what the white box leaves, the black box's terms, and the errors over time."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from hydraulic_sysid.data.display import first_upper, percent, quantity

from . import style
from .html import Figures, choice, made_on, section, table, tag, text
from .style import Panels

Result = dict[str, Any]
_PARTS = (
    ("noise", "noise: an exact model has it too", style.MEASURED),
    ("linear", "not named: explained by linear terms", style.HORIZON),
    ("nonlinear", "not named: explained by nonlinear terms", style.ONE_STEP),
    ("unexplained", "neither", style.FREE_RUN),
)


def html(result: Result, place: Figures) -> str:
    """The grey box's part of the page; its figures are given their places in ``place``."""
    return _heading(result) + _shares(result, place) + _terms(result) + _errors(result, place)


def share_bars(result: Result) -> go.Figure:
    """One bar per channel: the parts of the white box's mean squared error on held-out data, in percent."""
    panels = Panels(1)
    names = [first_upper(c["title"]) for c in result["channels"].values()]
    for key, title, colour in _PARTS:
        shares = style.values([c["shares"][key] for c in result["channels"].values()], 100.0)
        panels.line(
            0,
            shares,
            names,  # type: ignore[arg-type]  # categories
            title,
            legend=True,
            type="bar",
            orientation="h",
            marker={"color": colour},
            hovertemplate="%{x:.1f} %",
        )
    panels.x_axis(0, "share of the mean squared error [%]", range=[0, 100])
    return panels.figure(110 + 50 * len(names), barmode="stack", hovermode="closest", bargap=0.35)


def traces(channel: Result, record: int) -> go.Figure:
    """What the white box misses of one held-out record, what the black box says of it, and what is left."""
    factor, unit = style.shown(channel["unit"])
    panels = Panels(2, heights=[1.6, 1.0], gap=(0.0, 0.04), one_time=True)
    own = channel["records"][record]["traces"]
    parts = (
        ("white", 0, "missed by the white box", style.MEASURED, 2.6),
        ("black", 0, "black box", style.HORIZON, 1.5),
        ("grey", 1, "left by both", style.FREE_RUN, 1.2),
    )
    for key, panel, title, colour, width in parts:
        x, y = style.values(own[key]["time"]), style.values(own[key]["value"], factor)
        panels.line(panel, x, y, title, legend=True, line={"color": colour, "width": width})
    panels.y_axis(0, f"{channel['title']}\n[{unit}]", nticks=6)
    panels.y_axis(1, f"left\n[{unit}]", nticks=4)
    panels.x_axis(0, "time [s]", anchor="y2", mirror="all")
    return panels.figure(360, hovermode="x unified", hoversubplots="axis")


def _heading(result: Result) -> str:
    kind = f"Grey box · {made_on(result)}"
    lead = f"Fitted to {', '.join(result['fit'])}; tried on {', '.join(result['test'])}"
    verdict = result["verdict"]
    head = tag(
        "header", tag("div", kind, "kind") + tag("h1", text(result["title"])) + tag("p", text(lead), "lead"), "top"
    )
    return head + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")


def _shares(result: Result, place: Figures) -> str:
    rows = [
        [
            first_upper(c["title"]),
            *(quantity(c["test"][key], c["unit"]) for key in ("white", "linear", "grey", "exact")),
            *(percent(c["shares"][key]) for key, *_ in _PARTS),
        ]
        for c in result["channels"].values()
    ]
    head = ["Channel", "White box", "with linear terms", "with all terms", "Exact model", "Noise", "Linear",
            "Nonlinear", "Neither"]  # fmt: skip
    lead = (
        f"RMS error {result['settings']['horizon']:g} s ahead on data that neither box has seen, and the parts of its "
        "square. What a black box explains there is no noise: it is what the physics does not name."
    )
    return section("What is left", lead, place.place(share_bars(result)) + table(head, rows))


def _terms(result: Result) -> str:
    rows = [
        [first_upper(c["title"]), text(term["name"]), percent(term["share"])]
        for c in result["channels"].values()
        for term in c["terms"]
    ]
    if not rows:
        return section("Terms of the black box", "None lowers the error on data left out.", "")
    lead = (
        f"Chosen among {result['settings']['candidates']} by cross-validation. The share of the held-out mean squared "
        "error is what is lost without the term, and points at the physics to look for."
    )
    return section("Terms of the black box", lead, table(["Channel", "Term", "Share"], rows))


def _errors(result: Result, place: Figures) -> str:
    options = [
        (f"{first_upper(c['title'])} · {record['name']}", place.place(traces(c, index)))
        for c in result["channels"].values()
        for index, record in enumerate(c["records"])
    ]
    return section("On held-out data", "Drag to zoom.", choice("record", options))
