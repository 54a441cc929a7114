"""A comparison on the page."""

from __future__ import annotations

import math
from typing import Any

from hydraulic_sysid.data.display import first_upper, number, percent, quantity

from . import compare_figures as figures
from .html import Figures, choice, made_on, more, section, table, tag, text

Result = dict[str, Any]

_PATTERNS = ("bias", "depends_on")
_CARDS = ("position", "velocity", "pressure_a", "load_pressure")


def html(result: Result, place: Figures) -> str:
    """The comparison's part of the page; its figures are given their places in ``place``."""
    return (
        _heading(result)
        + _cards(result)
        + _errors(result)
        + _findings(result)
        + _records(result, place)
        + _maps(result, place)
        + _spectra(result, place)
        + _method(result)
    )


def _heading(result: Result) -> str:
    model, records = result["model"], result["records"]
    seconds = sum(r["duration"] for r in records)
    names = ", ".join(r["name"] for r in records)
    kind = f"Model against measurement · {made_on(result)}"
    verdict = result["verdict"]
    return (
        tag("header", tag("div", kind, "kind") + tag("h1", text(model["name"]))
            + tag("p", f"{number_of(len(records))}, {seconds:.0f} s: {text(names)}", "lead"), "top")
        + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")
    )  # fmt: skip


def number_of(records: int) -> str:
    """``1 record``, ``6 records``."""
    return f"{records} record" + ("s" if records != 1 else "")


def _cards(result: Result) -> str:
    horizon = f"{result['settings']['horizon']:g} s ahead"
    cards = []
    for name in (n for n in _CARDS if n in result["summary"]):
        figures_at, unit = result["summary"][name]["horizon"], result["channels"][name]["unit"]
        fit = percent(None if figures_at["nrmse"] is None else 1.0 - figures_at["nrmse"]).removesuffix(" %")
        cards.append(
            tag(
                "div",
                tag("div", f"{text(first_upper(result['channels'][name]['title']))}, {horizon}", "name")
                + tag("div", f"{fit}<small> % fit</small>", "big")
                + tag("div", f"{quantity(figures_at['rmse'], unit)} RMS · {_times(figures_at['ratio'])}", "note"),
                "card",
            )
        )
    return tag("div", "".join(cards), "cards")


def _errors(result: Result) -> str:
    horizon = f"{result['settings']['horizon']:g} s ahead"
    options = [
        (horizon, _error_table(result, "horizon")),
        ("Free run", _error_table(result, "free_run")),
        ("One step", _error_table(result, "one_step")),
    ]
    key = "".join(
        f'<span><i class="heat" style="{_heat(ratio)}"></i>{word}</span>'
        for ratio, word in ((1.0, "at the noise"), (3.0, "3×"), (10.0, "10×"), (30.0, "30× and more"))
    )
    lead = (
        "Relative error (0 % is perfect, 100 % is no better than the mean of the measurement), RMS error, and "
        "how many times the error it is that an <em>exact</em> model would show, given the noise of this "
        "record. In free run the piston of an integrating plant drifts: the position without that "
        "straight-line drift is given too."
    )
    return section("Errors by record and channel", lead, choice("prediction", options) + tag("div", key, "key"))


def _error_table(result: Result, mode: str) -> str:
    channels = list(result["channels"])
    head = ["Record", *(text(first_upper(result["channels"][c]["title"])) for c in channels)]
    rows = []
    for record in result["records"]:
        cells = [_cell(record["channels"].get(c, {}).get(mode), result["channels"][c]["unit"], c) for c in channels]
        rows.append([text(record["name"]), *cells])
    body = table(head, rows, "errors")
    total = ["All records", *(_cell(result["summary"][c][mode], result["channels"][c]["unit"], "") for c in channels)]
    floor = [
        "Measurement noise",
        *(quantity(result["summary"][c]["noise_std"], result["channels"][c]["unit"]) for c in channels),
    ]
    rows_html = "".join(
        tag("tr", "".join(x if x.startswith("<td") else tag("td", x) for x in row), css)
        for css, row in (("total", total), ("floor", floor))
    )
    return body.replace("</tbody>", f"{rows_html}</tbody>")


def _cell(figure: dict[str, Any] | None, unit: str, channel: str) -> str:
    if figure is None:
        return tag("td", "–")
    exact = figure["exact_rmse"]
    ratio = figure["rmse"] / exact if exact else math.inf
    relative = "–" if figure["nrmse"] is None else f"{number(100.0 * figure['nrmse'])} %"
    lines = f"{quantity(figure['rmse'], unit)} · {_times(ratio)}"
    if channel == "position" and "rmse_detrended" in figure:
        lines += f"<br>{quantity(figure['rmse_detrended'], unit)} without drift"
    return f'<td class="heat" style="{_heat(ratio)}">{relative}<span class="size">{lines}</span></td>'


def _heat(ratio: float | None) -> str:
    """Green at the noise, over amber to red at thirty times it and more; stronger the further it is off."""
    place = min(1.0, max(0.0, math.log10(max(ratio or 1.0, 1.0) / 1.5) / math.log10(20.0)))
    tone = "--good" if place == 0.0 else "--fair" if place < 0.5 else "--poor"
    strength = 22 if place == 0.0 else round(14 + 34 * place)
    return f"--tone:var({tone});--strength:{strength}%"


