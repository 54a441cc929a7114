"""The page: every result shown by the folder of its kind, Plotly's script once, and the figures' data."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from hydraulic_sysid.data import display
from hydraulic_sysid.data.results import PAGE, PAGE_MARK, ResultError, verb_of, write_text

from . import (
    calibrate_section,
    diagnose_section,
    locate_section,
    next_experiment_section,
)
from .html import Figures

Result = dict[str, Any]

# Sections that are not templates yet.
SECTIONS: dict[str, Callable[[Result, Figures], str]] = {
    "hydraulic_sysid.add/2": diagnose_section.html,
    "hydraulic_sysid.calibrate/2": calibrate_section.html,
    "hydraulic_sysid.diagnose/2": diagnose_section.html,
    "hydraulic_sysid.locate/2": locate_section.html,
    "hydraulic_sysid.next_experiment/2": next_experiment_section.html,
}


def _whole(shown: Callable[..., str]) -> Callable[..., str]:
    """The same, with spaces at which no line breaks: a number stays with its unit."""
    return lambda *values, **settings: shown(*values, **settings).replace(" ", "\u00a0")


FILTERS: dict[str, Callable[..., Any]] = {
    "first_upper": display.first_upper,
    "number": _whole(display.number),
    "percent": _whole(display.percent),
    "quantity": _whole(display.quantity),
    "shell": lambda text: shlex.quote(str(text)),
    "shown": display.shown,
    "span": _whole(display.span),
    "verb": verb_of,
    "words": lambda name: display.TITLES.get(name, name.replace("_", " ")),
}
"""How templates show numbers and names."""


def render(results: Sequence[Result]) -> str:
    """HTML of one page for the results, in the order given. It needs no other file and no network.

    :raises ResultError: no result, or one of a schema that this version cannot show.
    """
    if not results:
        raise ResultError("there is no result to show")
    place, known = Figures(), _kinds()
    parts: list[tuple[Result, str, ModuleType | None, Markup | None]] = []
    for result in results:
        schema = result["schema"]
        if schema in known:
            parts.append((result, f"{known[schema]}/section.html.j2", _module(f"{known[schema]}.figures"), None))
        elif schema in SECTIONS:
            parts.append((result, "", None, Markup(SECTIONS[schema](result, place))))
        else:
            shown = ", ".join(sorted([*known, *SECTIONS]))
            raise ResultError(f"schema {schema!r} cannot be shown; known are {shown}")
    page = _environment().get_template("page.html.j2")
    return page.render(
        title=_title(results), parts=parts, place=place, mark=Markup(PAGE_MARK), plotly=Markup(get_plotlyjs())
    )


def write_page(folder: Path, results: Sequence[Result]) -> Path:
    """Write the page of the results into a folder, whole or not at all."""
    path = folder / PAGE
    write_text(path, render(results))
    return path


def _kinds() -> dict[str, str]:
    """Schema → folder that shows such a result."""
    folders = [template.parent.name for template in Path(__file__).parent.glob("*/section.html.j2")]
    return {_module(folder).SCHEMA: folder for folder in folders}


def _module(name: str) -> ModuleType:
    return import_module(f".{name}", __package__)


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
    # The filter tojson escapes what could end the script element in which it stands.
    made.policies["json.dumps_function"] = lambda figure, **_: figure.to_json()
    return made


def _title(results: Sequence[Result]) -> str:
    for result in results:
        if "title" in result:
            return str(result["title"])
        if "name" in result["model"]:
            return f"{result['model']['name']} against measurements"
    return "Identified model"
