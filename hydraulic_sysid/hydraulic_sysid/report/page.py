"""The page: every result shown by the folder of its kind, Plotly's script once, and the figures' data."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined, TemplateRuntimeError
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from hydraulic_node_utils.whole_file import write_text
from hydraulic_sysid.data import display
from hydraulic_sysid.data.results import PAGE, PAGE_MARK, ResultError, verb_of

Result = dict[str, Any]


def _whole(shown: Callable[..., str]) -> Callable[..., str]:
    """The same, with spaces at which no line breaks: a number stays with its unit."""
    return lambda *values, **settings: shown(*values, **settings).replace(" ", "\u00a0")


FILTERS: dict[str, Callable[..., Any]] = {
    "first_upper": display.first_upper,
    "number": _whole(display.number),
    "percent": _whole(display.percent),
    "quantity": _whole(display.quantity),
    "resolving": display.resolving,
    "shell": lambda text: shlex.quote(str(text)),
    "shown": display.shown,
    "span": _whole(display.span),
    "verb": verb_of,
    "words": lambda name: display.TITLES.get(name, name.replace("_", " ")),
}
"""How templates show numbers and names."""


@dataclass
class Figures:
    """The figures of a page: given a place each, and written once, to be drawn when they come into view."""

    known: dict[str, go.Figure] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)

    def add(self, figure: go.Figure, title: str = "") -> str:
        """The name under which the page holds the figure."""
        name = f"figure-{len(self.known) + 1}"
        self.known[name], self.titles[name] = figure, title
        return name


def render(results: Sequence[Result]) -> str:
    """HTML of one page for the results, in the order given. It needs no other file and no network.

    :raises ResultError: no result, one of a schema that this version cannot show, or one that lacks what its schema
        promises.
    """
    return _render(results, Figures())


def figures_of(result: Result) -> list[tuple[str, go.Figure]]:
    """The figures that the page of a result shows, with their titles, in its order.

    :raises ResultError: as `render`.
    """
    place = Figures()
    _render([result], place)
    return [(title, place.known[name]) for name, title in place.titles.items()]


def _render(results: Sequence[Result], place: Figures) -> str:
    if not results:
        raise ResultError("there is no result to show")
    kinds, parts = _kinds(), []
    for result in results:
        if result["schema"] not in kinds:
            raise ResultError(f"schema {result['schema']!r} cannot be shown; known are {', '.join(sorted(kinds))}")
        folder = kinds[result["schema"]]
        figures = _module(f"{folder}.figures")
        parts.append({"result": result, "template": f"{folder}/section.html.j2", "figures": figures})
    page = _environment().get_template("page.html.j2")
    try:
        text = page.render(parts=parts, place=place, mark=Markup(PAGE_MARK), plotly=Markup(get_plotlyjs()))
        text.encode()  # JSON can hold halves of characters
        return text
    except (TemplateRuntimeError, LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        # Documents may come from anywhere, and this is where their content is first looked at.
        schemas = ", ".join(str(result["schema"]) for result in results)
        what = f"{type(error).__name__}: {error}"[:300]
        raise ResultError(f"a result does not hold what its schema promises ({schemas}): {what}") from error


def write_page(folder: Path, results: Sequence[Result]) -> Path:
    """Write the page of the results into a folder, whole or not at all."""
    path = folder / PAGE
    write_text(path, render(results))
    return path


def _module(name: str) -> ModuleType:
    return import_module(f".{name}", __package__)


@cache
def _kinds() -> dict[str, str]:
    """Schema → folder that shows such a result."""
    folders = [template.parent.name for template in Path(__file__).parent.glob("*/section.html.j2")]
    return {_module(folder).SCHEMA: folder for folder in folders}


@cache
def _environment() -> Environment:
    """Templates in which every value is escaped, and a name that is not there is an error."""
    made = Environment(
        loader=PackageLoader(str(__package__), ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= FILTERS
    made.globals["units"] = display.UNITS
    # The filter tojson escapes what could end the script element in which it stands.
    made.policies["json.dumps_function"] = lambda figure, **_: figure.to_json()
    return made