def _times(ratio: float | None) -> str:
    return "–" if ratio is None or not math.isfinite(ratio) else f"{number(ratio)}×"


def _findings(result: Result) -> str:
    first = [f for f in result["findings"] if f["kind"] in _PATTERNS]
    rest = [f for f in result["findings"] if f["kind"] not in _PATTERNS]
    lead = (
        "Patterns in the errors, strongest first. The share explained is tried on data that did not make the "
        "pattern; it says where the model fails, not yet why."
    )
    shown = (
        _list(first) if first else tag("p", "No single variable explains a tenth or more of any error above the noise.")
    )
    return section(
        "Where the model fails", lead, shown + more("Sizes, frequencies and drift", _list(rest)) + _shares(result)
    )


def _list(findings: list[dict[str, Any]]) -> str:
    return tag("ul", "".join(tag("li", text(f["text"]), text(f["kind"])) for f in findings), "findings")


def _shares(result: Result) -> str:
    variables, channels = result["variables"], result["channels"]
    head = ["Error of", *(text(first_upper(v["title"])) for v in variables.values())]
    rows = []
    for channel, known in channels.items():
        cells = [tag("span", text(first_upper(known["title"])))]
        for variable in variables:
            share = result["error_maps"][channel].get(variable, {}).get("explained")
            value = max(0.0, share or 0.0)
            shown = "–" if share is None else f"{100.0 * value:.0f} %"
            cells.append(f'<td class="heat" style="--tone:var(--accent);--strength:{round(75 * value)}%">{shown}</td>')
        rows.append(cells)
    return tag("h3", "Which variable explains how much of which error") + table(head, rows, "shares")


def _records(result: Result, place: Figures) -> str:
    options = [
        (record["name"], place.place(figures.overlay(result, index))) for index, record in enumerate(result["records"])
    ]
    lead = (
        "Measured and simulated channels, the error (measured − simulated) beneath each; the grey band is ±2 "
        "standard deviations of the measurement noise. Drag to zoom all panels together, double-click to "
        "return, click a name to hide it."
    )
    return section("Measured and simulated", lead, choice("record", options))


def _maps(result: Result, place: Figures) -> str:
    options = []
    for channel, known in result["channels"].items():
        each = [("All records", place.place(figures.error_maps(result, channel)))]
        if len(result["records"]) > 1:
            each += [
                (record["name"], place.place(figures.error_maps(result, channel, index)))
                for index, record in enumerate(result["records"])
                if channel in record["error_maps"]
            ]
        options.append((first_upper(known["title"]), choice("records", each)))
    lead = (
        f"Error {result['settings']['horizon']:g} s ahead in bins of one variable: mean (line) and the middle "
        "80 % (band). The grey band is ± the RMS error of an exact model. Titles give the share of the error's "
        "variance that the line explains on held-out data: of all records, each record by the others; of one "
        "record, alternate half-seconds."
    )
    return section("Error maps", lead, choice("channel", options))


def _spectra(result: Result, place: Figures) -> str:
    options = []
    for index, record in enumerate(result["records"]):
        content = (
            tag("h3", "Spectrum of the error beside the noise")
            + place.place(figures.spectra(result, index))
            + tag("h3", "Error over how far ahead is predicted")
            + place.place(figures.growth(result, index))
        )
        options.append((record["name"], content))
    lead = (
        "Where the error stands above the noise floor, the model misses something at that frequency. An error "
        "that is there within milliseconds is fast or static; one that grows with the horizon accumulates."
    )
    return section("Frequency and horizon", lead, choice("record", options))


def _method(result: Result) -> str:
    settings, model = result["settings"], result["model"]
    rows = [
        [text(p["name"]), number_with_error(p), text(p["unit"]), text(p["source"] or "")] for p in model["parameters"]
    ]
    facts = {
        "Free run": "the drive alone from the first sample on; initial state from the measurement",
        "Horizon": f"started from the measurement every {settings['horizon'] * settings['horizon_part']:g} s, "
        f"run {settings['horizon']:g} s; the last tenth of each run is compared",
        "One step": "started from the measurement at every sample",
        "Exact model": "this model, run alike against its own free run with the record's noise laid on it",
        "Velocity": settings["velocity_filter"] + "; the simulated position passes the same filter",
        "Noise floor": settings["noise_method"],
        "Model file": model["path"] or "–",
        "Records": ", ".join(r["source"] for r in result["records"]),
    }
    listed = "".join(tag("dt", text(k)) + tag("dd", text(v)) for k, v in facts.items())
    effects = ", ".join(model["effects"]) or "none"
    return section(
        "Method and model",
        f"{text(model['description'])} Effects that are on: {text(effects)}.",
        tag("dl", listed) + more("Parameters", table(["Parameter", "Value", "Unit", "Source"], rows)),
    )


def number_with_error(parameter: dict[str, Any]) -> str:
    """A value with its standard error, where it was fitted."""
    value = f"{parameter['value']:.5g}"
    error = parameter["standard_error"]
    return value if error is None else f"{value} ± {error:.2g}"
