"""Small pieces of HTML: everything that comes from a document is escaped here."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from typing import Any

import plotly.graph_objects as go


@dataclass
class Figures:
    """The figures of a page: given a place each, and written once, to be drawn when they come into view."""

    specs: dict[str, go.Figure] = field(default_factory=dict)

    def add(self, figure: go.Figure) -> str:
        """The name under which the page holds the figure."""
        name = f"figure-{len(self.specs) + 1}"
        self.specs[name] = figure
        return name

    def place(self, figure: go.Figure | None) -> str:
        """The element in which a figure will be drawn; nothing for None."""
        if figure is None:
            return ""
        return f'<div class="plot" data-figure="{self.add(figure)}" style="height:{int(figure.layout.height)}px"></div>'


def text(value: Any) -> str:
    """Any value as text of the page."""
    return escape(str(value))


def made_on(result: dict[str, Any]) -> str:
    """When a result was made, to the minute."""
    return text(result["created"][:16].replace("T", " ") + " UTC")


def tag(name: str, content: str, css: str = "", **attributes: str) -> str:
    """An element around content that is HTML already."""
    parts = [name] + ([f'class="{css}"'] if css else [])
    parts += [f'{key.replace("_", "-")}="{escape(value)}"' for key, value in attributes.items()]
    return f"<{' '.join(parts)}>{content}</{name}>"


def table(head: Iterable[str], rows: Iterable[Iterable[str]], css: str = "") -> str:
    """A table whose cells are HTML already; a cell may bring its own ``<td …>``."""
    top = "".join(tag("th", h) for h in head)
    body = "".join(
        tag("tr", "".join(cell if cell.startswith(("<td", "<th")) else tag("td", cell) for cell in row)) for row in rows
    )
    return tag("div", tag("table", tag("thead", tag("tr", top)) + tag("tbody", body), css), "scroll")


def choice(label: str, options: list[tuple[str, str]]) -> str:
    """A row of buttons of which one is on, and one panel for each: ``options`` are (title, HTML).

    A single option needs no button.
    """
    if len(options) == 1:
        return options[0][1]
    buttons = "".join(
        tag("button", text(title), type="button", role="tab", aria_selected="true" if i == 0 else "false")
        for i, (title, _) in enumerate(options)
    )
    panels = "".join(
        f'<div class="panel" role="tabpanel"{"" if i == 0 else " hidden"}>{content}</div>'
        for i, (_, content) in enumerate(options)
    )
    return tag("div", tag("div", buttons, "buttons", role="tablist", aria_label=label) + panels, "choice")


def section(title: str, lead: str, content: str) -> str:
    """A titled part of the page with a sentence on how to read it."""
    return tag("section", tag("h2", text(title)) + (tag("p", lead, "lead") if lead else "") + content)


def more(title: str, content: str) -> str:
    """A part that is folded until it is asked for."""
    return tag("details", tag("summary", text(title)) + content)
