"""Figures of a designed next experiment: what each model predicts, and where they part."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from hydraulic_sysid.data.display import TITLES, UNITS, first_upper, number
from hydraulic_sysid.report import style
from hydraulic_sysid.report.style import Panels

Result = dict[str, Any]

_COLOURS = (style.HORIZON, style.FREE_RUN, style.ONE_STEP, *style.MORE)


def traces(result: Result) -> go.Figure:
    """The drive, and each channel as the models predict it."""
    channels = [c for c in result["traces"] if c != "drive"]
    panels = Panels(1 + len(channels), gap=(0.0, 0.025), one_time=True)
    panels.trace(0, result["traces"]["drive"], 1.0, "drive", style.MEASURED)
    panels.y_axis(0, "drive\n[V]", nticks=5)
    for panel, channel in enumerate(channels, 1):
        factor, unit = style.shown(UNITS.get(channel, "1"))
        for i, model in enumerate(result["competing_models"]):
            dash = {"dash": "solid" if i == 0 else "dot"}
            trace, colour = result["traces"][channel][model["name"]], _COLOURS[i % len(_COLOURS)]
            panels.trace(panel, trace, factor, model["name"], colour, 1.4, legend=panel == 1, line=dash)
        panels.y_axis(panel, f"{TITLES.get(channel, channel)}\n[{unit}]", nticks=5)
        for movement in result["movements"]:
            panels.limit(panel, x=movement["start"])
    first = result["movements"][0]["start"]
    end = first + result["settings"]["seconds"]
    panels.x_axis(0, "time [s]", range=[first - 0.5, end + 0.5])
    return panels.figure(120 + 110 * (1 + len(channels)))


def refits(result: Result) -> list[str]:
    """Which model is refitted to what which other does, pair by pair."""
    return [f"{pair['refitted']} to {pair['true']}" for pair in result["pairs"]]


def differences(pair: dict[str, Any]) -> go.Figure:
    """What is left of one pair after the refit, over the noise, channel by channel."""
    channels = list(pair["differences"])
    panels = Panels(len(channels), gap=(0.0, 0.03), one_time=True)
    for panel, channel in enumerate(channels):
        trace, title = pair["differences"][channel], TITLES.get(channel, channel)
        panels.trace(panel, trace, 1.0, title, style.FREE_RUN, 1.1)
        panels.band(panel, -1.0, 1.0)
        reach = 1.1 * max(float(np.nanmax(np.abs(style.values(trace["value"])), initial=0.0)), 1.5)
        panels.y_axis(panel, f"{title}\n[× noise]", nticks=5, range=[-reach, reach])
    return panels.figure(90 + 150 * len(channels), showlegend=False)


def experiments(result: Result) -> go.Figure:
    """Separation of the closest pair by kind of experiment, as bars."""
    rows = list(reversed(result["compared_experiments"]))
    panels = Panels(1)
    names, lengths = [first_upper(row["description"]) for row in rows], [row["separation"] for row in rows]
    colours = [style.HORIZON if row["kind"] == "chosen" else style.MEASURED for row in rows]
    panels.bars(0, names, lengths, "separation", colours, [number(v) for v in lengths], lying=True)
    highest = max(lengths)
    panels.x_axis(0, "separation of the closest pair [standard deviations]", range=[0.0, 1.12 * max(highest, 1e-3)])
    if result["settings"]["decisive_separation"] < 1.1 * highest:
        panels.limit(0, x=result["settings"]["decisive_separation"], colour=style.ONE_STEP)
    return panels.figure(80 + 30 * len(rows), hovermode="closest", margin=style.LYING)
