"""A frequency response on the page: how nonlinear the plant is, before any model."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import number

from . import frequency_response_figures as figures
from .html import Figures, made_on, section, table, tag, text

Result = dict[str, Any]

_LEVELS = {
    "odd_distortion": ("Odd distortion", "friction, dead band, saturation; on odd lines that were not played"),
    "even_distortion": ("Even distortion", "what differs between the directions; on even lines"),
    "nonlinear_between_realisations": ("Between realisations", "all that depends on the phases that were drawn"),
    "noise": ("Noise", "what differs between periods"),
}


def html(result: Result, place: Figures) -> str:
    """The frequency response's part of the page; its figures are given their places in ``place``."""
    return _heading(result) + _cards(result) + _response(result, place) + _nonlinear(result, place) + _records(result)


def _heading(result: Result) -> str:
    channels = result["settings"]
    title = f"From {channels['input']['channel']} to {channels['output']['channel']}"
    verdict = result["verdict"]
    lead = f"Frequency response of {result['model']['name']}"
    kind = tag("div", f"Frequency response · {made_on(result)}", "kind")
    return tag("header", kind + tag("h1", text(title)) + tag("p", text(lead), "lead"), "top") + tag(
        "div", text(verdict["text"]), f"verdict {text(verdict['level'])}"
    )


def _cards(result: Result) -> str:
    if result["levels_db"] is None:
        return ""
    cards = [
        (title, "<small>below the noise</small>" if value is None else f"{number(value)}<small> dB</small>", note)
        for key, (title, note) in _LEVELS.items()
        for value in [result["levels_db"][key]]
        if _was_told(result, key)
    ]
    return tag(
        "div",
        "".join(
            tag("div", tag("div", a, "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _was_told(result: Result, level: str) -> bool:
    if level == "nonlinear_between_realisations":
        return bool(result["realisations"] > 1)
    lines = {"odd_distortion": "odd_lines", "even_distortion": "even_lines"}.get(level)
    return lines is None or result[lines] is not None


def _response(result: Result, place: Figures) -> str:
    if result["method"] == "bla":
        lead = (
            f"Best linear approximation over {result['realisations']} realisation"
            f"{'s' if result['realisations'] > 1 else ''} of {result['periods']} periods, with standard deviations. "
            "Where the deviation between realisations lies above that by noise, the plant is nonlinear."
        )
    else:
        lead = (
            f"Welch's estimate over segments of {result['welch']['segment']:.3g} s, and the empirical transfer "
            f"function estimate of the whole record, smoothed over {result['etfe']['width']:.2g} Hz. Noise and "
            "distortion lower the coherence alike."
        )
    return section("Response", lead, place.place(figures.bode(result)))


def _nonlinear(result: Result, place: Figures) -> str:
    if result["lines"] is None:
        return ""
    lead = (
        "A linear plant answers on the lines that were played and nowhere else. What stands beside them and above the "
        "noise is distortion."
    )
    return section("How nonlinear", lead, place.place(figures.levels(result)))


def _records(result: Result) -> str:
    rows = [
        [text(r["name"]), f"{r['duration']:.4g} s", f"{r['sampling_time'] * 1e3:.3g} ms", text(r["source"])]
        for r in result["records"]
    ]
    return section("Records", "", table(["Record", "Duration", "Sampling time", "Source"], rows))
