"""A designed next experiment on the page: what is played, what each rival predicts, and where they part."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, first_upper, number, quantity, span

from . import style
from .html import Figures, choice, made_on, more, section, table, tag, text
from .style import Panels

Result = dict[str, Any]

_COLOURS = (style.HORIZON, style.FREE_RUN, style.ONE_STEP, "#b07cc6", "#c9a227")
_UNITS = {"position": "m", "velocity": "m/s", "pressure_a": "Pa", "pressure_b": "Pa"}
_LIMITS = {
    "drive": ("drive_peak",), "travel": ("position_min", "position_max"), "velocity": ("velocity_peak",),
    "pressure_min": ("pressure_min",), "pressure_max": ("pressure_max",),
}  # fmt: skip
_LIMIT_UNITS = {"drive": "V", "travel": "m", "velocity": "m/s", "pressure_min": "Pa", "pressure_max": "Pa"}
_LIMIT_NAMES = {
    "drive": "drive", "travel": "position (from the centre)", "velocity": "speed", "pressure_min": "least pressure",
    "pressure_max": "greatest pressure",
}  # fmt: skip


def html(result: Result, place: Figures) -> str:
    """The part of the page."""
    return (
        _heading(result)
        + _played(result, place)
        + _apart(result, place)
        + _differences(result, place)
        + _others(result, place)
        + _limits(result)
    )


def _heading(result: Result) -> str:
    kind = tag("div", f"Next experiment · {made_on(result)}", "kind")
    lead = f"Designed so that the predictions of {len(result['competing_models'])} rivals part; nothing has moved yet."
    title = tag("h1", text(result["title"].partition(": ")[2]))
    head = tag("header", kind + title + tag("p", text(lead), "lead"), "top")
    return head + tag("div", text(result["verdict"]["text"]), f"verdict {text(result['verdict']['level'])}")


def _played(result: Result, place: Figures) -> str:
    rows = [
        [
            f"{m['start']:.1f} s",
            text(m["description"]),
            text(", ".join(f"{k} {v:.3g}" for k, v in m["parameters"].items())),
        ]
        for m in result["movements"]
    ]
    lead = (
        "The drive, and what each rival does under it. Amplitudes and positions in the list are parts of the drive and "
        "of the travel allowed, frequencies in Hz, holds in seconds."
    )
    file = tag("p", f"Played by the excitation node: {tag('code', text(result['file']))}") if result["file"] else ""
    return section(
        "What is played", lead, place.place(traces(result)) + table(["From", "Movement", "Numbers"], rows) + file
    )


def _apart(result: Result, place: Figures) -> str:
    clear = result["settings"]["decisive_separation"]
    rows = []
    for p in result["pairs"]:
        channel = max(p["channel_shares"], key=lambda c: p["channel_shares"][c])
        rows.append(
            [
                text(p["true"]), text(p["refitted"]), number(p["chi_square"]), number(p["separation"]),
                _chance(p["misclassification_probability"]), _seconds(p["seconds_needed"]),
                f"{TITLES.get(channel, channel)} ({100.0 * p['channel_shares'][channel]:.0f} %)",
            ]
        )  # fmt: skip
    head = ["True", "Refitted to it", "χ² left", "Standard deviations", "Chance of mistaking", "Needed", "Mostly in"]
    lead = (
        "Every rival is refitted, with all its free parameters and all starts, to what each other one does. What is "
        "then left of the sum of squares over the noise tells them apart; the difference of two such sums has half its "
        f"root as mean over standard deviation. From {number(clear)} on noise cannot decide; that takes the time given."
    )
    return section("How far they are apart", lead, table(head, rows) + _moved(result))


def _moved(result: Result) -> str:
    parts = []
    for p in result["pairs"]:
        rows = [
            [text(q["key"]), f"{q['before']:.4g}", f"{q['after']:.4g}", text("" if q["unit"] == "1" else q["unit"])]
            for q in p["parameters"]
        ]
        content = table(["Parameter", "Fitted before", "Refitted", "Unit"], rows)
        parts.append((f"{p['refitted']} to {p['true']}", content))
    return more("What the refits would change", choice("refit", parts))


def _differences(result: Result, place: Figures) -> str:
    options = [(f"{p['refitted']} to {p['true']}", place.place(differences(p))) for p in result["pairs"]]
    lead = (
        "What the true one does less what the refitted one makes of it, over the noise of the channel: where in the "
        "experiment the predictions part. The grey band is one standard deviation of the noise."
    )
    return section("Where their predictions part", lead, choice("pair", options))


def _others(result: Result, place: Figures) -> str:
    lead = (
        "The closest pair under the best movement of each kind, repeated over the same time, beside the sequence that "
        "was chosen; by the sensitivities of the rivals. From the dotted line on noise cannot decide."
    )
    return section("What other experiments would tell", lead, place.place(alternatives(result)))


def _limits(result: Result) -> str:
    p, rows = result["prediction"], []
    for name, keys in _LIMITS.items():
        unit, allowed = _LIMIT_UNITS[name], result["limits"][name]
        seen = quantity(p[keys[0]], unit) if len(keys) == 1 else span(p[keys[0]], p[keys[1]], unit)
        sign = "±" if name in ("drive", "travel") else ""
        rows.append([_LIMIT_NAMES[name], seen, "–" if allowed is None else sign + quantity(allowed, unit)])
    shorter = f" Kept smaller by: {text(p['limited_by'])}." if p.get("limited_by") else ""
    lead = (
        "The extremes over all rivals, played by the code that plays the plan on the bench. Of travel, speed and "
        f"pressures a tenth is kept in reserve. The run aborts a little beyond the travel.{shorter}"
    )
    return section("Within the limits", lead, table(["", "Predicted", "Allowed"], rows))


def traces(result: Result) -> go.Figure:
    """The drive, and each channel as the rivals predict it."""
    names = [r["name"] for r in result["competing_models"]]
    channels = [c for c in _UNITS if c in result["traces"]]
    panels = Panels(1 + len(channels), gap=(0.0, 0.025), one_time=True)
    drive = result["traces"]["drive"]
    panels.line(
        0, style.values(drive["time"]), style.values(drive["value"]), "drive",
        line={"color": style.MEASURED, "width": 1.2},
    )  # fmt: skip
    panels.y_axis(0, "drive\n[V]", nticks=5)
    for panel, channel in enumerate(channels, 1):
        factor, unit = style.shown(_UNITS[channel])
        for i, name in enumerate(names):
            trace = result["traces"][channel][name]
            panels.line(
                panel, style.values(trace["time"]), style.values(trace["value"], factor), name, legend=panel == 1,
                line={"color": _COLOURS[i % len(_COLOURS)], "width": 1.4, "dash": "solid" if i == 0 else "dot"},
            )  # fmt: skip
        panels.y_axis(panel, f"{TITLES[channel]}\n[{unit}]", nticks=5)
    for m in result["movements"]:
        panels.shapes.append(
            {"type": "line", "xref": "x", "yref": "paper", "x0": m["start"], "x1": m["start"], "y0": 0, "y1": 1,
             "line": {"color": style.MEASURED, "width": 1, "dash": "dot"}}
        )  # fmt: skip
    first = result["movements"][0]["start"]
    end = first + result["settings"]["seconds"]
    panels.x_axis(0, "time [s]", anchor=f"y{1 + len(channels)}", mirror="all", range=[first - 0.5, end + 0.5])
    return panels.figure(120 + 110 * (1 + len(channels)), hovermode="x unified", hoversubplots="axis")


def differences(pair: dict[str, Any]) -> go.Figure:
    """What is left of one pair after the refit, over the noise, channel by channel."""
    channels = list(pair["differences"])
    panels = Panels(len(channels), gap=(0.0, 0.03), one_time=True)
    for panel, channel in enumerate(channels):
        trace = pair["differences"][channel]
        panels.line(
            panel, style.values(trace["time"]), style.values(trace["value"]), TITLES.get(channel, channel),
            line={"color": style.FREE_RUN, "width": 1.1},
        )  # fmt: skip
        largest = float(np.nanmax(np.abs(style.values(trace["value"])), initial=0.0))
        panels.band(panel, -1.0, 1.0)
        panels.y_axis(
            panel, f"{TITLES.get(channel, channel)}\n[× noise]", nticks=5,
            range=[-1.1 * max(largest, 1.5), 1.1 * max(largest, 1.5)],
        )  # fmt: skip
    panels.shapes = [{**s, "xref": "x domain"} for s in panels.shapes]
    panels.x_axis(0, "time [s]", anchor=f"y{len(channels)}", mirror="all")
    return panels.figure(90 + 150 * len(channels), hovermode="x unified", hoversubplots="axis", showlegend=False)


def alternatives(result: Result) -> go.Figure:
    """Separation of the closest pair by kind of experiment, as bars."""
    rows = list(reversed(result["compared_experiments"]))
    panels = Panels(1)
    panels.line(
        0,
        style.values([max(row["separation"], 1e-3) for row in rows]),
        np.array([first_upper(row["description"]) for row in rows]),
        type="bar",
        orientation="h",
        marker={"color": [style.HORIZON if row["kind"] == "chosen" else style.MEASURED for row in rows]},
        text=[number(row["separation"]) for row in rows],
        textposition="outside",
        cliponaxis=False,
        hovertemplate="%{y}: %{x:.3g}<extra></extra>",
    )
    highest = max(row["separation"] for row in rows)
    panels.x_axis(0, "separation of the closest pair [standard deviations]", range=[0.0, 1.12 * max(highest, 1e-3)])
    panels.y_axis(0, automargin=True, type="category")
    clear = result["settings"]["decisive_separation"]
    if clear < 1.1 * highest:
        panels.shapes.append(
            {"type": "line", "xref": "x", "yref": "y domain", "x0": clear, "x1": clear, "y0": 0, "y1": 1,
             "line": {"color": style.ONE_STEP, "width": 2, "dash": "dot"}}
        )  # fmt: skip
    return panels.figure(80 + 30 * len(rows), hovermode="closest", margin={"l": 20, "r": 40, "t": 14, "b": 44})


def _chance(value: float) -> str:
    return "below 10⁻⁹" if value < 1e-9 else f"{value:.1g}"


def _seconds(value: float | None) -> str:
    if value is None:
        return "no time suffices"
    return "below 0.1 s" if value < 0.1 else f"{number(value)} s"
