"""A location on the page."""

from __future__ import annotations

from typing import Any

from hydraulic_sysid.data.display import first_upper, number, percent, quantity

from . import locate_figures as figures
from .compare import figures as compare_figures
from .html import Figures, choice, made_on, section, table, tag, text

Result = dict[str, Any]

SUBSYSTEMS = {
    "force": "Forces on the piston",
    "flow": "Leakage",
    "fluid": "Oil",
    "valve": "Valve",
    "supply": "Supply and return",
    "sensor": "Sensors",
}


_WORTH = 0.01  # share from which a subsystem has a card


def html(result: Result, place: Figures) -> str:
    """The location's part of the page; its figures are given their places in ``place``."""
    if not result["balances"]:
        return _heading(result) + _findings(result) + _method(result)
    return (
        _heading(result)
        + _cards(result)
        + _balances(result)
        + _shares(result, place)
        + _findings(result)
        + _maps(result, place)
        + _spectra(result, place)
        + _whiteness(result, place)
        + _method(result)
    )


def _heading(result: Result) -> str:
    kind = f"Where the model fails · {made_on(result)}"
    names = ", ".join(r["name"] for r in result["records"])
    seconds = sum(r["duration"] for r in result["records"])
    verdict = result["verdict"]
    return tag(
        "header",
        tag("div", kind, "kind")
        + tag("h1", text(result["model"]["name"]))
        + tag("p", f"Balances over {seconds:.0f} s: {text(names)}", "lead"),
        "top",
    ) + tag("div", text(verdict["text"]), f"verdict {text(verdict['level'])}")


def _cards(result: Result) -> str:
    misfit = result["misfit"]
    cards = [
        (
            "All balances",
            f"{number(misfit['refitted'])}<small> × noise²</small>",
            f"an exact model: {number(misfit['exact_model'])}; as calibrated: {number(misfit['model'])}",
        )
    ]
    blamed = result["attribution"][:3] if result["verdict"]["level"] != "explained" else []
    cards += [
        (
            text(SUBSYSTEMS.get(s["name"], s["name"])),
            f"{number(100.0 * s['share'])}<small> % of what is missing</small>",
            f"{percent(s['alone'])} if nothing else is blamed",
        )
        for s in blamed
        if s["share"] >= _WORTH
    ]
    return tag(
        "div",
        "".join(
            tag("div", tag("div", a, "name") + tag("div", b, "big") + tag("div", c, "note"), "card")
            for a, b, c in cards
        ),
        "cards",
    )


def _balances(result: Result) -> str:
    rows = []
    for b in result["balances"]:
        over = b.get("explained_by", [])
        told = ", ".join(f"{o['variable'].replace('_', ' ')} {100.0 * o['explained']:.0f} %" for o in over[:2])
        rows.append(
            [
                text(first_upper(b["title"])),
                quantity(b["residual_rms"], b["unit"]),
                quantity(b["exact_rms"], b["unit"]),
                f"{number(b['ratio'])}×" if b["ratio"] is not None else "–",
                f"below {number(b['band'][1])} Hz",
                text(told or "–"),
            ]
        )
    lead = (
        "What the measured signals ask for beyond what the model gives at the measured state, RMS, beside what an "
        "exact model shows of it under the same noise. Force and flows are independent of each other; valve and "
        "sensor continuity read the two flow balances as an opening and as a velocity."
    )
    head = ["Balance", "Residual", "Noise", "Ratio", "Band", "Goes over (share explained)"]
    return section("Which balance is violated", lead, table(head, rows))


def _shares(result: Result, place: Figures) -> str:
    if result["verdict"]["level"] == "explained":
        return ""
    lead = (
        "Every subsystem may do to the balances whatever its physics allows; a share counts only as far as it holds "
        "on data that did not make it. Filled: taken in one after the other, the strongest first. Open: each alone."
    )
    return section("Whose it is", lead, place.place(figures.shares(result, SUBSYSTEMS)))


def _findings(result: Result) -> str:
    items = "".join(tag("li", text(f["text"]), text(_TONES.get(f["kind"], "depends_on"))) for f in result["findings"])
    return section("In words", "", tag("ul", items, "findings")) if items else ""


_TONES = {"violated": "above_noise", "at_noise": "at_noise", "attribution": "depends_on", "not_formed": "drift"}


def _maps(result: Result, place: Figures) -> str:
    shown = figures.as_maps(result)
    options = [
        (first_upper(b["title"]), place.place(compare_figures.error_maps(shown, b["name"])))
        for b in result["balances"]
        if b.get("error_maps")
    ]
    if not options:
        return ""
    lead = (
        "Each balance's residual, below its band's limit, in bins of one variable: mean (line) and the middle 80 % "
        "(band); the grey band is ± what an exact model shows. Titles give the share that the line explains on data "
        "held out."
    )
    return section("Over what it goes", lead, choice("balance", options))


def _spectra(result: Result, place: Figures) -> str:
    lead = "Amplitude density of each residual beside that of an exact model; the dashed line ends the band used above."
    return section("At which frequencies", lead, place.place(figures.spectra(result)))


def _whiteness(result: Result, place: Figures) -> str:
    if not result["whiteness"]:
        return ""
    one = next(iter(result["whiteness"].values()))
    lead = (
        f"Correlations of the balances after their noise was made white: {one['samples']} samples each, so that 95 % "
        f"of an exact model's values lie within ±1.96/√N = ±{one['bound']:.3g} (grey). With themselves over the lag, "
        "and with the drive."
    )
    return section("What is left in time", lead, place.place(figures.whiteness(result)))


def _method(result: Result) -> str:
    settings = result["settings"]
    moved = ", ".join(settings["refitted_parameters"]) or "none"
    facts = {
        "Balances": "the model is started anew from the measured state every few samples; what it gives there is "
        "set against measured motion and pressure rates",
        "Noise": f"smoothed by a cubic spline to {settings['rate']:g} samples per second; an exact model's record "
        "under the same noise (the twin) passes the same steps",
        "Parameters": f"may still move within their bounds, to first order, before anything is blamed: {moved}",
        "Shares": "least squares on whitened balances, half-second blocks left out in turn",
        "Model file": result["model"]["path"] or "–",
        "Records": ", ".join(r["source"] for r in result["records"]),
    }
    listed = "".join(tag("dt", text(k)) + tag("dd", text(v)) for k, v in facts.items())
    return section("Method", "", tag("dl", listed))
