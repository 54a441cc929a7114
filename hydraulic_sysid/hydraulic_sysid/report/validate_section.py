"""A validation of identified models on the page: bars of RMSE over the grid, and tables."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from . import style
from .html import Figures, made_on, section, table, tag, text
from .style import Panels

Result = dict[str, Any]
_COLOURS = (style.HORIZON, style.FREE_RUN, style.ONE_STEP, style.MEASURED)


def html(result: Result, place: Figures) -> str:
    """The validation's part of the page; its figures are given their places in ``place``."""
    return _heading(result) + _grid(result, place) + _records(result)


def rmse_bars(result: Result) -> go.Figure:
    """RMSE of every model over amplitudes and frequencies, a panel for each shape."""
    shapes = result["settings"]["shapes"]
    factor, unit = style.shown(result["settings"]["output"]["unit"])
    rows = (len(shapes) + 1) // 2
    columns = min(2, len(shapes))
    panels = Panels(rows, columns, gap=(0.08, 0.26 if rows > 1 else 0.0), titles=[s.capitalize() for s in shapes])
    for panel, shape in enumerate(shapes):
        cells = [c for c in result["grid"] if c["shape"] == shape]
        names = [f"{c['amplitude']:g} V\n{c['frequency']:g} Hz{'' if c['within_travel'] else ' *'}" for c in cells]
        for index, model in enumerate(result["models"]):
            panels.line(
                panel,
                names,  # type: ignore[arg-type]  # categories
                style.values([c["models"][model["name"]]["rmse"] for c in cells], factor),
                model["name"],
                legend=panel == 0,
                type="bar",
                marker={"color": _COLOURS[index % len(_COLOURS)]},
                hovertemplate="%{y:.3g} " + unit,
            )
        panels.y_axis(panel, f"RMSE [{unit}]" if panel % columns == 0 else "", type="log", dtick=1, tickformat="~g")
        panels.x_axis(panel, tickfont={"size": 10})
    return panels.figure(
        60 + 260 * rows,
        bargap=0.25,
        legend={"orientation": "h", "x": 0, "y": 1.06, "yanchor": "bottom", "xanchor": "left"},
        margin={"l": 66, "r": 14, "t": 30 + 22 * len(result["models"]), "b": 50},
    )


def _heading(result: Result) -> str:
    kind = f"Validation · {made_on(result)}"
    names = ", ".join(m["name"] for m in result["models"])
    against = f"against the plant of {result['plant']}" if result["plant"] else "against records"
    lead = tag("p", text(f"{names}; {against}"), "lead")
    verdict = result["verdict"]
    head = tag("header", tag("div", kind, "kind") + tag("h1", text(result["title"])) + lead, "top")
    return head + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")


def _grid(result: Result, place: Figures) -> str:
    if not result["grid"]:
        return ""
    names = [m["name"] for m in result["models"]]
    factor, unit = style.shown(result["settings"]["output"]["unit"])
    rows = [
        [
            c["shape"], f"{c['amplitude']:g} V", f"{c['frequency']:g} Hz", f"{c['std'] * factor:.3g}",
            *(_error(c["models"][n], factor) for n in names), "" if c["within_travel"] else "*",
        ]
        for c in result["grid"]
    ]  # fmt: skip
    head = ["Drive", "Amplitude", "Frequency", f"Motion [{unit}]", *(f"{text(n)}" for n in names), ""]
    lead = (
        f"Free runs beside the nonlinear plant: RMSE [{unit}] and, in brackets, best fit. Motion is the standard "
        "deviation of the plant's position; * marks drives on which the plant meets its stops."
    )
    return section("Drives that were not fitted", lead, place.place(rmse_bars(result)) + table(head, rows))


def _records(result: Result) -> str:
    if not result["records"]:
        return ""
    factor, unit = style.shown(result["settings"]["output"]["unit"])
    rows = [
        [
            text(r["name"]), text(m["name"]), _error(r["models"][m["name"]], factor),
            _percent(r["models"][m["name"]]["best_fit_one_step"]), _outside(r["models"][m["name"]]["residual_tests"]),
        ]
        for r in result["records"]
        for m in result["models"]
    ]  # fmt: skip
    head = ["Record", "Model", f"Free run: RMSE [{unit}] (best fit)", "Best fit, one step",
            "Lags outside 99 %, itself / input"]  # fmt: skip
    lead = "The initial state is fitted to each record."
    return section("Records", lead, table(head, rows))


def _error(figures: Result, factor: float) -> str:
    if figures["rmse"] is None or figures["rmse"] != figures["rmse"]:
        return "–"
    return f"{figures['rmse'] * factor:.3g} ({figures['best_fit']:.1f}\u00a0%)".replace("-", "−")


def _percent(value: float | None) -> str:
    return "–" if value is None or value != value else f"{value:.2f}\u00a0%".replace("-", "−")


def _outside(tests: Result | None) -> str:
    if tests is None:
        return "–"
    return " / ".join(f"{100.0 * tests['outside'][key]:.0f}\u00a0%" for key in ("autocorrelation", "cross_correlation"))
