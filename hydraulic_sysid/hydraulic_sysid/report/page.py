"""The page: a heading, one part per result, Plotly's script once, and the figures' data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from plotly.offline import get_plotlyjs

from hydraulic_sysid.data.results import PAGE, PAGE_MARK, ResultError, verb_of, write_text

from . import (
    bandwidth_section,
    calibrate_section,
    compare_section,
    design_section,
    diagnose_section,
    frequency_response_section,
    greybox_section,
    identify_section,
    locate_section,
    next_experiment_section,
    paper_section,
    validate_section,
)
from .html import Figures, tag, text

Result = dict[str, Any]

# A result's schema chooses how it is shown; a new kind of result adds its section here.
SECTIONS: dict[str, Callable[[Result, Figures], str]] = {
    "hydraulic_sysid.add/2": diagnose_section.html,
    "hydraulic_sysid.bandwidth/2": bandwidth_section.html,
    "hydraulic_sysid.calibrate/2": calibrate_section.html,
    "hydraulic_sysid.compare/2": compare_section.html,
    "hydraulic_sysid.design/1": design_section.html,
    "hydraulic_sysid.diagnose/2": diagnose_section.html,
    "hydraulic_sysid.frequency_response/2": frequency_response_section.html,
    "hydraulic_sysid.greybox/2": greybox_section.html,
    "hydraulic_sysid.identify/3": identify_section.html,
    "hydraulic_sysid.locate/2": locate_section.html,
    "hydraulic_sysid.next_experiment/2": next_experiment_section.html,
    "hydraulic_sysid.paper/2": paper_section.html,
    "hydraulic_sysid.validate/2": validate_section.html,
}


def render(results: Sequence[Result]) -> str:
    """HTML of one page for the results, in the order given. It needs no other file and no network.

    :raises ResultError: no result, or one of a schema that this version cannot show.
    """
    if not results:
        raise ResultError("there is no result to show")
    figures = Figures()
    parts = []
    for result in results:
        if result["schema"] not in SECTIONS:
            raise ResultError(f"schema {result['schema']!r} cannot be shown; known are {', '.join(SECTIONS)}")
        parts.append(SECTIONS[result["schema"]](result, figures))
    software = ", ".join(f"{text(name)} {text(version)}" for name, version in results[0]["software"].items())
    footer = tag("footer", f"Every number and curve on this page stands in {_files(results)}. Made with {software}.")
    scripts = "".join(
        f'<script type="application/json" id="{name}">{spec}</script>\n' for name, spec in figures.specs.items()
    )
    title = text(_title(results))
    return (
        f'<!doctype html>\n{PAGE_MARK}\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{title}</title>\n'
        f"<style>\n{_asset('page.css')}</style>\n</head>\n<body>\n<main>\n"
        f'<button class="theme" id="theme" type="button">Theme</button>\n'
        f"{''.join(parts)}{footer}\n</main>\n"
        f"<script>{get_plotlyjs()}</script>\n{scripts}<script>\n{_asset('page.js')}</script>\n</body>\n</html>\n"
    )


def write_page(folder: Path, results: Sequence[Result]) -> Path:
    """Write the page of the results into a folder, whole or not at all."""
    path = folder / PAGE
    write_text(path, render(results))
    return path


def _title(results: Sequence[Result]) -> str:
    for result in results:
        if "title" in result:
            return str(result["title"])
        if "name" in result["model"]:
            return f"{result['model']['name']} against measurements"
    return "Identified model"


def _files(results: Sequence[Result]) -> str:
    return " and ".join(tag("code", f"{text(verb_of(result))}.json") for result in results)


def _asset(name: str) -> str:
    return (resources.files(__package__) / "assets" / name).read_text(encoding="utf-8")
