"""The page of a comparison: responses overlaid, and a table that is sorted by what the reader cares about."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from hydraulic_control.comparison import CLAIM_HEADS, claim_cells, claims, shown

SHOWN = 400
"""Points of a curve on the page."""

_STYLE = """
:root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;max-width:1280px;margin:2rem auto;padding:0 1rem}
table{border-collapse:collapse;margin:1rem 0;width:100%}th,td{padding:.25rem .6rem;text-align:right;
border-bottom:1px solid rgba(128,138,150,.3)}th:first-child,td:first-child{text-align:left}
.words td,.words th{text-align:left}.words td:nth-child(n+4){white-space:nowrap}
th{cursor:pointer;white-space:nowrap}th[aria-sort]::after{content:" ▾"}.wide{overflow-x:auto}
"""
_SCRIPT = """
const sorted = (rows, value) => rows.sort((a, b) => value(a) < value(b) ? -1 : value(a) > value(b) ? 1 : 0);
for (const table of document.querySelectorAll("table")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, i) => head.onclick = () => {
    for (const other of heads) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", "ascending");
    const value = row => "value" in row.cells[i].dataset ? +row.cells[i].dataset.value : row.cells[i].textContent;
    table.tBodies[0].append(...sorted([...table.tBodies[0].rows], value));
  });
}
for (const place of document.querySelectorAll("[data-figure]")) {
  const f = JSON.parse(document.getElementById(place.dataset.figure).textContent);
  Plotly.newPlot(place, f.data, f.layout, {responsive: true, displaylogo: false});
}
"""
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Controllers</title><style>{style}</style></head>
<body><h1>Controllers side by side</h1><p>{head}. A click on a heading sorts;
w: the worst of the copies; V/s: mean speed of the drive; lost: copies that ran away; late: delay of the command that
a step bears.</p>
<script>{plotly}</script>
{parts}
<script>{script}</script></body></html>
"""


def page(document: Mapping[str, Any]) -> str:
    """HTML of one page for a document of `comparison.compare`; it needs no other file and no network."""
    parts, figures = [], []
    for i, (trial, description) in enumerate(document["descriptions"].items()):
        parts.append(f"<h2>{escape(trial)}</h2><p>{escape(description)}</p>")
        parts.append(f'<div data-figure="figure-{i}"></div><div class="wide">{_table(document, trial)}</div>')
        text = _figure(document, trial).to_json().replace("<", "\\u003c")
        figures.append(f'<script type="application/json" id="figure-{i}">{text}</script>')
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in claim_cells(row))}</tr>" for row in claims(document)
    )
    heads = "".join(f"<th>{escape(head)}</th>" for head in CLAIM_HEADS)
    parts.append(
        f'<h2>What is published</h2><div class="wide"><table class="words"><thead><tr>{heads}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )
    head = (
        f"Controllers on {escape(document['model'])}: steps and sines of {1e3 * document['size']:g} mm, and "
        f"{document['plants']} scattered copies (seed {document['seed']})"
    )
    return _PAGE.format(
        style=_STYLE, head=head, plotly=get_plotlyjs(), parts="".join([*parts, *figures]), script=_SCRIPT
    )


def _table(document: Mapping[str, Any], trial: str) -> str:
    columns = shown(document, trial)
    heads = "".join(f"<th>{escape(h)}</th><th>w</th>" for _, h, _, _ in columns)
    rows = []
    for name, found in document["controllers"].items():
        one = found["trials"][trial]
        cells = "".join(_cell(one[which], key, f, d) for key, _, f, d in columns for which in ("nominal", "worst"))
        margin = f"<td data-value='{-found['delay_margin']}'>{1e3 * found['delay_margin']:.0f}</td>"
        rows.append(f"<tr><td>{escape(name)}</td>{cells}<td>{one['ran_away']}</td>{margin}</tr>")
    head = f"<tr><th>controller</th>{heads}<th>lost</th><th>late ms</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"


def _cell(figures: Mapping[str, float] | None, key: str, factor: float, decimals: int) -> str:
    if figures is None:
        return '<td data-value="Infinity">runs away</td>'
    value = factor * figures[key]
    return (
        f'<td data-value="{value}">{value:.{decimals}f}</td>'
        if np.isfinite(value)
        else '<td data-value="Infinity">–</td>'
    )


def _figure(document: Mapping[str, Any], trial: str) -> go.Figure:
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, row_heights=[0.65, 0.35], vertical_spacing=0.06)
    for i, (name, found) in enumerate(document["controllers"].items()):
        response = {key: np.array(column, dtype=float) for key, column in found["trials"][trial]["response"].items()}
        part = slice(None, None, max(len(response["time"]) // SHOWN, 1))
        time, common = np.round(response["time"][part], 4), {"legendgroup": name, "line": {"width": 1.4}, "name": name}
        error = 1e3 * (response["reference"] - response["position"])[part]
        if i == 0:
            grey = {"color": "#8b93a1", "dash": "dot"}
            figure.add_scatter(x=time, y=np.round(1e3 * response["reference"][part], 4), name="reference", line=grey)
        colour = f"hsl({(i * 137) % 360},60%,50%)"
        common["line"]["color"] = colour
        figure.add_scatter(x=time, y=np.round(1e3 * response["position"][part], 4), **common)
        figure.add_scatter(x=time, y=np.round(error, 4), row=2, col=1, showlegend=False, **common)
    figure.update_yaxes(title="position [mm]", row=1, col=1)
    figure.update_yaxes(title="error [mm]", row=2, col=1)
    figure.update_xaxes(title="time [s]", row=2, col=1)
    clear = "rgba(0,0,0,0)"
    figure.update_layout(
        height=520, paper_bgcolor=clear, plot_bgcolor=clear, font={"color": "#7b8490"}, margin={"t": 45}
    )
    figure.update_xaxes(gridcolor="rgba(128,138,150,0.22)").update_yaxes(gridcolor="rgba(128,138,150,0.22)")
    return figure
