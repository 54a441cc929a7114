"""What all figures share: colours that read on light and dark pages, units, panels, a neutral layout."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from hydraulic_sysid.data.display import shown as shown

Array = NDArray[np.float32]

# After Okabe & Ito's palette for colour-blind readers, lightened where it would sink on a dark page.
MEASURED = "#8b93a1"
FREE_RUN = "#e0662a"
HORIZON = "#3a8fd0"
ONE_STEP = "#2fa37c"
FLOOR = "#8b93a1"
BAND = "rgba(58,143,208,0.22)"
MORE = ("#b07cc6", "#c9a227")
"""For a fourth and a fifth curve."""
FAINT = "rgba(128,138,150,0.10)"
FLOOR_BAND = "rgba(139,147,161,0.25)"
_TALL = 30.0  # residual over noise from which a bar at 1 cannot be seen any more
TITLED = {"l": 66, "r": 14, "t": 52, "b": 44}
"""Margins of a figure whose panels have titles, below the tool bar."""
LYING = {"l": 20, "r": 14, "t": 40, "b": 44}
"""Margins of a figure whose bars lie, beside names of any length."""
_GRID = "rgba(128,138,150,0.22)"
_FRAME = "rgba(128,138,150,0.45)"
_TEXT = "#7b8490"
_AXIS = {"gridcolor": _GRID, "zerolinecolor": _FRAME, "linecolor": _FRAME, "showline": True, "mirror": True}


def below(distance: float) -> dict[str, Any]:
    """A legend below the panels, in parts of the plot's height."""
    return {"orientation": "h", "x": 0, "y": -distance, "yanchor": "top"}


def values(data: Any, factor: float = 1.0) -> Array:
    """A document's list as an array for a trace; single precision is finer than a screen, null becomes NaN."""
    return (np.asarray(data, dtype=float) * factor).astype(np.float32)


@dataclass
class Panels:
    """Panels of one figure in rows and columns, gathered as plain dictionaries.

    (Plotly's own figure methods check every call against its whole schema, which takes longer than comparing
    the records.) With ``one_time`` all panels are stacked on one time axis, so that zooming and hovering act on
    all. Every text is plain: Plotly reads tags in it, which are escaped, and breaks lines at newlines.
    """

    rows: int
    columns: int = 1
    heights: list[float] | None = None
    gap: tuple[float, float] = (0.0, 0.0)
    """Between columns and between rows, as parts of the figure."""
    titles: list[str] = field(default_factory=list)
    one_time: bool = False
    traces: list[dict[str, Any]] = field(default_factory=list)
    shapes: list[dict[str, Any]] = field(default_factory=list)
    annotations: list[dict[str, Any]] = field(default_factory=list)
    axes: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        weights = np.asarray(self.heights or [1.0] * self.rows)
        wide = (1.0 - self.gap[0] * (self.columns - 1)) / self.columns
        tall = (1.0 - self.gap[1] * (self.rows - 1)) * weights / weights.sum()
        for panel in range(self.rows * self.columns):
            row, column = divmod(panel, self.columns)
            top = 1.0 - float(tall[:row].sum()) - self.gap[1] * row
            left = column * (wide + self.gap[0])
            x, y = self._names(panel)
            height = [max(0.0, top - float(tall[row])), top]
            self.axes[f"yaxis{y[1:]}"] = {**_AXIS, "domain": height, "anchor": x, "title": {"standoff": 6}}
            self.axes[f"xaxis{x[1:]}"] = {**_AXIS, "domain": [left, left + wide], "anchor": y, "title": {"standoff": 4}}
            if panel < len(self.titles):
                self.annotations.append(
                    {"text": self.titles[panel], "x": left + wide / 2, "y": top, "xref": "paper", "yref": "paper",
                     "xanchor": "center", "yanchor": "bottom", "showarrow": False, "font": {"size": 13}}
                )  # fmt: skip

    def line(self, panel: int, x: Array, y: Array, name: str = "", legend: bool = False, **trace: Any) -> None:
        """Add a trace; a line unless ``mode`` or ``type`` says otherwise. Equal names hide together."""
        axis_x, axis_y = self._names(panel)
        kind = {} if "type" in trace else {"type": "scatter", "mode": "lines"}
        self.traces.append(
            {**kind, "x": x, "y": y, "name": name, "legendgroup": name or None,
             "showlegend": legend, "xaxis": axis_x, "yaxis": axis_y, **trace}
        )  # fmt: skip

    def trace(self, panel: int, trace: Mapping[str, Any], factor: float, name: str, colour: str, width: float = 1.2,
              legend: bool = False, **more: Any) -> None:  # fmt: skip
        """A line over time of a document's trace, in the unit shown."""
        x, y = values(trace["time"]), values(trace["value"], factor)
        line = {"color": colour, "width": width, **more.pop("line", {})}
        self.line(panel, x, y, name, legend, line=line, hovertemplate="%{y:.4g}", **more)

    def bars(self, panel: int, names: Any, lengths: Any, name: str, colour: Any, numbers: list[str] | None = None,
             legend: bool = False, lying: bool = False, **more: Any) -> None:  # fmt: skip
        """Bars over names, upright or lying, with numbers at their ends."""
        x, y, hover = np.array(names), values(lengths), "%{x}: %{y:.4g}"
        if lying:
            x, y, hover = y, x, "%{y}: %{x:.4g}"
            self.y_axis(panel, automargin=True, type="category")
        self.line(
            panel, x, y, name, legend, type="bar", orientation="h" if lying else "v", marker={"color": colour},
            text=numbers, textposition="outside", textangle=0, cliponaxis=False, hovertemplate=hover, **more,
        )  # fmt: skip

    def over_noise(self, panel: int, heights: list[float], title: str = "× noise") -> None:
        """An axis for residuals over noise, with a dotted line at the noise and room for numbers above the bars.

        It begins at zero while a residual at the noise can be seen there, and is logarithmic otherwise.
        """
        self.limit(panel, y=1.0, colour=ONE_STEP)
        most = max([*heights, 1.2])
        if most < _TALL:
            self.y_axis(panel, title, range=[0.0, 1.2 * most], nticks=5)
        else:
            low, high = np.log10(min([*heights, 1.0]) / 2.0), np.log10(most)
            scale = {"type": "log", "range": [low, high + 0.2 * (high - low)], "dtick": 1, "tickformat": "~g"}
            self.y_axis(panel, title, **scale)

    def limit(self, panel: int, x: float | None = None, y: float | None = None, colour: str = MEASURED) -> None:
        """A dotted line across a panel at a value of x or of y."""
        name_x, name_y = self._names(panel)
        line = {"color": colour, "width": 1.5, "dash": "dot"}
        along = {"x0": 0, "x1": 1, "y0": y, "y1": y, "xref": f"{name_x} domain", "yref": name_y}
        upright = {"x0": x, "x1": x, "y0": 0, "y1": 1, "xref": name_x, "yref": f"{name_y} domain"}
        self.shapes.append({"type": "line", "line": line, **(along if x is None else upright)})

    def band(self, panel: int, low: float, high: float) -> None:
        """A grey band across a panel, between two values of y."""
        x, y = self._names(panel)
        self._grey({"xref": f"{x} domain", "yref": y, "x0": 0, "x1": 1, "y0": low, "y1": high})

    def interval(self, panel: int, start: float, end: float) -> None:
        """A grey band up a panel, between two values of x."""
        x, y = self._names(panel)
        self._grey({"xref": x, "yref": f"{y} domain", "x0": start, "x1": end, "y0": 0, "y1": 1})

    def _grey(self, place: dict[str, Any]) -> None:
        self.shapes.append({"type": "rect", "fillcolor": FLOOR_BAND, "line": {"width": 0}, "layer": "below", **place})

    def x_axis(self, panel: int, title: str = "", **settings: Any) -> None:
        """Title and settings of a panel's x axis."""
        self._set(f"xaxis{self._names(panel)[0][1:]}", title, settings)

    def y_axis(self, panel: int, title: str = "", **settings: Any) -> None:
        """Title and settings of a panel's y axis."""
        self._set(f"yaxis{self._names(panel)[1][1:]}", title, settings)

    def figure(self, height: int, **layout: Any) -> go.Figure:
        """The figure; its background is transparent, so that the page decides on light or dark."""
        common = {
            "height": height,
            "margin": {"l": 66, "r": 14, "t": 34, "b": 44},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "font": {"family": "system-ui, sans-serif", "size": 12, "color": _TEXT},
            "legend": {"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom", "xanchor": "left"},
            "hovermode": "x",
            "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": _FRAME, "activecolor": HORIZON},
            "shapes": self.shapes,
            "annotations": self.annotations,
        }
        if self.one_time:
            common |= {"hovermode": "x unified", "hoversubplots": "axis"}
            self.axes["xaxis"] |= {"anchor": f"y{self.rows}", "mirror": "all"}
            self.axes["xaxis"]["title"].setdefault("text", "time [s]")
        return go.Figure(_plain({"data": self.traces, "layout": {**common, **self.axes, **layout}}))

    def _names(self, panel: int) -> tuple[str, str]:
        number = "" if panel == 0 else str(panel + 1)
        return ("x" if self.one_time else f"x{number}"), f"y{number}"

    def _set(self, axis: str, title: str, settings: dict[str, Any]) -> None:
        if title:
            self.axes[axis]["title"]["text"] = title
        self.axes[axis].update(settings)


def _plain(value: Any) -> Any:
    """The same with every text escaped, so that no name in a document becomes a tag of Plotly's."""
    if isinstance(value, str):
        safe = escape(value, quote=False).replace("\n", "<br>")
        return safe.replace("&lt;extra&gt;&lt;/extra&gt;", "<extra></extra>")
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype.kind in "UO"):
        return [_plain(item) for item in value]
    return value
